"""Which effects to simulate, and the reason for each: from the scene, and from what a result has shown."""

import math
from collections.abc import Mapping
from itertools import pairwise
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from dlocore.effects.distance import distances
from dlocore.effects.selfcontact import NEAR_START
from dlocore.problem.events import closed_grasps
from dlocore.problem.standing import obstacle_rows
from dlocore.problem.strands import nearest_strands
from dlocore.scene.paths import Move, Waypoints
from dlocore.scene.scene import EFFECTS, Grasp, Scene
from dlocore.shape.shape import StartCurve
from dlocore.words import in_mm

Floats = NDArray[np.float64]

SLOW = 30.0  # times the first natural period: a motion this slow is quasi-static
ROLL = 0.01  # [rad]: a clamp that turns its section by more about the cable calls for twist
_ROLL_TIMES = 33  # times at which that turn is evaluated
NEAR = 0.1  # of the length: an obstacle nearer than this to the cable and its way may be touched


class Choice(NamedTuple):
    """Whether an effect is simulated, and why, in words."""

    active: bool
    reason: str


_MOVES = Choice(True, "the cable has mass and moves")
_DRAGS, _NO_DRAG = Choice(True, "the environment has drag"), Choice(False, "no drag is given")
_DAMPS = Choice(True, "the cable has internal damping")
_NO_DAMPING = Choice(False, "no internal damping is given")
_CARRIED = Choice(False, "the table carries the weight")
_STRETCHES = Choice(True, "it keeps the cable's length")
_BENDS = Choice(True, "the cable has bending stiffness")
_PLANAR = Choice(False, "the motion is planar")
_YIELDS_NOT = Choice(False, "the motion stays below the strain at which the cable yields")
_ELASTIC = Choice(False, "the cable is elastic: no yield strain is given")
_LIES = Choice(True, "the cable lies on it: it carries the weight, the motion is planar")
_NO_TABLE = Choice(False, "there is none")
_RUBS = Choice(True, "the cable slides on a rough surface")
_SMOOTH = Choice(False, "no surface here has friction")
_LIES_OVER = Choice(False, "on a table one strand can lie over another")


def choose(
    scene: Scene,
    start: StartCurve,
    dimensions: int,
    on_table: bool,
    lies_over: bool,
    leaves: str,
    met: tuple[int, ...],
    bent: bool,
    called_for: Mapping[str, str],
) -> dict[str, Choice]:
    """Choose the effects of a scene.

    Args:
        scene: the scene.
        start: start curve.
        dimensions: 2 if the motion is planar, otherwise 3.
        on_table: whether the cable lies on the table and moves in its plane.
        lies_over: whether it lies there, though it may leave the plane.
        leaves: why it does not stay in the plane of the table, in words.
        met: the obstacles that are simulated.
        bent: whether its stress-free shape is bent or twisted.
        called_for: effects that a result has called for, and the reason for each.
    """
    cable, environment = scene.cable, scene.environment
    table = environment.table is not None
    down = tuple(cast(Floats, environment.gravity).tolist())
    heavy = down != (0.0, 0.0, 0.0)
    drags = environment.drag > 0 or environment.drag_quadratic > 0
    damps = cable.bending_damping > 0 or cable.torsional_damping > 0
    plastic = cable.yields
    rough = (
        environment.table is not None and environment.table.friction > 0 and scene.effects.get("table", "auto") != "off"
    ) or any(environment.obstacles[i].friction > 0 for i in met)
    count = len(environment.obstacles)
    near = f"{len(met)} of {count} are in the cable's reach" if met else "none is near" if count else "there are none"
    found = {
        "inertia": _inertia(scene, start, on_table),
        "drag": _DRAGS if drags else _NO_DRAG,
        "damping": _DAMPS if damps else _NO_DAMPING,
        "gravity": Choice(heavy and not on_table, "the cable has weight" if heavy else "there is no gravity"),
        "stretch": _STRETCHES,
        "bend": _BENDS,
        "table": _NO_TABLE if not table else _LIES if on_table else Choice(True, leaves),
        "plasticity": _YIELDS_NOT if plastic else _ELASTIC,
        "friction": _RUBS if rough else _SMOOTH,
        "obstacles": Choice(bool(met), near),
        "self_contact": _self_contact(scene, start, lies_over),
    }
    if on_table and heavy:
        found["gravity"] = _CARRIED if down[:2] == (0.0, 0.0) else Choice(True, "the table slopes")
    for name, reason in called_for.items():
        found[name] = Choice(True, reason)
    optional = ("inertia", "self_contact", "plasticity") if plastic else ("inertia", "self_contact")
    for name, switch in scene.effects.items():
        if name != "twist" and switch == "off":
            found[name] = Choice(False, "switched off in the scene")
        elif name in optional and switch == "on" and not found[name].active:
            found[name] = Choice(True, "switched on in the scene")
    if "twist" not in called_for:
        found["twist"] = _twist(scene, start, dimensions, bent, found["plasticity"].active, found["damping"].active)
    return {name: found[name] for name in EFFECTS}


