"""Which effects a scene calls for, and the reason for each: from the scene, and from what a result has shown."""

import math
from collections.abc import Mapping
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from dlocore.effects.distance import distances
from dlocore.effects.selfcontact import NEAR_START, nearest_strands
from dlocore.paths import Move, Still
from dlocore.scene import EFFECTS, Grasp, Scene
from dlocore.shape import StartCurve

Floats = NDArray[np.float64]

SLOW = 30.0  # times the first natural period: so slow a motion goes through equilibria
NEAR = 0.1  # of the length: an obstacle nearer than this to the cable and its way may be touched


class Choice(NamedTuple):
    """Whether an effect is simulated, and why in words."""

    active: bool
    reason: str


def choose(
    scene: Scene,
    start: StartCurve,
    dimensions: int,
    on_table: bool,
    leaves: str,
    met: tuple[int, ...],
    bent: bool,
    called_for: Mapping[str, str],
) -> dict[str, Choice]:
    """Choose the effects of a scene.

    Args:
        scene: the scene.
        start: start curve.
        dimensions: 2 where the motion is planar, else 3.
        on_table: the cable lies on the table and moves in its plane.
        leaves: why it does not, in words.
        met: the obstacles that are simulated.
        bent: its stress-free shape is bent or twisted.
        called_for: effects that a result has called for, and the reason for each.
    """
    cable, environment = scene.cable, scene.environment
    table = environment.table is not None
    heavy = bool(cast(Floats, environment.gravity).any())
    drags = environment.drag > 0 or environment.drag_quadratic > 0
    damps = cable.bending_damping > 0 or cable.torsional_damping > 0
    plastic = any(x is not None for x in (cable.yield_strain, cable.yield_twist, cable.yield_stretch))
    rough = (
        environment.table is not None and environment.table.friction > 0 and scene.effects.get("table", "auto") != "off"
    ) or any(environment.obstacles[i].friction > 0 for i in met)
    count = len(environment.obstacles)
    near = f"{len(met)} of {count} are in the cable's reach" if met else "none is near" if count else "there are none"
    found = {
        "inertia": _inertia(scene, start, on_table),
        "drag": Choice(drags, "the environment has drag" if drags else "no drag is given"),
        "damping": Choice(damps, "the cable has internal damping" if damps else "no internal damping is given"),
        "gravity": Choice(heavy and not on_table, "the cable has weight" if heavy else "there is no gravity"),
        "stretch": Choice(True, "it keeps the cable's length"),
        "bend": Choice(True, "the cable has bending stiffness"),
        "table": Choice(table, "the cable lies on it: it carries the weight, the motion is planar"),
        "plasticity": Choice(False, "the motion stays below the strain at which the cable yields"),
        "friction": Choice(rough, "the cable slides on a rough surface" if rough else "no surface here has friction"),
        "obstacles": Choice(bool(met), near),
        "self_contact": _self_contact(scene, start, on_table),
    }
    if on_table and heavy:
        gravity = cast(Floats, environment.gravity)
        slopes = bool(gravity[:2].any())
        found["gravity"] = Choice(slopes, "the table slopes" if slopes else "the table carries the weight")
    if not table:
        found["table"] = Choice(False, "there is none")
    elif not on_table:
        found["table"] = Choice(True, leaves)
    if not plastic:
        found["plasticity"] = Choice(False, "the cable is elastic: no yield strain is given")
    for name, reason in called_for.items():
        found[name] = Choice(True, reason)
    optional = ("inertia", "self_contact", "plasticity") if plastic else ("inertia", "self_contact")
    for name, switch in scene.effects.items():
        if name != "twist" and switch == "off":
            found[name] = Choice(False, "switched off in the scene")
        elif name in optional and switch == "on" and not found[name].active:
            found[name] = Choice(True, "switched on in the scene")
    found["twist"] = _twist(scene, start, dimensions, bent, found["plasticity"].active, found["damping"].active)
    return {name: found[name] for name in EFFECTS}


