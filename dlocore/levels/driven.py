"""Grippers that close beside the cable or drive it into something: no cable can follow, but only the motion shows it.

Grasps that hold from the beginning are checked before anything is solved (`problem/checks.py`). The path of a grasp
that closes later begins where the cable is by then, and whether two strands meet is not known beforehand.
"""

import math
from collections.abc import Callable, Iterator
from functools import partial
from itertools import combinations
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from dlocore.effects.selfcontact import APART
from dlocore.problem.brought import GRASP_TOLERANCE
from dlocore.problem.checks import TOO_DEEP
from dlocore.problem.depths import depths_by_name
from dlocore.problem.problem import Problem
from dlocore.scene.paths import Waypoints, held_at
from dlocore.scene.scene import Grasp, Scene
from dlocore.solvers.march import March
from dlocore.spline import design_matrix
from dlocore.words import in_mm

Floats = NDArray[np.float64]

_LOOKS = 129  # times at which a path is checked while it is held


class Driven(NamedTuple):
    """How deep a grasp drives what it holds into something.

    Attributes:
        grasp: its index.
        into: what it drives it into, as part of a sentence.
        time: when it is deepest [s].
        depth: [m].
    """

    grasp: int
    into: str
    time: float
    depth: float


def driven(problem: Problem, motion: March) -> Driven | None:
    """Return where a gripper drives its grasped point into something by more than TOO_DEEP, the deepest case, or None.

    That may be an obstacle, the table, or another held point of the cable within a diameter. Paths are checked to their
    end, from where the point is in the motion when the gripper closes; the motion itself may have ended before.
    """
    scene = problem.scene
    late = any(g.start > 0.0 for g in scene.grasps) and problem.contact is not None
    if not late and (problem.self_contact is None or len(scene.grasps) < 2):
        return None
    begins = [_begin(problem, motion, grasp) for grasp in scene.grasps]
    found = [*_into_surroundings(problem, begins), *_into_each_other(problem, begins)]
    deepest = max(found, key=lambda one: one.depth, default=None)
    too_deep = TOO_DEEP * scene.cable.diameter
    return deepest if deepest is not None and deepest.depth > too_deep else None


def closes_beside(problem: Problem, motion: March) -> str:
    """Return a message if a gripper closes beside the cable, see `beside`; else ""."""
    return beside(problem.scene, partial(_begin, problem, motion))


def beside(scene: Scene, place: Callable[[Grasp], Floats | None]) -> str:
    """Return a message if a gripper with waypoints closes beside the cable, farther off than is allowed; else "".

    `place` returns where the cable is when a grasp closes (3,) [m]; None if that is not known.
    """
    for k, grasp in enumerate(scene.grasps):
        if not (isinstance(grasp.path, Waypoints) and 0.0 < grasp.start < cast(float, scene.horizon)):
            continue
        begin, first = place(grasp), cast(Floats, grasp.path.positions)[0]
        if begin is not None and (away := math.dist(begin, first)) > GRASP_TOLERANCE:
            there = ", ".join(f"{x:.4g}" for x in begin)
            return (
                f"primitives[{k}].path.positions[0] is {in_mm(away)} from the cable at u = {grasp.u:g} m, which is at "
                f"({there}) m when the gripper closes there, at {grasp.start:.4g} s. Allowed: {in_mm(GRASP_TOLERANCE)}."
            )
    return ""


def words(problem: Problem, found: Driven) -> str:
    """Return a message about where a gripper drives what it holds."""
    share = found.depth / problem.scene.cable.diameter
    point = f"primitives[{found.grasp}] drives the point that it holds {share:.0%} of the cable's diameter"
    where = f"{point} into {found.into} at {found.time:.3g} s, which no cable can follow."
    return f"{where} Its path begins where the cable then is: end the path elsewhere, or close at another time."


def _begin(problem: Problem, motion: March, grasp: Grasp) -> Floats | None:
    """Return where the path of a grasp begins (3,) [m]; None if the motion did not get that far."""
    if grasp.start == 0.0:
        return problem.start.place(grasp.u)[0]
    k = int(np.searchsorted(motion.times, grasp.start * (1 - 1e-12)))
    if k >= len(motion.times) or (motion.stopped and k > motion.reached):
        return None
    dimensions = problem.plane.dimensions
    at = design_matrix(motion.grid.knots, [grasp.u])[0] @ motion.states[k][:, :dimensions]
    return problem.plane.world(at)


def _held(scene: Scene, grasps: list[Grasp]) -> Floats:
    """Return times at which all of the given grasps hold [s]; empty if they never do."""
    begin = max(g.start for g in grasps)
    end = min(cast(float, scene.horizon), *(g.release_time or np.inf for g in grasps))
    if not begin < end:
        return np.empty(0)
    ends = [g.start + g.path.duration for g in grasps]
    return np.union1d(np.linspace(begin, end, _LOOKS), np.clip(ends, begin, end))


def _into_surroundings(problem: Problem, begins: list[Floats | None]) -> Iterator[Driven]:
    """Yield how deep each grasp that closes late goes into each obstacle, and into the table."""
    for k, (grasp, begin) in enumerate(zip(problem.scene.grasps, begins, strict=True)):
        t = _held(problem.scene, [grasp])
        if grasp.start == 0.0 or begin is None or not len(t):
            continue
        path = np.ascontiguousarray(held_at(grasp.path, t - grasp.start, begin))
        for name, depth in depths_by_name(problem, path).items():
            deepest = int(np.argmax(depth))
            yield Driven(k, name, float(t[deepest]), float(depth[deepest]))


def _into_each_other(problem: Problem, begins: list[Floats | None]) -> Iterator[Driven]:
    """Yield how far each pair of held points that begin apart comes within a diameter, where strands may not cross."""
    scene, diameter = problem.scene, problem.scene.cable.diameter
    if problem.self_contact is None:
        return
    for j, k in combinations(range(len(scene.grasps)), 2):
        a, b = scene.grasps[j], scene.grasps[k]
        first, second, t = begins[j], begins[k], _held(scene, [a, b])
        if first is None or second is None or not len(t) or abs(a.u - b.u) < APART * diameter:
            continue
        apart = np.linalg.norm(held_at(a.path, t - a.start, first) - held_at(b.path, t - b.start, second), axis=1)
        if apart[0] >= diameter:
            nearest = int(np.argmin(apart))
            into = f"the one that primitives[{j}] holds"
            yield Driven(k, into, float(t[nearest]), float(diameter - apart[nearest]))
