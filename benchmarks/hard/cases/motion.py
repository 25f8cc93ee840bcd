"""Hard motions of the grippers."""

from dataclasses import replace
from functools import partial

import numpy as np

from benchmarks.hard import curves
from benchmarks.hard.cases.base import TARGET, WEIGHTLESS, Floats, apart, at_end, case, cord, move, overlap, samples
from benchmarks.hard.laws import held
from benchmarks.premises import snaps, strands_meet, tightens
from dlocore import (
    Environment,
    Grasp,
    Load,
    Points,
    Prediction,
    Quality,
    Scene,
    Straight,
    Table,
    Waypoints,
    equilibrium,
    predict,
)

AROUND = Environment(drag=0.1)
DAMPED = replace(WEIGHTLESS, drag=0.2)
LYING = Environment(drag=0.2, table=Table())
ANSWERED = Quality(target_error=TARGET)  # of what a cable of a metre is compared with, whatever its own method


def _moved(distance: float, time: float, **changes: object) -> Scene:
    grasps = (Grasp(u=0.0, path=move(0, distance, time=time)),)
    return Scene(cable=cord(axial_stiffness=2e4), shape=Straight(), grasps=grasps, environment=LYING, **changes)  # type: ignore[arg-type]


@case("motion", "all laws")
def half_a_metre_in_50_ms() -> Scene:
    """19 m/s and 1100 m/s^2 at the gripper: a wave runs along the cable for twice as long as the move takes."""
    return _moved(0.5, 0.05, horizon=0.15)


def _of_inertia(p: Prediction) -> float:
    """Return the distance from the motion without inertia."""
    return apart(p, predict(replace(p.scene, effects={"inertia": "off"}, quality=ANSWERED)))


@case("motion", "all laws; inertia does not matter", error=_of_inertia, within=1e-3)
def half_a_metre_in_100_s() -> Scene:
    """A hundred times the natural period: steps must not shrink to that of the waves."""
    return _moved(0.5, 100.0)


def _drift(p: Prediction) -> float:
    u, t = samples(p)
    r = p.surface.positions(u, t)
    return float(np.linalg.norm(r - r[:1], axis=-1).max())


@case("motion", "nothing moves", error=_drift, within=1e-6)
def zero_displacement() -> Scene:
    """A path that goes nowhere, at a settled start: only rounding could move it."""
    points = curves.arc(1.0, 1.5, "upright")
    grasps = (Grasp(u=0.0), Grasp(u=1.0, path=move(0, 0, 0)))
    return Scene(cable=cord(), shape=Points(points=points, settle=True), grasps=grasps, environment=AROUND)


@case("motion", "a SceneError that names the duration", refused="duration")
def zero_duration() -> Scene:
    """A displacement in no time has no velocity."""
    return _moved(0.5, 0.0)


@case("motion", "all laws")
def jump_in_velocity() -> Scene:
    """The gripper has 0.5 m/s at once: the jump is an impulse, and the reactions are no function there."""
    path = move(0, 0.5, time=1.0, profile="linear")
    grasps = (Grasp(u=0.25, path=path),)
    return Scene(cable=cord(), shape=Straight(), grasps=grasps, environment=LYING, horizon=1.2)


def _off_its_path(p: Prediction) -> float:
    """Return how far the grasped point is from its gripper, at any time."""
    return max(held(p))


@case("motion", "all laws; the gripper's path is kept", error=_off_its_path, within=5e-4)
def waypoints_of_30_s_at_100_hz_with_noise() -> Scene:
    """3000 waypoints with 0.1 mm of noise: accelerations of 3 m/s^2 at every one."""
    t = np.linspace(0.0, 30.0, 3001)
    noise = 1e-4 * np.random.default_rng(7).normal(size=(3001, 3)) * [1, 1, 0]
    noise[0] = 0.0
    way = np.column_stack([0.2 * np.sin(0.4 * t) ** 2, 0.3 * np.sin(0.25 * t) ** 2, 0 * t])
    grasps = (Grasp(u=0.0, path=Waypoints(times=t, positions=way + noise)),)
    around = Environment(drag=0.5, table=Table())
    cable = cord(bending_stiffness=1e-2, axial_stiffness=2e4)
    quality = Quality(target_error=0.01)
    return Scene(cable=cable, shape=Straight(), grasps=grasps, environment=around, quality=quality)


