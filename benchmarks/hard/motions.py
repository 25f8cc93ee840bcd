"""Motions of the grippers, each with the start shape that it needs."""

from collections.abc import Callable

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.hard import curves
from benchmarks.hard.draft import Draft, Floats, Rng, chance, in_room, pick, spread
from dlocore import Grasp, Load, Points, Still, Straight, Waypoints
from dlocore.scene.scene import Hold
from dlocore.shape.shape import StartCurve, start_curve

SLACK = 0.97  # of the cable between two grasps: the farthest that they move apart if not pulled taut


def started(d: Draft) -> StartCurve:
    """Return the curve along which the cable of a draft starts."""
    assert d.shape is not None
    return start_curve(d.shape, d.length)


def _place(r: Rng, d: Draft) -> float:
    """Draw a material coordinate: often an end, or near one."""
    where = pick(r, {"end": 3, "inside": 4, "beside an end": 1})
    if where == "inside":
        return float(r.uniform(0.05, 0.95) * d.length)
    if where == "beside an end":
        d.families.append("motion: grasp beside an end")
        return float(spread(r, 1e-4, 1e-2) * d.length)
    d.families.append("motion: grasp at an end")
    return float(r.choice([0.0, d.length]))


def _hold(r: Rng) -> Hold:
    return pick(r, {"point": 5, "tangent": 3, "clamp": 1})  # type: ignore[return-value]


def _turn(r: Rng, d: Draft, hold: Hold, most: float) -> Floats | None:
    """Draw a rotation vector of a gripper; None where it holds a point."""
    if hold == "point" or chance(r, 0.5):
        return None
    axis = {"flat": np.array([0.0, 0.0, 1.0]), "upright": np.array([0.0, 1.0, 0.0])}.get(d.room)
    return r.uniform(-most, most) * (in_room(r, "space") if axis is None else axis)


def _duration(r: Rng, d: Draft) -> float:
    pace = pick(r, {"usual": 12, "fast": 2, "slow": 1})
    if pace == "usual":
        return float(r.uniform(0.4, 1.6) * d.time)
    d.families.append(f"motion: {pace}")
    return spread(r, 0.05, 0.2) * d.time if pace == "fast" else spread(r, 5.0, 100.0) * d.time


def _profile(r: Rng, d: Draft) -> str:
    profile = pick(r, {"minimum_jerk": 7, "cubic": 2, "linear": 1})
    if profile == "linear":
        d.families.append("motion: a jump in velocity")
    return profile


def _way(r: Rng, d: Draft) -> Floats:
    if chance(r, 0.06):
        d.families.append("motion: zero displacement")
        return np.zeros(3)
    return in_room(r, d.room) * r.uniform(0.05, 0.5) * d.length


def one_gripper(r: Rng, d: Draft) -> None:
    curves.start(r, d)
    hold, duration = _hold(r), _duration(r, d)
    path = d.move(_way(r, d), duration, rotation=_turn(r, d, hold, 1.5), profile=_profile(r, d))
    d.grasps = [Grasp(u=_place(r, d), hold=hold, path=path)]
    d.horizon = duration + r.choice([0.0, 0.4]) * d.time


