"""Marches refined until two of them agree: the whole grid first, then the direction that still errs."""

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from dlocore.budget import first_level, growth
from dlocore.cost import Cost
from dlocore.discretisation import smallest_n_u
from dlocore.errors import SceneError
from dlocore.kernels.assembly import slopes
from dlocore.prediction import Status
from dlocore.problem import Problem, pose
from dlocore.progress import record_level
from dlocore.review import called_for
from dlocore.scene import Quality
from dlocore.solvers.ladder import (
    ACCEPT,
    CREDIBLE_STRAIN,
    LEVELS,
    Level,
    Size,
    distance,
    extrapolated,
    hardness,
    run_level,
    stretched,
)
from dlocore.solvers.march import RHO, STRONGLY_DAMPED, smallest_n_t
from dlocore.solvers.monitor import Monitor, TimeIsUp

AUTO_TARGET = 2e-3  # of the length: the error that quality "auto" aims at
AUTO_ENOUGH = 1e-2  # of the length: the estimated error with which it is content where the finest grids reach no closer
ROUGH = 0.05  # of the length: two grids that differ more are in no order yet: the next is marched with strong damping
TOO_DEEP = 0.25  # of the diameter, in the table, an obstacle or itself
TORN = 0.2  # axial strain: no cable of this kind follows
FOLDED = 0.4  # of |r'| between the points that watch over the length: less is a fold that no energy sees
_LOOKS = 12  # states of a motion that are searched for folds
MOST_WORK = 4e6  # control points times steps of one march in the plane; each coordinate more costs twice the time
CONTACT_COSTS = 2  # times as much work counts with contact, which takes more of the time of a step
AUTO_SHARE = 0.25  # of it for who asked for no target
MISSED_COUNTS = 3.0  # what the time spline misses of its march, times this, is the least that the error may be
_MOST_POINTS = 220  # along the cable
_FINER = {"space": 1.5, "time": 2.0}
_FINE_IN_TIME = 0.3  # of the target: a time spline that misses its march by less keeps its knots as the steps halve
_AT_BEST = 0.2  # of an error, is left by one refinement: what is still too much after all of them is not begun
_MORE = 1.1  # times as many steps: fewer are as many
_DAMPED_LEAVE = 1.5  # times the error that half as many steps again leave without strong damping: benchmarks.estimate
_FAILURES = 2  # refinements in time of a march that found no equilibrium


# by direction, "space", "time" or "both": how far its two last refinements moved the surface [m]
Changes = dict[str, tuple[float, float]]


class Outcome(NamedTuple):
    """A level of refinement, what to say of it, and the parts of its estimated error [m], or None."""

    level: Level
    status: Status
    message: str
    errors: Mapping[str, float] | None


def march_level(
    problem: Problem,
    size: Size,
    monitor: Monitor,
    rho: float = RHO,
    free_knots: bool = False,
    rough: bool = False,
    known: Level | None = None,
    before: Level | None = None,
) -> Level:
    """March on one grid; where the motion calls for effects that were left out, again with them.

    On a `rough` grid, which another follows, strands that meet may do so because of the grid: it is left open. A march
    of this grid that is `known` is done again only for what was left open. Contact begins as stiff as the level
    `before` had to make it.
    """
    called = dict(problem.called_for)
    while True:
        if free_knots:
            size = Size(max(size.n_u, smallest_n_u(problem)), max(size.n_t, smallest_n_t(problem)), size.steps)
        stiffness = 1.0 if before is None or before.posed is not problem else hardness(before)
        level = known or run_level(problem, *size, monitor, rho=rho, free_knots=free_knots, hardness=stiffness)
        if known is not None:
            new, known = dict(known.left_open), None
        else:
            new = {} if level.motion.stopped == "time" else called_for(level)
        if rough and "self_contact" in new:
            level = replace(level, left_open={"self_contact": new.pop("self_contact")})
        if not new:
            return level
        record_level(problem, replace(level, note=f"calls for {', '.join(new)}"), monitor)
        called |= new
        problem = pose(problem.scene, called)