def _inertia(scene: Scene, start: StartCurve, on_table: bool) -> Choice:
    """Choose inertia unless the motion is so slow that it is quasi-static."""
    cable, environment = scene.cable, scene.environment
    moves = [g.path for g in scene.grasps if isinstance(g.path, Move)]
    smooth = len(moves) > 0 and "linear" not in [m.profile for m in moves]
    lasting = all([not isinstance(g.path, Waypoints) and g.start == 0.0 and not g.release_time for g in scene.grasps])
    rubs = environment.drag > 0 or (environment.table is not None and environment.table.friction > 0)
    heavy = not on_table and bool(cast(Floats, environment.gravity).any())
    held = rubs or heavy or len(scene.grasps) > 1
    if smooth and lasting and held and start.velocity is None and not scene.loads:
        stiffness = cast(float, cable.bending_stiffness) * (1.875 / cable.length) ** 4
        heaviest = cable.linear_density + 4.0 * sum(one.mass for one in cable.point_masses) / cable.length  # at its end
        gravity = float(np.linalg.norm(cast(Floats, environment.gravity))) if heavy else 0.0
        period = 2.0 * math.pi / math.sqrt(stiffness / heaviest + gravity / cable.length)
        shortest = min(m.duration for m in moves)
        if shortest > SLOW * period:
            reason = f"the motion is slow: {shortest:.3g} s against a first natural period of {period:.2g} s"
            return Choice(False, reason)
    return _MOVES


def _self_contact(scene: Scene, start: StartCurve, lies_over: bool) -> Choice:
    """Choose contact of the cable with itself if two strands of the start are near each other."""
    if lies_over:
        return _LIES_OVER
    diameter, control = scene.cable.diameter, np.ascontiguousarray(start.control_points)
    apart = np.inf
    if len(control) > 4 and scene.effects.get("self_contact", "auto") == "auto":
        apart = nearest_strands(start.knots, control[None], 3, diameter, NEAR_START * diameter)
    if not np.isfinite(apart):
        return Choice(False, "no two strands come near each other")
    return Choice(True, f"two strands of the start are {in_mm(apart)} apart")


def reached(scene: Scene, start: StartCurve, called_for: Mapping[str, str], at_rest: bool = False) -> tuple[int, ...]:
    """Return the numbers of the obstacles that the cable may touch.

    These are the ones near the start, or near the start moved along with the grasps: every point of the cable follows
    its grasps about as far as they go. If a result shows that the cable comes near others, that result calls for them.

    A start that settles moves from where it was given. It may have touched every obstacle that the cable can reach from
    the grasps that hold it. For an equilibrium (`at_rest`) these are all that it can reach from the paths of the
    grasps that hold it at some time.
    """
    obstacles = scene.environment.obstacles
    switch = scene.effects.get("obstacles", "auto")
    if not obstacles or switch == "off":
        return ()
    if switch == "on" or "obstacles" in called_for:
        return tuple(range(len(obstacles)))
    u = np.linspace(0.0, scene.cable.length, 41)
    points = start(u)
    shifts = [np.zeros((1, 3)), *(_way(grasp, start) - start(grasp.u)[0] for grasp in scene.grasps)]
    moved = (points[:, None] + np.concatenate(shifts)[None]).reshape(-1, 3)
    rows = obstacle_rows(scene, obstacles)
    radius = 0.5 * scene.cable.diameter
    near = distances(rows, np.ascontiguousarray(moved)).min(axis=0) - radius < NEAR * scene.cable.length
    holding = [g for g in scene.grasps if g.start == 0.0]
    if at_rest:
        near |= _in_reach(scene, start, rows, u)
    elif scene.shape.settle and holding:
        away = np.array([distances(rows, start(g.u)).min(axis=0) for g in holding]) - radius  # (grasps, obstacles)
        near |= _all_reach(u, holding, away)
    return tuple(int(i) for i in np.flatnonzero(near))


