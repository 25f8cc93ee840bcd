"""A least squares that started from the march of a level: how it ended, and the message about it."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dlocore.answer.parts import Status
from dlocore.levels.given import evenly_fitted, given_status
from dlocore.levels.level import Level
from dlocore.levels.whole_march import Outcome
from dlocore.scene.scene import Quality
from dlocore.solvers.monitor import Monitor
from dlocore.solvers.paper import BEYOND
from dlocore.solvers.spacetime import FindForces, Solved
from dlocore.words import counted, in_ms

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True, eq=False)
class Ended:
    """The result shown for a least squares that has ended.

    Attributes:
        level: of the march that it started from, with the control points that are shown.
        method: the method that these come from.
        status: as of a prediction.
        message: what to say about it, in words.
        left: its last update, or that of the march shown instead [m].
        find_forces: finds what holds the cable in the last iterate; None: the march gives it.
    """

    level: Level
    method: str
    status: Status
    message: str
    left: float
    find_forces: FindForces | None


def ended(level: Level, quality: Quality, method: str, solved: Solved, count: int, monitor: Monitor) -> Ended:
    """Return the result to show for a solution by "spacetime" or "paper" after `count` iterations.

    If "spacetime" does not converge, or the iterates grow beyond all bounds, the march that it started from is shown
    instead.
    """
    problem, iterations = level.problem, counted(count, "iteration")
    if solved.converged:
        status: Status = "converged"
        message = f"The update fell below delta = {quality.threshold:g} m in {iterations}."
    else:
        status = "max_iterations"
        message = (
            f"The update fell to {solved.update:.2g} m in {iterations}, not below delta = {quality.threshold:g} m. "
            "Raise n_u and n_t, allow a larger delta, or use method march."
        )
    if problem.self_contact is not None:
        message += " The least squares leaves out contact of the cable with itself; method march includes it."
    control, find_forces, left = solved.control, solved.find_forces, solved.update
    if not solved.converged and method == "spacetime":
        level = evenly_fitted(level)
        control, find_forces, left = level.control, None, level.motion.update
        if quality.method == "auto":
            method, status, found = "march", *given_status(level)
            message = (
                f"{found} The least squares did not converge in {iterations}, which took "
                f"{in_ms(monitor.phases['spacetime'])}: the surface is that of the march it started from."
            )
        else:
            message += " The surface is that of the march it started from."
    elif not np.abs(control).max() <= BEYOND * problem.scene.cable.length:
        status = "stalled"
        message += " The iterates grew beyond all bounds; the surface is that of a march."
        control, left = level.control, level.motion.update
    shown = replace(level, control=control)
    return Ended(level=shown, method=method, status=status, message=message, left=left, find_forces=find_forces)


def out_of_time(level: Level, method: str, control: Floats, count: int) -> Outcome:
    """Return the result to show if the time ran out after `count` iterations, the last of which led to `control`."""
    if method == "paper":
        message = "The time limit passed; this is the last iterate. Allow more time or a coarser grid."
        return Outcome(replace(level, control=control), "time_limit", message, None)
    message = (  # iterates that have not converged may be far off
        f"The time limit passed after {counted(count, 'iteration')} of the least squares. "
        "Allow more time or a coarser grid. The surface is that of the march it started from."
    )
    return Outcome(evenly_fitted(level), "time_limit", message, None)