@case("motion", "all laws")
def grasp_and_release_in_mid_motion() -> Scene:
    """One gripper opens while it moves and another closes on the flying cable at once."""
    grasps = (
        Grasp(u=0.1, path=move(0, 0.4), release_time=0.6),
        Grasp(u=0.8, hold="tangent", path=move(0.1, -0.2), grasp_time=0.6),
    )
    return Scene(cable=cord(axial_stiffness=2e4), shape=Straight(), grasps=grasps, environment=LYING)


@case("motion", "all laws")
def grasps_at_the_very_ends() -> Scene:
    """Both ends are held in direction too: no free end is left to any mode."""
    points = curves.arc(1.0, 1.0, "flat")
    turn = move(-0.2, 0.1, 0.1, rotation=(0.3, 0.2, 0.5))
    grasps = (Grasp(u=0.0, hold="tangent"), Grasp(u=1.0, hold="tangent", path=turn))
    shape = Points(points=points, settle=True)
    return Scene(cable=cord(), shape=shape, grasps=grasps, environment=replace(DAMPED, drag=0.3))


def _from_one_gripper(p: Prediction) -> float:
    one = Grasp(u=0.4005, hold="tangent", path=p.scene.grasps[0].path)
    return apart(p, predict(replace(p.scene, grasps=(one,), quality=ANSWERED)))


@case("motion", "that of one gripper that holds position and direction", error=_from_one_gripper)
def two_grasps_1_mm_apart() -> Scene:
    """The cable between them is a thousandth of it: its knots, and reactions of opposite sign, are huge."""
    way = move(0, 0.3, 0.1)
    grasps = (Grasp(u=0.4, path=way), Grasp(u=0.401, path=way))
    return Scene(cable=cord(), shape=Straight(), grasps=grasps, environment=replace(DAMPED, drag=0.3))


def _from_line(p: Prediction) -> float:
    u = np.linspace(0.0, 1.0, 65)
    return float(np.linalg.norm(at_end(p, u) - np.outer(u, [1.0, 0, 0]), axis=1).max())


def _chord(points: Floats) -> Floats:
    """Return points turned and shifted so that they start at the origin and end on the x-axis."""
    points = points - points[0]
    end = points[-1] / np.linalg.norm(points[-1])
    turn = np.array([[end[0], end[1], 0], [-end[1], end[0], 0], [0, 0, 1]])
    return np.asarray(points @ turn.T)


@case("motion", "the straight line between the grippers", error=_from_line, within=5e-3)
def pulled_exactly_taut() -> Scene:
    """At the end the cable is as long as the distance: the last slack goes with the root of the way, and tension rises
    without bounds."""
    points = _chord(curves.arc(1.0, 1.5, "flat"))
    path = move(1.0 - float(points[-1, 0]), 0.0)
    grasps = (Grasp(u=0.0), Grasp(u=1.0, path=path))
    around = replace(LYING, drag=1.0)
    return Scene(cable=cord(), shape=Points(points=points), grasps=grasps, environment=around, horizon=2.5)


def _compressed(bow: float, short: float, around: Environment) -> Scene:
    shape = Straight() if bow == 0.0 else Points(points=_chord(curves.arc(1.0, bow, "flat")))
    far = 1.0 if bow == 0.0 else float(np.asarray(shape.points)[-1, 0])  # type: ignore[union-attr]
    grasps = (Grasp(u=0.0), Grasp(u=1.0, path=move(short - far, 0.0, time=2.0)))
    return Scene(cable=cord(bending_stiffness=1e-2), shape=shape, grasps=grasps, environment=around)