def _in_reach(scene: Scene, start: StartCurve, rows: Floats, u: Floats) -> NDArray[np.bool_]:
    """Return which obstacles places u (k,) [m] can reach, at some time, from the paths of all grasps that hold then.

    The place where a gripper closes later is known if it has waypoints or is the first. Otherwise its distance from
    each grasp that holds by then is at most the length of cable between the two.
    """
    grasps = sorted(scene.grasps, key=lambda g: g.start)
    away: dict[Grasp, Floats] = {}  # least distance of each obstacle from the path of a grasp
    for g in grasps:
        way = np.ascontiguousarray(_way(g, start))
        if g.start == grasps[0].start or isinstance(g.path, Waypoints):
            away[g] = distances(rows, way).min(axis=0) - 0.5 * scene.cable.diameter
            continue
        until = [h for h in away if h.start < g.start <= (h.release_time or np.inf)]
        least = np.array([np.full(len(rows), -np.inf), *(away[h] - abs(h.u - g.u) for h in until)]).max(axis=0)
        away[g] = least - np.linalg.norm(way - way[0], axis=1).max()
    near = np.zeros(len(rows), dtype=bool)
    times = sorted({t for g in grasps for t in (g.start, g.release_time) if t is not None})
    for begin, end in pairwise([*times, np.inf]):
        holding = closed_grasps(scene, begin, end)
        if holding:
            near |= _all_reach(u, holding, np.array([away[g] for g in holding]))
    return near


def _all_reach(u: Floats, holding: list[Grasp], away: Floats) -> NDArray[np.bool_]:
    """Return which obstacles some place u (k,) [m] can reach from all grasps; `away` (grasps, obstacles) [m]."""
    along = np.abs(u[:, None] - np.array([g.u for g in holding]))
    return np.asarray((along[:, :, None] >= away).all(axis=1).any(axis=0))


def _way(grasp: Grasp, start: StartCurve) -> Floats:
    """Return points (k, 3) [m] on the path of a grasp, as if it held the start from the beginning."""
    return grasp.path.at(np.linspace(0.0, grasp.path.duration, 17), start(grasp.u)[0])


def _twist(scene: Scene, start: StartCurve, dimensions: int, bent: bool, plastic: bool, damped: bool) -> Choice:
    switch = scene.effects.get("twist", "auto")
    if switch == "off":
        return Choice(False, "switched off in the scene")
    if switch == "on":
        return Choice(True, "switched on in the scene")
    if dimensions == 2:
        return _PLANAR
    if bent:
        return Choice(True, "the stress-free shape is bent, and its bends turn with the sections")
    if start.twisted:
        return Choice(True, "the start is twisted")
    if plastic:
        return Choice(True, "bends that the sections remember turn with them")
    if damped:
        return Choice(True, "internal damping acts on bends in the frame of the sections, which twist turns")
    turned = turned_by_grasps(scene, start)
    return Choice(bool(turned), turned or "no two grasps hold an orientation, and none turns it about the cable")


def turned_by_grasps(scene: Scene, start: StartCurve) -> str:
    """Return in words how grasps turn sections about the cable or hold them against each other, "" if they do not."""
    clamps = [g for g in scene.grasps if g.hold == "clamp"]
    if _held_together(clamps):
        return "two grasps hold the orientation of the sections"
    return "a grasp turns the sections about the cable" if any(_rolls(g, start) for g in clamps) else ""


def _rolls(grasp: Grasp, start: StartCurve) -> bool:
    """Return whether a clamp turns its section about the cable; one that closes later may do so if it turns at all."""
    path = grasp.path
    t = np.linspace(0.0, path.duration, _ROLL_TIMES)
    turned = path.rotation_at(t)
    if turned is None:
        return False
    if grasp.start > 0.0:  # where the cable will point to is not known
        return bool(np.abs(turned - np.eye(3)).max() > ROLL)
    tangent = start(grasp.u, 1)[0]
    spins = path.spin(t, turned @ (tangent / np.linalg.norm(tangent)))
    return bool(np.abs(np.cumsum(spins)).max() > ROLL)


def _held_together(grasps: list[Grasp]) -> bool:
    """Return whether two of the grasps hold at the same time."""
    for i, a in enumerate(grasps):
        for b in grasps[:i]:
            if max(a.start, b.start) < min(a.release_time or np.inf, b.release_time or np.inf):
                return True
    return False