def two_grippers(r: Rng, d: Draft) -> None:
    """Move two grippers to another distance from each other, and both together."""
    curves.start(r, d, straight=0.0)
    ends = chance(r, 0.5)
    u = np.array([0.0, 1.0] if ends else [r.uniform(0.0, 0.35), r.uniform(0.65, 1.0)]) * d.length
    if ends:
        d.families.append("motion: grasp at an end")
    holds, duration = (_hold(r), _hold(r)), _duration(r, d)
    at = started(d)(u)
    apart = at[1] - at[0]
    most = SLACK * float(u[1] - u[0])
    direction = apart / max(float(np.linalg.norm(apart)), 1e-9) + 0.4 * in_room(r, d.room)
    target = direction / np.linalg.norm(direction) * r.uniform(0.3, 0.98) * most
    both, profile = _way(r, d) * r.choice([0.0, 1.0]), _profile(r, d)
    paths = [
        d.move(way, duration, rotation=_turn(r, d, hold, 1.0), profile=profile)
        for way, hold in zip((both, both + target - apart), holds, strict=True)
    ]
    d.grasps = [Grasp(u=float(x), hold=h, path=p) for x, h, p in zip(u, holds, paths, strict=True)]
    if chance(r, 0.15):
        d.families.append("motion: release in mid-motion")
        d.grasps[1] = Grasp(u=float(u[1]), hold=holds[1], path=paths[1], release_time=r.uniform(0.3, 0.9) * duration)
    d.horizon = duration + r.choice([0.0, 0.3]) * d.time


def pulled_taut(r: Rng, d: Draft) -> None:
    """Pull two grippers apart until the cable between them is straight, or almost."""
    d.families.append("motion: pulled taut")
    length = d.length
    d.shape = Points(points=curves.arc(length, r.uniform(0.5, 2.5), d.room))
    u = np.array([0.0, 1.0] if chance(r, 0.5) else [0.1, 0.9]) * length
    at, hold, duration = started(d)(u), "point", float(r.uniform(0.8, 2.0) * d.time)
    if chance(r, 0.3):
        hold = "tangent"
    apart = at[1] - at[0]
    reach = (1.0 - r.choice([0.0, 1e-6, 1e-4, 1e-3, 1e-2])) * float(u[1] - u[0])
    ways = (reach / float(np.linalg.norm(apart)) - 1.0) * apart
    d.grasps = [
        Grasp(u=float(u[0]), path=Still()),
        Grasp(u=float(u[1]), hold=hold, path=d.move(ways, duration)),  # type: ignore[arg-type]
    ]
    d.horizon = duration + 0.2 * d.time


def compressed(r: Rng, d: Draft) -> None:
    """Bring the ends of a nearly straight cable together, far beyond buckling."""
    d.families.append("motion: post-buckling")
    length, hold = d.length, pick(r, {"point": 3, "tangent": 2})
    bow = 0.0 if chance(r, 0.03) else spread(r, 1e-8, 1e-3) if chance(r, 0.1) else spread(r, 1e-2, 0.5)
    if bow == 0.0:
        d.families.append("geometry: straight and pushed along itself")
        d.shape = Straight()
    else:
        d.shape = Points(points=curves.arc(length, bow, d.room))
    at, duration = started(d)([0.0, length]), float(r.uniform(1.5, 4.0) * d.time)
    short = r.uniform(0.05, 0.8)
    if short < 0.15:
        d.families.append("motion: compressed below 15 % of the length")
    path = d.move((short - 1.0) * (at[1] - at[0]), duration)
    d.grasps = [Grasp(u=0.0, hold=hold), Grasp(u=length, hold=hold, path=path)]  # type: ignore[arg-type]
    d.horizon = duration


def snap_through(r: Rng, d: Draft) -> None:
    """Push an arch with held ends through to its other side, next to its middle.

    Pushed exactly in the middle, the arch would choose between two mirror images.
    """
    d.families.append("motion: snap-through")
    length, angle = d.length, r.uniform(0.6, 2.0)
    d.shape = Points(points=curves.arc(length, angle, d.room))
    start, duration = started(d), float(r.uniform(0.6, 2.0) * d.time)
    u = float(r.choice([r.uniform(0.4, 0.48), r.uniform(0.52, 0.6)]) * length)
    at = start([0.0, u, length])
    chord = (at[2] - at[0]) / np.linalg.norm(at[2] - at[0])
    rise = at[1] - at[0] - chord * float(chord @ (at[1] - at[0]))
    hold = pick(r, {"point": 1, "tangent": 1})
    through = chance(r, 0.4)
    path = d.move(-r.uniform(1.1, 1.9) * rise, duration)
    d.grasps = [
        Grasp(u=0.0, hold=hold),  # type: ignore[arg-type]
        Grasp(u=length, hold=hold),  # type: ignore[arg-type]
        Grasp(u=u, path=path, release_time=duration * r.uniform(0.6, 1.0) if through else None),
    ]
    d.horizon = duration + (0.3 * d.time if through else 0.0)