def _elastica(apart: float, p: Prediction) -> float:
    """Return the distance of the height from that of the elastica whose ends are `apart` L apart (a closed form).

    With the modulus k = sin(alpha/2): distance/L = 2 E(k)/K(k) - 1, height/L = k/K(k).
    """
    from scipy.optimize import brentq
    from scipy.special import ellipe, ellipk

    m = float(brentq(lambda m: 2 * ellipe(m) / ellipk(m) - 1 - apart, 0.1, 0.99))
    height = np.sqrt(m) / ellipk(m)
    return float(abs(np.abs(at_end(p, [0.5])[0, 1]) - height))


@case("motion", "the elastica of that distance", error=partial(_elastica, 0.05), within=1e-2)
def compressed_to_5_per_cent() -> Scene:
    """Far beyond buckling, from a start bent by 1e-2 rad: it chooses the side; the tangent is indefinite."""
    return replace(_compressed(1e-2, 0.05, replace(LYING, drag=0.3)), horizon=3.0)


@case("motion", "the elastica of that distance", error=partial(_elastica, 0.5), within=1e-2)
def compressed_from_exactly_straight() -> Scene:
    """No side to buckle to: both, and the unstable straight one, solve the equations. The message says so."""
    return replace(_compressed(0.0, 0.5, replace(LYING, drag=0.3)), horizon=4.0)


def _static(p: Prediction) -> float:
    """Return the distance of the end of the motion from the equilibrium there."""
    u = np.linspace(0.0, p.surface.length, 65)
    still = equilibrium(p.scene, at=p.surface.horizon)
    return float(np.linalg.norm(at_end(p, u) - still.positions(u), axis=1).max())


def _tips_over(p: Prediction) -> bool:
    return bool(at_end(p, [1.0])[0, 2] < 0.5)


@case("motion", "the equilibrium at the end", error=_static, within=1e-2, premise=_tips_over)
def standing_on_its_end() -> Scene:
    """Upright and too tall to stand: mu g L^3/EI is 16, and 7.84 is what the foot of a straight one bears."""
    shape, foot = Straight(direction=(0.0, 0.0, 1.0)), Grasp(u=0.0, hold="clamp")
    cable = cord(bending_stiffness=0.03)
    return Scene(cable=cable, shape=shape, grasps=(foot,), environment=replace(AROUND, drag=0.5), horizon=20.0)


def _off_the_line(p: Prediction) -> float:
    """Return by how much a cable stays nearer to the line between its ends than it must when it buckles."""
    return max(0.0, 0.02 - _sidewise(p))


@case("motion", "it leaves the line", error=_off_the_line, within=0.0)
def twisted_from_exactly_straight() -> Scene:
    """Torque of three turns, 1.9 times what the straight cable bears: it leaves the line to no side of its own."""
    path = move(-0.05, 0, 0, time=3.0, rotation=(6.0 * np.pi, 0.0, 0.0))
    grasps = (Grasp(u=0.0, hold="clamp"), Grasp(u=1.0, hold="clamp", path=path))
    cable = cord(bending_stiffness=1e-2, torsional_stiffness=1e-2)
    return Scene(cable=cable, shape=Straight(), grasps=grasps, environment=replace(WEIGHTLESS, drag=1.0))


@case("motion", "all laws", premise=snaps)
def snap_through_of_a_clamped_arch() -> Scene:
    """A force near its middle pushes an arch until it snaps to its other side: the tangent is singular on the way."""
    x = np.linspace(0.0, 0.95, 61)
    points = np.column_stack([x, 0.14144 * np.sin(np.pi * x / 0.95) ** 2, 0 * x])  # 1 m long
    push = Load(u=0.48, force=[[0, 0, 0], [0, -0.6, 0]], times=[0.0, 2.0])
    return Scene(
        cable=cord(bending_stiffness=1e-2),
        shape=Points(points=points, settle=True),
        grasps=(Grasp(u=0.0, hold="tangent"), Grasp(u=1.0, hold="tangent")),
        loads=(push,),
        environment=replace(LYING, drag=1.0),
        horizon=2.0,
    )