def climb(problem: Problem, quality: Quality, monitor: Monitor, cost: Cost | None = None) -> Outcome:
    """March on finer and finer grids until two agree within the target, or the time budget is used.

    The first few refine space and time together, which is what most motions need. What is left errs mostly in one of
    them: a cable that is let go vibrates faster than it is curved, a loop that tightens is curved more than it is fast.
    So from there on each grid is finer in one direction, that whose last refinement moved the surface most, and the
    error is the sum of both. A cable that folds between its control points gets more of them, whatever grids agree on.
    The error is at least what the time spline misses of its march: a cable that trembles faster than
    two grids can show looks alike on both. A march that finds no equilibrium is tried with more steps before it is
    given up. Within a time budget the first grid is the one that what solves cost on this machine allows.

    A target that was asked for has to be met. Quality "auto" aims at AUTO_TARGET, and where the finest grids that it
    tries reach no closer, an estimate of AUTO_ENOUGH is success; the message says how far the grids agree.
    """
    length = problem.scene.cable.length
    target = quality.target_error or AUTO_TARGET * length
    enough = quality.target_error or AUTO_ENOUGH * length
    most_work = MOST_WORK * (AUTO_SHARE if quality.target_error is None else 1.0)
    budget = quality.time_budget or np.inf
    best: Level | None = None
    estimate = np.inf
    rho = RHO
    number = 0 if quality.time_budget is None else first_level(problem, cost, quality.time_budget)
    size: Size | None = stretched(problem, number)
    direction = "both"
    changes: Changes = {}
    failures = 0  # in a row
    while size is not None:
        began = monitor.elapsed()
        try:
            if best is not None:
                monitor.check()
            level = march_level(problem, size, monitor, rho, free_knots=True, rough=True, before=best)
            if best is not None and level.posed is problem:
                level = replace(level, change=distance(best, level, problem))
                if level.change <= ROUGH * length:  # so strands do not meet because of the grid
                    level = march_level(problem, size, monitor, rho, free_knots=True, known=level)
            if level.posed is not problem:
                best, changes, estimate = None, {}, np.inf  # another motion: the grid before says nothing about it
            problem = level.posed  # a rough grid may have needed contact that is too stiff for a fine one
        except TimeIsUp:
            break
        except SceneError:  # a start that finds no rest on few control points may do so on more
            number += 1
            if best is not None or number == len(LEVELS):
                raise
            size = stretched(problem, number)
            continue
        if best is not None:
            if _is_worse(level, best):
                failures += 1
                more = _affordable(_finer(size, "space" if _is_folded(best) else "time", True), problem, most_work)
                if failures <= _FAILURES and level.motion.stopped != "time" and quality.time_budget is None and more:
                    record_level(problem, level, monitor)
                    size = more
                    continue
            if level.motion.stopped and not best.motion.stopped:
                if estimate <= enough:
                    break
                status, message = march_status(problem, level)
                errors = _parts(changes, best) or ({"grid": best.change} if np.isfinite(best.change) else None)
                return Outcome(best, status, f"A finer grid was not finished: {message}", errors)
            changes[direction] = _as_by_half(level, best), changes.get(direction, (np.inf, np.inf))[0]
            estimate = max(_error(changes), MISSED_COUNTS * level.missed)
            rough = level.change > ROUGH * length
            if rough or number < len(LEVELS):  # later on two marches would differ by their damping
                rho = STRONGLY_DAMPED if rough else RHO
        record_level(problem, level, monitor)
        best, failures = level, 0
        status, message = march_status(problem, level)
        moved = f"the last refinement moved the surface by {level.change * 1e3:.2g} mm"
        if level.motion.stopped == "time":
            return Outcome(level, status, message, None)
        folded = _is_folded(level)
        unfolds = _affordable(_finer(size, "space", False), problem, most_work) if folded else None
        if estimate <= ACCEPT * target and quality.time_budget is None and unfolds is None:
            agreed = f"Two grids agree to {level.change * 1e3:.2g} mm, target {target * 1e3:.2g} mm."
            return Outcome(level, status, agreed if status == "converged" else message, _parts(changes, level))
        number += 1
        next_size: Size | None
        if number < len(LEVELS):
            next_size = stretched(problem, number)
            # more may have been needed
            next_size = next_size._replace(n_u=max(next_size.n_u, size.n_u), steps=max(next_size.steps, size.steps))
        elif unfolds is not None:
            direction, next_size = "space", unfolds
            if "both" in changes:
                changes.setdefault("time", changes["both"])  # of space, grids that agree on a fold tell nothing
        else:
            trembles = MISSED_COUNTS * level.missed > _FINE_IN_TIME * target
            finer = {d: _affordable(_finer(size, d, trembles), problem, most_work) for d in _FINER}
            direction = "time" if MISSED_COUNTS * level.missed > _error(changes) else _worst(changes)
            moved_by = changes.get(direction, (0.0, 0.0))
            if finer[direction] is None and extrapolated(*moved_by) < target:
                direction = next(d for d in _FINER if d != direction)  # may still bring the sum of both below it
            next_size = finer[direction]
            hope = _AT_BEST ** _left(next_size, direction, problem, most_work)
            if next_size is not None and hope * moved_by[0] > enough:
                next_size = None
        spent = monitor.elapsed() - began
        if next_size is not None and growth(problem, cost, size, next_size) * spent > budget - monitor.elapsed():
            if not np.isfinite(level.change):
                return Outcome(level, "time_limit", f"{budget * 1e3:.3g} ms allow one grid, unchecked.", None)
            return Outcome(level, status, f"The best grid in {budget * 1e3:.3g} ms; {moved}.", _parts(changes, level))
        size = next_size
    assert best is not None
    status, message = march_status(problem, best)
    moved = f"the last refinement moved the surface by {best.change * 1e3:.3g} mm, target {target * 1e3:.3g} mm"
    advice = "Allow a larger target_error, more time or a shorter motion."
    if status == "converged" and estimate <= enough:
        message = f"Two grids agree to {best.change * 1e3:.2g} mm, target {target * 1e3:.2g} mm."
        if estimate > target:
            message += f" No finer grid was tried; the estimated error of {estimate * 1e3:.2g} mm is above the target."
    elif status == "converged" and monitor.remaining() <= 0:
        status, message = "time_limit", f"The time limit passed; {moved}. {advice}"
    elif status == "converged":
        status, message = "max_iterations", f"No finer grid; {moved}. {advice}"
    return Outcome(best, status, message, _parts(changes, best))


