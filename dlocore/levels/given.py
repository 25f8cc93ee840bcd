"""A march on a given grid: tried again in another way if it fails on the grid as it is."""

from dataclasses import replace

import numpy as np

from dlocore.answer.parts import Status
from dlocore.levels.level import Level, Size, given_steps
from dlocore.levels.progress import record_level
from dlocore.levels.whole_march import is_folded, march_level, march_status
from dlocore.problem.problem import Problem
from dlocore.solvers.monitor import Monitor, TimeIsUp
from dlocore.solvers.timefit import evened, fit, largest
from dlocore.words import in_mm

MISSED = 0.02  # of the length: a time spline that misses its march by more is not a valid answer
# what is tried if a march finds no equilibrium, folds or tears the cable: the factor on the steps, and whether more
# points watch the length
_OTHERWISE = ((4, False), (1, True), (4, True), (16, False))


def march_given(problem: Problem, n_u: int, n_t: int, monitor: Monitor) -> Level:
    """March on a given grid; if that fails, use more steps, or points between which the cable can't fold.

    The first march that succeeds is the answer, and its message says what was done. If none does, the answer is the
    first of all.
    """
    size = Size(n_u, n_t, given_steps(n_t))
    first = level = march_level(problem, size, monitor)
    if march_status(level)[0] in ("converged", "time_limit"):
        return level
    shown = first
    for more, watch in _OTHERWISE:
        record_level(level, monitor)
        try:
            level = march_level(problem, size._replace(steps=more * size.steps), monitor, watch=watch, whole=True)
        except TimeIsUp:
            monitor.phase("march")
            break
        note = f"{level.size.steps} steps" + (", watched at more points" if watch else "")
        level = replace(level, note=note, mended=_said(first, size.steps, watch))
        status = given_status(evenly_fitted(level))[0]
        if status == "converged" or (status == "max_iterations" and not is_folded(first)):
            return level
        if status == "max_iterations":  # a success except for the time spline
            shown = level
    return shown


def _said(first: Level, steps: int, watch: bool) -> str:
    failed = march_status(first)[1].split(". ")[0]
    stiffer = " Here its length is watched at more points, which makes the cable stiffer on few control points."
    return f" On the grid as given, with {steps} steps: {failed}." + (stiffer if watch else "")


def evenly_fitted(level: Level) -> Level:
    """Return a level of a given grid, with moved time knots if its time spline misses the march by more than MISSED."""
    motion, problem = level.motion, level.problem
    if motion.stopped or not level.missed > MISSED * problem.scene.cable.length:
        return level
    period = problem.scene.swing
    knots_t = evened(motion, level.knots_t, np.array([event.time for event in problem.events]), period)
    control, off = fit(motion, knots_t)
    return replace(level, knots_t=knots_t, control=control, missed=largest(motion.times, off, period))


def given_status(level: Level) -> tuple[Status, str]:
    """Return the status and the message of a march on a given grid."""
    status, message = march_status(level)
    if status == "converged" and level.missed > MISSED * level.problem.scene.cable.length:
        spline = f"The time spline of {len(level.control)} control points misses the march by {in_mm(level.missed)}."
        return "max_iterations", f"{message} {spline} Raise n_t."
    return status, message