def _inertia(scene: Scene, start: StartCurve, on_table: bool) -> Choice:
    """Choose inertia unless the motion is so slow that the cable goes through equilibria."""
    cable, environment = scene.cable, scene.environment
    moves = [g.path for g in scene.grasps if isinstance(g.path, Move)]
    smooth = all(m.profile != "linear" for m in moves) and len(moves) > 0
    lasting = all(isinstance(g.path, Move | Still) and g.start == 0.0 and not g.release_time for g in scene.grasps)
    rubs = environment.drag > 0 or (environment.table is not None and environment.table.friction > 0)
    heavy = not on_table and bool(cast(Floats, environment.gravity).any())
    held = rubs or heavy or len(scene.grasps) > 1
    if smooth and lasting and held and start.velocity is None and not scene.loads:
        stiffness = cast(float, cable.bending_stiffness) * (1.875 / cable.length) ** 4
        gravity = float(np.linalg.norm(cast(Floats, environment.gravity))) if heavy else 0.0
        period = 2.0 * math.pi / math.sqrt(stiffness / cable.linear_density + gravity / cable.length)
        shortest = min(m.duration for m in moves)
        if shortest > SLOW * period:
            reason = f"the motion is slow: {shortest:.3g} s against a first natural period of {period:.2g} s"
            return Choice(False, reason)
    return Choice(True, "the cable has mass and moves")


def _self_contact(scene: Scene, start: StartCurve, on_table: bool) -> Choice:
    """Choose contact of the cable with itself where two strands of the start are near each other."""
    if on_table:
        return Choice(False, "on a table one strand can lie over another")
    diameter, control = scene.cable.diameter, np.ascontiguousarray(start.control_points)
    apart = np.inf
    if len(control) > 4 and scene.effects.get("self_contact", "auto") == "auto":
        apart = nearest_strands(start.knots, control[None], 3, diameter, NEAR_START * diameter)
    if not np.isfinite(apart):
        return Choice(False, "no two strands come near each other")
    return Choice(True, f"two strands of the start are {apart * 1e3:.2g} mm apart")


def reached(scene: Scene, start: StartCurve, called_for: Mapping[str, str]) -> tuple[int, ...]:
    """Return the obstacles that the cable may touch: those near its start, or carried off with its grasps.

    Every point of the cable follows its grasps about as far as they go; what a result shows to come near is called
    for by it.
    """
    obstacles = scene.environment.obstacles
    switch = scene.effects.get("obstacles", "auto")
    if not obstacles or switch == "off":
        return ()
    if switch == "on" or "obstacles" in called_for:
        return tuple(range(len(obstacles)))
    points = start(np.linspace(0.0, scene.cable.length, 41))
    shifts = [np.zeros((1, 3))]
    for grasp in scene.grasps:
        t = np.linspace(0.0, grasp.path.duration, 17)
        shifts.append(grasp.path.at(t, start(grasp.u)[0]) - start(grasp.u)[0])
    moved = (points[:, None] + np.concatenate(shifts)[None]).reshape(-1, 3)
    rows = np.array([o.row() for o in obstacles])
    gaps = distances(rows, np.ascontiguousarray(moved)).min(axis=0) - 0.5 * scene.cable.diameter
    return tuple(int(i) for i in np.flatnonzero(gaps < NEAR * scene.cable.length))


def _twist(scene: Scene, start: StartCurve, dimensions: int, bent: bool, plastic: bool, damped: bool) -> Choice:
    switch = scene.effects.get("twist", "auto")
    if switch == "off":
        return Choice(False, "switched off in the scene")
    if switch == "on":
        return Choice(True, "switched on in the scene")
    if dimensions == 2:
        return Choice(False, "the motion is planar")
    if bent:
        return Choice(True, "the stress-free shape is bent, and its bends turn with the sections")
    if start.theta is not None:
        return Choice(True, "the start is twisted")
    if plastic:
        return Choice(True, "bends that the sections remember turn with them")
    if damped:
        return Choice(True, "internal damping acts on bends as the sections see them, which twist lets turn")
    if _held_together([g for g in scene.grasps if g.hold == "clamp"]):
        return Choice(True, "two grasps hold the orientation of the sections")
    return Choice(False, "nothing holds an orientation at two places")


def _held_together(grasps: list[Grasp]) -> bool:
    """Tell whether two of the grasps hold at the same time."""
    for i, a in enumerate(grasps):
        for b in grasps[:i]:
            if max(a.start, b.start) < min(a.release_time or np.inf, b.release_time or np.inf):
                return True
    return False
