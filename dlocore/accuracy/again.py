"""Solve a slightly changed scene again, on the grid that was found for the previous one.

A planner, or a hand that drags a target, asks for many motions that hardly differ. The search for a grid, the start at
rest on it and its error estimate are nearly the same for all of them, and are most of the cost. They are reused here,
which leaves a single march (docs/accuracy.md, "Much the same again").
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

import numpy as np

from dlocore.accuracy.changes import with_untold
from dlocore.levels.given import given_status
from dlocore.levels.level import Level, distance, hardness, run_level
from dlocore.levels.review import called_for
from dlocore.levels.whole_march import march_status
from dlocore.prediction import Prediction
from dlocore.problem.plane import Plane
from dlocore.problem.problem import Problem
from dlocore.scene.paths import Waypoints
from dlocore.scene.scene import Grasp, Scene
from dlocore.solvers.monitor import Monitor, TimeIsUp
from dlocore.solvers.timefit import fit
from dlocore.stability.determined import DOUBTFUL, UNDETERMINED, UNSEEN, bend_in_words, goes_astray, in_words, may_grow
from dlocore.words import in_mm

_NOT_OF_THE_GRID = ("neglected", "iteration", "start")  # parts of an estimate that each solve determines itself
_ROUNDING = 1e-14  # of the coordinates of a plane that is found from points
NEAR = 0.05  # of the length: motions closer than this have similar errors (benchmarks.again)


@dataclass(frozen=True, eq=False)
class Again:
    """A march on the grid of a similar prediction.

    Attributes:
        level: the march.
        judged: the similar prediction whose error was estimated.
        errors: the parts of that estimate [m]; None if there is none.
        unseen: whether the time ran out before the effect of a disturbance was determined.
    """

    level: Level
    judged: Prediction
    errors: Mapping[str, float] | None
    unseen: bool = False

    @property
    def said(self) -> str:
        """What to say about the estimate, in words."""
        if self.errors is None:
            return ""
        away = f" On the grid of a motion {in_mm(self.level.change)} away; the error estimate is from that motion."
        if "start" in self.errors:
            away += f" But {bend_in_words(self.level.problem, self.errors['start'])}."
        return away + (f" {UNSEEN}" if self.unseen else "")


def as_solved(scene: Scene, like: Prediction) -> Scene:
    """Return a scene with the quality of the solve of a similar one, possibly finer, if both requested the same."""
    if like.level is None or scene.quality != like.scene.quality:
        return scene
    quality = like.level.posed.scene.quality
    return scene if quality == scene.quality else replace(scene, quality=quality)


def march_again(problem: Problem, like: Prediction, monitor: Monitor) -> Again | str:
    """March a problem on the grid of a similar prediction.

    Args:
        problem: with the effects that the similar prediction has called for.
        like: the similar prediction.
        monitor: of the solve.

    Returns:
        The march, or why the problem has to be solved from the beginning.
    """
    judged, before = like.judged or like, like.level
    if before is None or judged.level is None:
        return "The previous prediction has no march."
    objection = _objection(problem, like, before.posed)
    if objection:
        return objection
    grid = before.motion.grid if _starts_alike(problem, before.posed) else None
    free_knots = problem.scene.quality.n_u is None
    level = run_level(
        problem, *before.size, monitor, rho=before.motion.rho, free_knots=free_knots,
        hardness=hardness(judged.level), grid=grid, knots_t=judged.level.knots_t,
    )  # fmt: skip
    errors = {n: error for n, error in judged.accuracy.error_parts.items() if n not in _NOT_OF_THE_GRID}
    change = distance(_as_marched(judged), level) if errors else np.inf
    level = replace(level, change=change, turned=judged.level.turned, note="on the grid of a similar motion")
    if level.motion.stopped == "time":
        return Again(level, judged, None)
    length = problem.scene.cable.length
    by_march = like.accuracy.method == "march" and not free_knots
    status, message = given_status(level) if by_march else march_status(level)
    if status != "converged":
        return message
    if errors and not change <= NEAR * length:
        return f"The motion is {in_mm(change)} away from the one whose error was estimated."
    calls = called_for(level)
    if calls:
        return f"It calls for {', '.join(calls)}: {'; '.join(calls.values())}."
    if errors and like.accuracy.method == "march":
        errors = with_untold(errors, level)
    astray = _astray(level, monitor) if free_knots else 0.0
    if astray > UNDETERMINED * length:
        return f"On the grid of the similar motion {in_words(problem, astray)}."
    if errors and astray > DOUBTFUL * length:
        errors["start"] = astray
    target = problem.scene.quality.target_error
    if target is not None and sum(errors.values()) > target:
        return f"Its estimated error of {in_mm(sum(errors.values()))} is above the target."
    return Again(level, judged, errors or None, unseen=np.isnan(astray))


def _as_marched(found: Prediction) -> Level:
    """Return the march of a prediction; for a least squares, the surface that it started from."""
    level = found.level
    assert level is not None
    if found.accuracy.method == "march":
        return level
    return replace(level, control=fit(level.motion, level.knots_t)[0])


def _astray(level: Level, monitor: Monitor) -> float:
    """Return how far a tiny change of the start moves a motion in which disturbances may grow [m]; NaN if unknown."""
    if not may_grow(level.problem, level.motion):
        return 0.0
    try:
        return goes_astray(level.problem, level.motion, monitor, hard=False)
    except TimeIsUp:
        return np.nan


def _objection(problem: Problem, like: Prediction, before: Problem) -> str:
    """Return why a problem is not similar to the one before; "" if it is."""
    scene, other = problem.scene, before.scene
    if like.status != "converged":
        return "The previous prediction did not converge."
    if scene.quality != other.quality:
        return "A different accuracy or grid is requested."
    if scene.cable.length != other.cable.length:
        return "The cable has a different length."
    if problem.nc != before.nc or not _in_one_plane(problem.plane, before.plane):
        return "It moves in different dimensions or in a different plane."
    if problem.on_table != before.on_table or any(
        choice.active != before.choices[name].active for name, choice in problem.choices.items()
    ):
        return "Different effects are simulated."
    if problem.horizon != before.horizon or not _same(problem.events, before.events):
        return "Paths, grasps or the prediction begin or end at different times."
    return ""


def _in_one_plane(a: Plane, b: Plane) -> bool:
    """Tell whether two solves have the same coordinates, up to rounding."""
    return a.axes.shape == b.axes.shape and all(
        float(np.abs(x - y).max()) <= _ROUNDING for x, y in ((a.axes, b.axes), (a.origin, b.origin))
    )


def _starts_alike(problem: Problem, before: Problem) -> bool:
    """Tell whether two motions begin in the same state on the same knots."""
    scene, other = problem.scene, before.scene
    return (
        len(scene.grasps) == len(other.grasps)
        and all(_grasp_alike(a, b) for a, b in zip(scene.grasps, other.grasps, strict=True))
        and [load.u for load in scene.loads] == [load.u for load in other.loads]
        and (not scene.shape.settle or _same(scene.loads, other.loads))
        and _same(problem.obstacles, before.obstacles)
        and all(_same(getattr(scene, name), getattr(other, name)) for name in ("cable", "shape", "environment"))
        and _same(problem.start, before.start)  # the same shape may have been given a bow, see `problem/buckling.py`
    )


def _grasp_alike(a: Grasp, b: Grasp) -> bool:
    """Tell whether two grasps close in the same way at the same place of a start."""
    placed = (a.u, a.hold, a.start, a.release_time) == (b.u, b.hold, b.start, b.release_time)
    led = isinstance(a.path, Waypoints) or isinstance(b.path, Waypoints)  # to its first point at once
    return placed and (not led or _same(a.path, b.path))


def _same(a: Any, b: Any) -> bool:
    """Tell whether two values, parts of scenes or arrays are equal in all their contents."""
    if a is b:
        return True
    if type(a) is not type(b):
        return False
    if is_dataclass(a):
        return all(_same(getattr(a, f.name), getattr(b, f.name)) for f in fields(a))
    if isinstance(a, tuple | list):
        return len(a) == len(b) and all(_same(x, y) for x, y in zip(a, b, strict=True))
    if isinstance(a, np.ndarray):
        return bool(np.array_equal(a, b))
    return bool(a == b)