def twisted(r: Rng, d: Draft) -> None:
    """Turn one of two clamped ends about the cable, and let them come nearer."""
    d.families.append("motion: twisting")
    d.room = "space"
    length, bow = d.length, spread(r, 1e-3, 1.0)
    d.shape = Points(points=curves.arc(length, bow, "flat"))
    at, tangent = started(d)([0.0, length]), started(d)(length, 1)[0]
    turns = r.uniform(0.1, 2.0)
    if chance(r, 0.08):
        turns = 10.0
        d.families.append("motion: ten turns")
    duration = float(r.uniform(0.8, 2.0) * d.time * max(1.0, turns))
    closer = r.choice([0.0, r.uniform(0.02, 0.3)])
    tangent = tangent / np.linalg.norm(tangent)
    path = d.move(-closer * (at[1] - at[0]), duration, rotation=2 * np.pi * turns * tangent)
    d.grasps = [Grasp(u=0.0, hold="clamp"), Grasp(u=length, hold="clamp", path=path)]
    d.horizon = duration


def tightened(r: Rng, d: Draft) -> None:
    """Pull the ends of a cable with a full loop apart."""
    d.families.append("motion: tightening a loop")
    length, share = d.length, r.uniform(0.5, 0.8)
    gap = r.uniform(3.0, 8.0) * d.diameter * curves.apart(d)
    d.shape = Points(points=curves.loop(length, share, gap, d.room))
    d.room = "space" if curves.apart(d) else "flat"
    at, duration = started(d)([0.0, length]), float(r.uniform(1.0, 3.0) * d.time)
    apart = at[1] - at[0]
    far = float(np.linalg.norm(apart))
    slack = 0.9 * length - far
    path = d.move(r.uniform(0.2, 0.75) * slack * apart / far, duration)
    hold = pick(r, {"point": 2, "tangent": 1, "clamp": 1})
    d.grasps = [Grasp(u=0.0, hold=hold), Grasp(u=length, hold=hold, path=path)]  # type: ignore[arg-type]
    d.horizon = duration


def handed_over(r: Rng, d: Draft) -> None:
    """Release the cable at one place and grasp it at another while it moves."""
    d.families.append("motion: grasp and release in mid-motion")
    curves.start(r, d)
    first, second = float(r.uniform(0.0, 0.45) * d.length), float(r.uniform(0.55, 1.0) * d.length)
    duration = float(r.uniform(0.5, 1.2) * d.time)
    released = r.uniform(0.3, 1.0) * duration
    gap = r.choice([0.0, 0.1]) * d.time
    holds = (_hold(r), _hold(r))
    d.grasps = [
        Grasp(u=first, hold=holds[0], path=d.move(_way(r, d), duration), release_time=released),
        Grasp(u=second, hold=holds[1], path=d.move(0.5 * _way(r, d), duration), grasp_time=released + gap),
    ]
    # a cable that a gripper catches in flight stops there at once
    d.jump = max(d.jump, 2.0 * d.speed)
    d.horizon = released + gap + duration