def _is_worse(level: Level, best: Level) -> bool:
    """Tell whether a finer grid failed, or strained the cable beyond belief, and the one before did not."""
    torn = level.motion.largest_strain > CREDIBLE_STRAIN >= best.motion.largest_strain
    failed = bool(level.motion.stopped) and not best.motion.stopped
    stalled = march_status(level.problem, level)[0] != "converged" == march_status(best.problem, best)[0]
    return torn or failed or stalled


def _as_by_half(level: Level, before: Level) -> float:
    """Return how far a level would lie from the one before [m] if its steps were half as many again, or more.

    The errors of the steps are of second order: 1.25 of that of a level is what half as many steps again take away
    from it, 0.78 what a third as many do. Strongly damped steps, as forces with kinks ask for, are of first order in
    part: unless there are twice as many, they leave more.
    """
    more = len(level.motion.times) / len(before.motion.times)
    if more <= _MORE:
        return level.change
    counts = max(1.0, 1.25 / (more**2 - 1.0))
    if level.motion.rho == STRONGLY_DAMPED:
        counts *= min(_DAMPED_LEAVE, max(1.0, 0.5 * _DAMPED_LEAVE / (more - 1.0)))
    return counts * level.change


def _finer(size: Size, direction: str, trembles: bool) -> Size:
    """Return the next size in a direction; more time knots go with more steps only where the motion `trembles`."""
    ratio = _FINER[direction]
    if direction == "space":
        return size._replace(n_u=round(ratio * size.n_u))
    return size._replace(n_t=round(ratio * size.n_t) if trembles else size.n_t, steps=round(ratio * size.steps))


