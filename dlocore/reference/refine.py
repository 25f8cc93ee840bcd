"""Refinement: rods with more and more elements and shorter and shorter steps, until their motions agree."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from dlocore.problem.events import moments
from dlocore.problem.problem import Problem, pose
from dlocore.reference.motion import Motion, Watch, events_of, simulate
from dlocore.reference.rod import Rod, build, nodes_of, solid
from dlocore.reference.sampling import Samples, samples
from dlocore.reference.surface import gap
from dlocore.solvers.monitor import TimeIsUp
from dlocore.stability.determined import DISTURBED, UNDETERMINED, farther

Floats = NDArray[np.float64]

ELEMENTS = 20  # of the coarsest rod
LEVELS = 6  # of refinement: up to 640 elements
LEAST = 3  # rods: two changes, which show how fast they converge
FIRMER = 4.0  # times: with each refinement friction gives way a quarter as far
STEP = 1e-2  # of the target: the error of a step of the coarsest rod; a quarter of it with each refinement
SECOND = 4.0  # change over next change, for second order
ORDERLY = (2.5, 8.0)  # change over next change, about 4: motions that converge with second order
SLOWEST = 1.5  # change over next change: below this, and above the orderly range, no limit is extrapolated
SLOW = 2.0  # times the last change: the estimate if no limit is extrapolated
CHANCE = 0.05  # of the change before: the least estimate, because a far smaller last change may be chance
FOURTH = 15.0  # divisor of a change: what an extrapolation of fourth order leaves
DEEP = 0.02  # of the diameter: a motion that goes deeper into a surface is repeated with stiffer contact
STIFFER = (2.0, 30.0)  # the least and largest factor for that
STIFFEST = 1e5  # times the stiffness that bears the weight
HELD = 0.1  # of the length: so near to what holds it, a rod is hardly bent
TIMES = 129  # per swing of a cable, at which motions are compared, in addition to events


@dataclass(frozen=True, eq=False)
class Level:
    """A simulated rod.

    Attributes:
        motion: of the rod.
        taken: the same in the world.
        change: largest distance to the rod before, at the nodes of that one [m]; infinite for the first.
        estimate: estimated error of the answer if this rod is the finest [m]; infinite if unknown.
        orderly: whether the last changes fall as the square of the spacing, so that extrapolation helps.
    """

    motion: Motion
    taken: Samples
    change: float
    estimate: float
    orderly: bool


@dataclass(frozen=True, eq=False)
class Refined:
    """The outcome of a refinement: all levels, the posed scene, and what ended it.

    Attributes:
        problem: the posed scene, with the obstacles that the motion met.
        levels: the rods, by rising number of elements.
        ended: "agreed" within the target, "finest" rod, out of "time", or a "step" without solution.
        astray: how far a small bend of the rod changes the motion [m]; 0 if that does not matter or was not checked
            (`goes_astray`), NaN if the time was up before it was known.
    """

    problem: Problem
    levels: tuple[Level, ...]
    ended: Literal["agreed", "finest", "time", "step"]
    astray: float = 0.0

    @property
    def estimate(self) -> float:
        """Estimated error of the answer [m]."""
        return self.levels[-1].estimate

    @property
    def u(self) -> Floats:
        """Material coordinates (n,) [m] of the answer: those of the finest rod, or of the one before."""
        return self.levels[-2 if self.levels[-1].orderly else -1].taken.u

    def positions(self, t: Floats) -> Floats:
        """Return the answer (m, n, 3) [m] at times t (m,) [s]: that of the finest rod, extrapolated if that helps."""
        last = self.levels[-1]
        fine = last.taken.positions(t)
        if not last.orderly:
            return fine
        return fine[:, ::2] + (fine[:, ::2] - self.levels[-2].taken.positions(t)) / 3.0


def refine(
    problem: Problem,
    target: float,
    watch: Watch,
    on_level: Callable[[Problem, Level], None],
    suffices: Callable[[Refined], bool] = lambda refined: True,
) -> Refined:
    """Simulate rods with more and more elements until the estimated error is at most `target` [m].

    Args:
        problem: the posed scene.
        target: [m].
        watch: checked within the simulations.
        on_level: called with each rod.
        suffices: whether rods that agree are fine enough; if not, finer ones are simulated.

    Raises:
        what `watch.check` raises, except its `TimeIsUp`.
    """
    levels: list[Level] = []
    stiffening = 1.0
    ended: Literal["agreed", "finest", "time", "step"] = "finest"
    while len(levels) < LEVELS:
        k = len(levels)
        rod = build(problem, nodes_of(problem, ELEMENTS, k), stiffening, FIRMER**k)
        motion = simulate(rod, _tolerance(target, k), watch)
        if motion.stopped == "time" and levels:
            return Refined(problem, tuple(levels), "time")
        if motion.stopped == "step" and levels:
            return Refined(problem, tuple(levels), "agreed" if ended == "agreed" else "step")
        stiffer = stiffened(problem, motion, stiffening)
        if stiffer > stiffening:
            stiffening = stiffer
            continue
        met = {} if motion.stopped else _met(problem, samples(motion))
        if met:
            problem, levels = pose(problem.scene, {**problem.called_for, **met}), []
            continue
        levels.append(_compared(problem, levels, motion))
        on_level(problem, levels[-1])
        if motion.stopped:
            ended = motion.stopped
            break
        if len(levels) >= LEAST and levels[-1].estimate <= target:
            ended = "agreed"
            if suffices(Refined(problem, tuple(levels), ended)):
                break
        else:
            ended = "finest"
    return Refined(problem, tuple(levels), ended)


def goes_astray(refined: Refined, target: float, watch: Watch) -> float:
    """Return how far a motion changes if its rod is at times bent by DISTURBED of the length [m]: `Refined.astray`.

    If rods agree, this is checked on the last but one. If that changes by more than UNDETERMINED of the length, it is
    checked on the last one too.
    """
    moved, length = 0.0, refined.problem.scene.cable.length
    t = np.linspace(0.0, refined.problem.horizon, moments(refined.problem.scene, TIMES))
    for k in (len(refined.levels) - 2, len(refined.levels) - 1) if refined.ended == "agreed" else ():
        try:
            moved = farther(partial(_moved, refined.levels[k], _tolerance(target, k), watch, t), length)
        except TimeIsUp:
            return np.nan
        if moved <= UNDETERMINED * length:
            return 0.0
    return moved


def _moved(level: Level, tolerance: float, watch: Watch, t: Floats, way: float) -> float:
    """Return how far bends, times `way`, change the motion of a rod at times t (m,) [s] [m]; 0 if a step fails.

    Raises:
        TimeIsUp: the deadline passed.
    """
    rod = level.motion.rod
    other = simulate(rod, tolerance, watch, lambda x: way * bend_of(rod, x))
    if other.stopped == "time":
        raise TimeIsUp
    return 0.0 if other.stopped else _farthest(samples(other).positions(t), level.taken.positions(t))


def bend_of(rod: Rod, x: Floats) -> Floats:
    """Return displacements (n, 3) [m] across a rod at x (n, 3) [m]: some half waves of up to DISTURBED of its length.

    They vanish at everything that holds it at some time.
    """
    scene, u = rod.problem.scene, rod.u[:, None]
    length = scene.cable.length
    waves = np.sin(np.pi * u / length * [1.0, 2.0, 3.0]) @ np.random.default_rng(1).normal(size=(3, 3))
    for g in scene.grasps:
        waves *= 1.0 - np.exp(-(((u - g.u) / (HELD * length)) ** 2))
    if rod.planar:
        waves[:, 2] = 0.0
    along = np.gradient(x, rod.u, axis=0)
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-300)
    across = waves - (waves * along).sum(axis=1, keepdims=True) * along
    return np.asarray(DISTURBED * length / np.linalg.norm(across, axis=1).max() * across)


def stiffened(problem: Problem, motion: Motion, stiffening: float) -> float:
    """Return the stiffness of contact with which to repeat a motion, as a multiple of the one that bears the weight.

    It is that of the motion, `stiffening`, if the motion is not too deep in a surface, or if contact is as stiff as it
    may be.
    """
    deep = motion.deepest / problem.scene.cable.diameter
    if deep > DEEP and stiffening < STIFFEST:
        return stiffening * float(np.clip(2.0 * deep / DEEP, *STIFFER))
    return stiffening


def _tolerance(target: float, k: int) -> float:
    """Return the error [m] allowed in each step of the rod `k`."""
    return STEP * target * 0.25**k


def _compared(problem: Problem, levels: list[Level], motion: Motion) -> Level:
    """Return a level, compared with those before it."""
    taken = samples(motion)
    if not levels:
        return Level(motion, taken, np.inf, np.inf, False)
    t = np.union1d(np.linspace(0.0, problem.horizon, moments(problem.scene, TIMES)), events_of(problem))
    fine, coarse = taken.positions(t)[:, ::2], levels[-1].taken.positions(t)
    change = _farthest(fine, coarse)
    if len(levels) < LEAST - 1:
        return Level(motion, taken, change, change, False)
    before = levels[-1].change
    orderly = ORDERLY[0] <= before / max(change, 1e-300) <= ORDERLY[1]
    if orderly:
        limit = fine + (fine - coarse) / 3.0
        last = coarse[:, ::2] + (coarse[:, ::2] - levels[-2].taken.positions(t)) / 3.0
        return Level(motion, taken, change, max(_farthest(limit[:, ::2], last), change / FOURTH), True)
    return Level(motion, taken, change, left(before, change), False)


def left(before: float, change: float) -> float:
    """Return about how much the next refinements will change, from the last two changes [m]."""
    ratio = before / max(change, 1e-300)
    if SLOWEST < ratio <= ORDERLY[1]:
        return change / (min(ratio, SECOND) - 1.0)
    return max(SLOW * change, CHANCE * before)


def _farthest(a: Floats, b: Floats) -> float:
    return float(np.linalg.norm(a - b, axis=-1).max())


def _met(problem: Problem, taken: Samples) -> dict[str, str]:
    """Return a call for obstacles, if the motion comes to one that was considered out of reach."""
    obstacles = problem.scene.environment.obstacles
    left_out = [o for o in obstacles if all(o is not other for other in problem.obstacles)]
    if not left_out or problem.scene.effects.get("obstacles") == "off":
        return {}
    normal = np.empty(3)
    some = taken.x[:: max(1, len(taken.x) // TIMES)].reshape(-1, 3)
    radius = 0.5 * problem.scene.cable.diameter
    for obstacle in left_out:
        row = solid(obstacle, False)
        near = some[np.linalg.norm(some - row[1:4], axis=1) < np.linalg.norm(row[13:16]) + row[16] + 4.0 * radius]
        if any(gap(row, x, normal) < 2.0 * radius for x in near):
            return {"obstacles": "the motion reaches one"}
    return {}