def _twisted(turns: float, closer: float, bow: float, time: float, **cable: float) -> Scene:
    points = _chord(curves.arc(1.0, bow, "flat"))
    angle = 0.5 * bow  # of the tangent at the end, and about it the gripper turns
    tangent = np.array([np.cos(angle), -np.sin(angle) * np.sign(points[len(points) // 2, 1]), 0.0])
    path = move(-closer, 0, 0, time=time, rotation=2 * np.pi * turns * tangent)
    grasps = (Grasp(u=0.0, hold="clamp"), Grasp(u=1.0, hold="clamp", path=path))
    made = cord(bending_stiffness=1e-2, torsional_stiffness=1e-2, **cable)
    return Scene(cable=made, shape=Points(points=points), grasps=grasps, environment=replace(WEIGHTLESS, drag=1.0))


def _sidewise(p: Prediction) -> float:
    return float(np.linalg.norm(at_end(p, np.linspace(0, 1, 65))[:, 1:], axis=1).max())


@case("motion", "nearly straight: it stays within the bow that it began with", error=_sidewise, within=0.02)
def twisted_short_of_the_critical_twist() -> Scene:
    """Four fifths of the critical twist of a clamped rod, 8.99 EI/GJ rad: the softest mode is nearly free."""
    return _twisted(0.8 * 8.9868 / (2 * np.pi), 0.0, 1e-2, 2.0)


@case("motion", "all laws; the cable leaves the line", error=_off_the_line, within=0.0)
def twisted_past_the_critical_twist() -> Scene:
    """1.3 times the critical twist, with the ends 2 % nearer: the cable throws itself into a helix."""
    return _twisted(1.3 * 8.9868 / (2 * np.pi), 0.02, 1e-2, 2.0)


def _torque(p: Prediction) -> float:
    """Return the difference of the torque at the end from that of the turns along a straight cable, of that torque."""
    exact = 20.0 * np.pi * float(p.scene.cable.torsional_stiffness or 0.0) / p.surface.length
    return abs(float(np.linalg.norm(p.grasps[1].moment[-1])) / exact - 1.0)


@case("motion", "all laws; the torque is that of ten turns", error=_torque, within=1e-3)
def ten_turns() -> Scene:
    """63 rad of twist in a cable stiff enough to bear it: the angle must not be taken modulo a turn."""
    scene = _twisted(10.0, 0.0, 1e-2, 5.0)
    return replace(scene, cable=replace(scene.cable, torsional_stiffness=1e-3))


def _tightens_until_strands_meet(p: Prediction) -> bool:
    return tightens(0.3)(p) and strands_meet(p)


@case(
    "motion",
    "all laws; strands stay a diameter apart",
    error=overlap,
    within=0.02 * 0.005,
    premise=_tightens_until_strands_meet,
)
def tightening_a_loop() -> Scene:
    """A loop in space is pulled until its radius is a quarter of what it was: contact of the cable with itself.

    Its clamps keep its twist, without which it would open, and add to it, until the strands touch.
    """
    points = curves.loop(1.0, 0.6, 0.03, "flat")
    far = float(points[-1, 0] - points[0, 0])
    path = move(0.75 * (0.98 - far), 0, time=2.0, rotation=(0.6 * np.pi, 0.0, 0.0))
    grasps = (Grasp(u=0.0, hold="clamp"), Grasp(u=1.0, hold="clamp", path=path))
    cable = cord(rest_shape="initial", torsional_stiffness=1e-2)
    return Scene(cable=cable, shape=Points(points=points), grasps=grasps, environment=replace(WEIGHTLESS, drag=0.5))


@case("motion", "the equilibrium at the end", error=_static, within=5e-3)
def slow_lift_of_a_hanging_cable() -> Scene:
    """So slow that it hangs in equilibrium all the time, with weak damping."""
    points = curves.arc(1.0, 1.6, "upright")
    grasps = (Grasp(u=0.0), Grasp(u=1.0, path=move(-0.1, 0.1, 0.2, time=10.0)))
    return Scene(
        cable=cord(), shape=Points(points=points, settle=True), grasps=grasps, environment=Environment(drag=0.2)
    )