def _affordable(size: Size, problem: Problem, most_work: float) -> Size | None:
    """Return a size, or None where a march of it takes too long."""
    touches = problem.contact is not None or problem.self_contact is not None
    work = size.n_u * size.steps * 2 ** (problem.nc - 2) * (CONTACT_COSTS if touches else 1)
    return size if size.n_u <= _MOST_POINTS and work <= most_work else None


def _left(size: Size | None, direction: str, problem: Problem, most_work: float) -> int:
    """Return how many refinements in a direction are left, from a size on."""
    count = 0
    while size is not None:
        count += 1
        size = _affordable(_finer(size, direction, False), problem, most_work)
    return count


def _worst(changes: Changes) -> str:
    """Return the direction to refine: time, then space, then that which erred more."""
    unknown = [direction for direction in ("time", "space") if direction not in changes]
    return unknown[0] if unknown else max(_FINER, key=lambda direction: extrapolated(*changes[direction]))


def _error(changes: Changes) -> float:
    """Return the error [m] that the changes point to: of the whole grid, or of both directions once both are known."""
    if all(direction in changes for direction in _FINER):
        return float(sum(extrapolated(*changes[direction]) for direction in _FINER))
    return extrapolated(*changes["both"]) if "both" in changes else np.inf


def _parts(changes: Changes, level: Level) -> dict[str, float] | None:
    """Return the parts of the error [m] of a level, space and time as far as they are known apart, or None."""
    if not np.isfinite(_error(changes)):
        return None
    known = list(_FINER) if all(direction in changes for direction in _FINER) else ["both"]
    parts = {"grid" if direction == "both" else direction: extrapolated(*changes[direction]) for direction in known}
    unseen = MISSED_COUNTS * level.missed - sum(parts.values())
    if unseen > 0.0:  # what the time spline misses of its march is told by no other grid
        last = list(parts)[-1]
        parts[last] += unseen
    return parts


def march_status(problem: Problem, level: Level) -> tuple[Status, str]:
    """Return the status of a march, and what it says, in words."""
    motion = level.motion
    if not motion.stopped and motion.largest_strain > TORN:
        strain = f"The motion strains the cable along itself by {motion.largest_strain:.0%}, which no cable follows."
        advice = "Bring the grasps no farther apart than the cable between them, or make the motion slower."
        push = "A straight cable pushed along itself has no side to buckle to: start it slightly bent."
        return "stalled", f"{strain} {advice} {push}"
    if _is_folded(level):
        least, most = _slopes(level)
        seen = f"|r'| is {least:.2g} to {most:.2g} within a span"
        return "stalled", f"The cable is folded finer than its control points can show: {seen}. Take more of them."
    deep = motion.deepest / problem.scene.cable.diameter
    if not motion.stopped and deep > TOO_DEEP:
        pushed = f"The cable is pressed {deep:.0%} of its diameter into the table, an obstacle or itself."
        return "stalled", f"{pushed} Take finer grids, or a motion that does not jam it."
    if not motion.stopped:
        split = f", {motion.split} of them in smaller steps" if motion.split else ""
        return "converged", f"Every time step found its equilibrium{split}."
    reached = motion.times[motion.reached]
    rest = f"The surface stands still after {reached:.4g} s of {problem.horizon:.4g} s."
    if motion.stopped == "time":
        return "time_limit", f"The time limit passed. {rest} Allow more time or a coarser grid."
    return (
        "stalled",
        f"A time step found no equilibrium. {rest} Allow more control points, or a slower or smoother motion.",
    )


def _is_folded(level: Level) -> bool:
    """Tell whether a whole motion folds the cable within a span: grids may agree on that, and it is none of a cable."""
    least, most = _slopes(level)
    return not level.motion.stopped and not (least >= FOLDED and most <= 2.0 - FOLDED)


def _slopes(level: Level) -> tuple[float, float]:
    """Return the smallest and the largest |r'| at the curvature points of some states of a motion."""
    tables, states = level.motion.grid.tables, level.motion.states
    least, largest = slopes(states, max(1, len(states) // _LOOKS), tables.curvature_first, tables.curvature_b1)
    return float(least), float(largest)