def close_together(r: Rng, d: Draft) -> None:
    """Hold a cable at two points a millimetre apart, like one gripper with two fingers."""
    d.families.append("motion: two grasps 1 mm apart")
    curves.start(r, d)
    gap = 1e-3 * d.length
    u = float(r.uniform(0.1, 0.8) * d.length)
    duration, start = float(r.uniform(0.5, 1.5) * d.time), started(d)
    at = start([u, u + gap])
    way, turn = _way(r, d), float(r.uniform(-1.0, 1.0))
    spot = {"flat": [0, 0, 1.0], "upright": [0, 1.0, 0], "space": [0, 0, 1.0]}[d.room]
    times = np.linspace(0.0, duration, 41)
    s = (times / duration) ** 3 * (10 - 15 * times / duration + 6 * (times / duration) ** 2)
    turned = Rotation.from_rotvec(turn * s[:, None] * np.array(spot)).apply(at[1] - at[0])
    second = Waypoints(times=times, positions=at[0] + s[:, None] * way + turned)
    d.grasps = [Grasp(u=u, path=d.move(way, duration)), Grasp(u=u + gap, path=second)]
    d.horizon = duration


def noisy_waypoints(r: Rng, d: Draft) -> None:
    """Follow a hand: waypoints at 100 Hz with noise."""
    d.families.append("motion: noisy waypoints")
    curves.start(r, d)
    u, duration = _place(r, d), float(r.uniform(0.8, 2.0) * d.time)
    count = int(np.clip(100 * duration, 20, 400))
    t = np.linspace(0.0, duration, count)
    begin = started(d)(u)[0]
    free = {"flat": [1, 1, 0], "upright": [1, 0, 1], "space": [1, 1, 1]}[d.room]
    way = np.outer(np.sin(np.pi * t / duration / 2) ** 2, _way(r, d))
    noise = spread(r, 1e-6, 3e-4) * d.length * r.normal(size=(count, 3)) * free
    noise[0] = 0.0
    d.grasps = [Grasp(u=u, path=Waypoints(times=t, positions=begin + way + noise))]
    step = duration / (count - 1)
    d.speed = max(d.speed, float(np.abs(np.diff(way + noise, axis=0)).max()) / step)
    d.acceleration = max(d.acceleration, float(np.abs(np.diff(noise, n=2, axis=0)).max()) / step**2)
    d.horizon = duration


def loaded(r: Rng, d: Draft) -> None:
    """Hold a cable at one place and push it at another with a known force."""
    d.families.append("motion: known force")
    curves.start(r, d)
    u = float(r.choice([0.0, r.uniform(0.0, 1.0)]) * d.length)
    hold, other = _hold(r), float(r.uniform(0.0, 1.0) * d.length)
    d.grasps = [Grasp(u=u, hold=hold)]
    duration = float(r.uniform(0.5, 1.5) * d.time)
    push = in_room(r, d.room) * d.cable["linear_density"] * d.length * r.uniform(0.5, 4.0)  # [N]: up to 4 m/s^2
    d.loads = [Load(u=other, force=np.outer([0.0, 1.0, 0.0], push), times=[0.0, 0.5 * duration, duration])]
    d.speed, d.acceleration = 2.0 * duration, 4.0 * d.length / max(abs(other - u), 0.2 * d.length)
    d.horizon = duration


def thrown(r: Rng, d: Draft) -> None:
    """Let a cable fly that nothing holds."""
    d.families.append("motion: free flight")
    curves.start(r, d)
    assert d.shape is not None
    speed = r.uniform(0.2, 1.5) * d.length / d.time
    velocity = in_room(r, d.room) * speed
    d.shape = type(d.shape)(**{**vars(d.shape), "velocity": velocity})
    d.speed, d.horizon = max(d.speed, speed), float(r.uniform(0.3, 0.8) * d.time)


MOTIONS: dict[Callable[[Rng, Draft], None], float] = {
    one_gripper: 30,
    two_grippers: 22,
    pulled_taut: 5,
    compressed: 7,
    snap_through: 4,
    twisted: 6,
    tightened: 5,
    handed_over: 7,
    close_together: 3,
    noisy_waypoints: 4,
    loaded: 4,
    thrown: 3,
}


def draw_motion(r: Rng, d: Draft) -> None:
    names = {motion.__name__: weight for motion, weight in MOTIONS.items()}
    chosen = pick(r, names)
    next(motion for motion in MOTIONS if motion.__name__ == chosen)(r, d)
