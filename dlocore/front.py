"""The front door: predict(scene) -> Prediction."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dlocore.accuracy.again import Again, as_solved, march_again
from dlocore.accuracy.changes import with_untold
from dlocore.accuracy.companion import Compared, by_coarser, by_finer
from dlocore.accuracy.cost import Cost
from dlocore.accuracy.fallback import (
    as_marched,
    by_march,
    errs,
    falls_short,
    free_grids,
    left_before,
    more_in_time,
    with_finer,
)
from dlocore.accuracy.refinement import climb
from dlocore.answer.parts import OnIteration
from dlocore.assembling import assembled
from dlocore.compiling.interrupts import interruptible
from dlocore.errors import SceneError, flag, instance
from dlocore.levels.given import evenly_fitted, given_status, march_given
from dlocore.levels.iterated import ended, out_of_time
from dlocore.levels.level import Level
from dlocore.levels.progress import record, record_level
from dlocore.levels.whole_march import Outcome, march_status, sided
from dlocore.prediction import Prediction
from dlocore.problem.problem import Problem, pose
from dlocore.problem.strained import TORN
from dlocore.problem.time_grid import check_n_t
from dlocore.scene.scene import Method, Quality, Scene
from dlocore.solvers import paper
from dlocore.solvers.monitor import Monitor, TimeIsUp, time_allowed
from dlocore.solvers.spacetime import solve

Floats = NDArray[np.float64]


@interruptible
def predict(
    scene: Scene,
    *,
    like: Prediction | None = None,
    on_iteration: OnIteration | None = None,
    deadline: float | None = None,
    cancelled: Callable[[], bool] | None = None,
    cost: Cost | None = None,
    keep_grid: bool = False,
) -> Prediction:
    """Predict the motion of a scene's cable as one bivariate spline.

    Args:
        scene: what to predict.
        like: a prediction of a similar scene, for example one whose target is some centimetres away. Its grid and its
            error estimate are reused, which saves the search for them. If the two scenes differ too much for that,
            this one is solved from the beginning, and `message` says why.
        on_iteration: called after every iteration, or refinement level, with its record.
        deadline: time allowed [s]; after it the best iterate is returned with status "time_limit". If a target error
            is hard to meet, a deadline or a `quality.time_budget` lets the solver refine further than it does by
            default.
        cancelled: called between iterations; the solve stops if it returns True.
        cost: what solves cost on this machine (`dlocore.calibration.stored_cost`). A solve with a time budget then
            begins with a grid that fits the budget; without `cost` it begins with the coarsest.
        keep_grid: True keeps the answer of a given grid even if the scene's `quality` does not ask for that. If neither
            does, finer grids or a march are tried when the estimated error on a given grid exceeds 1 % of the length,
            or a solve on it does not converge. If they do better they are the answer, and `message` says so.

    Returns:
        The prediction. Not converging is a status, not an exception.

    Raises:
        SceneError: the scene can't be solved as it was given, or an option is not valid, such as a negative `deadline`.
        Cancelled: `cancelled` returned True.
    """
    instance("scene", scene, Scene, "a Scene")
    instance("cost", cost, Cost | None, "a Cost, as stored_cost returns it, or None")
    check_options(like, deadline, keep_grid)
    monitor = Monitor(on_iteration, time_allowed(deadline), cancelled)
    keep_grid = keep_grid or scene.quality.keep_grid
    if like is None:
        return _shown(scene, monitor, cost, keep_grid)
    asked = scene if keep_grid else as_solved(scene, like)
    problem = pose(asked, None if like.level is None else like.level.posed.called_for)
    again = march_again(problem, like, monitor)
    if isinstance(again, Again):
        found = replace(_solved(problem, monitor, cost, again), scene=scene)
        # if `like` errs as much on the same grid, finer ones were tried in vain for it, or not wanted
        if keep_grid or not falls_short(found) or (errs(found) and errs(like)):
            return found if asked is scene else replace(found, said=f"{found.said} {left_before(scene, asked)}")
        again = found.said
    fresh = _shown(scene, monitor, cost, keep_grid)
    return replace(fresh, said=f"{fresh.said} Solved from the beginning: {again}")


def check_options(like: Prediction | None, deadline: float | None, keep_grid: bool) -> None:
    """Raise SceneError unless these options of `predict` are valid; the scene does not matter for that."""
    instance("like", like, Prediction | None, "a Prediction, or None")
    time_allowed(deadline)
    flag("keep_grid", keep_grid)


def _shown(scene: Scene, monitor: Monitor, cost: Cost | None, keep_grid: bool) -> Prediction:
    """Solve a scene. If the given grid or method can't resolve its motion, solve it by a march or on finer grids."""
    found = _solved(pose(scene), monitor, cost)
    if keep_grid or not falls_short(found):
        return found
    if scene.quality.method == "spacetime" and found.status != "converged":
        found = _last_resort(found, monitor)
        if not falls_short(found):
            return found
    spent = monitor.elapsed()
    return with_finer(found, _tried(scene, free_grids(scene), monitor), spent, monitor)


def _tried(scene: Scene, quality: Quality, monitor: Monitor) -> Prediction | SceneError:
    """Return the answer for a scene with another quality, or the error that says why there is none."""
    try:
        return _solved(pose(replace(scene, quality=quality)), monitor, None)
    except SceneError as error:  # a start that settles on the given grid need not settle on another
        return error


def _last_resort(found: Prediction, monitor: Monitor) -> Prediction:
    """Return the answer if a least squares did not converge: of a second try, or of the march that it started from."""
    scene, level, spent = found.scene, found.level, monitor.elapsed()
    assert level is not None
    tried: list[tuple[Quality, Prediction | SceneError]] = [(scene.quality, found)]
    more = more_in_time(found)
    if more is not None:
        finer = _tried(scene, more, monitor)
        if isinstance(finer, Prediction) and (finer.status, finer.accuracy.method) == ("converged", "spacetime"):
            return with_finer(found, finer, spent, monitor)
        tried.append((more, finer))
    spent = monitor.elapsed()
    level = as_marched(level)
    outcome = _given(level.problem, level.posed.scene.quality, monitor, level)
    return replace(by_march(assembled(monitor, "march", outcome), tried, spent), scene=scene)


def _solved(problem: Problem, monitor: Monitor, cost: Cost | None, again: Again | None = None) -> Prediction:
    quality = problem.scene.quality
    method = quality.method
    if method == "reference":
        from dlocore.reference.solve import reference  # its compiled code is for those who ask for it

        return reference(sided(problem, monitor), monitor)
    if method == "auto":
        method = automatic_method(problem)
    if method != "march":
        return _least_squares(problem, quality, monitor, method, again)
    if again is not None:
        return assembled(monitor, method, _as_before(again, monitor), judged=again.judged)
    outcome = climb(problem, quality, monitor, cost) if quality.n_u is None else _given(problem, quality, monitor)
    return assembled(monitor, method, outcome)


def automatic_method(problem: Problem) -> Method:
    """Return the method of quality "auto": a march, or the least squares on a given grid with a threshold for it.

    On the same grid a march is nearer to the motion and takes less time (`python -m benchmarks.methods`). Contact, slip
    and yielding set in at instants that a march steps through and collocation points miss.
    """
    jumps = ("plasticity", "self_contact")
    smooth = problem.contact is None and problem.friction is None and not any(problem.choices[j].active for j in jumps)
    quality = problem.scene.quality
    return "spacetime" if quality.n_u is not None and quality.delta is not None and smooth else "march"


def _as_before(again: Again, monitor: Monitor) -> Outcome:
    """Return, as an answer, the march on the grid of a similar prediction, with the error estimate of that one."""
    level = again.level
    record_level(level, monitor)
    status, message = march_status(level)
    return Outcome(level, status, message + again.said, again.errors)


def _least_squares(
    problem: Problem, quality: Quality, monitor: Monitor, method: str, again: Again | None
) -> Prediction:
    """Solve on the given grid: by weighted least squares started from a march, or by the printed scheme from rest."""
    assert quality.n_u is not None
    assert quality.n_t is not None
    if again is None:
        check_n_t(problem, quality.n_t)
    if method == "paper":
        paper.refuse(problem, quality.n_u, quality.n_t)
    level = march_given(problem, quality.n_u, quality.n_t, monitor) if again is None else again.level
    problem = level.problem
    if level.motion.stopped or level.motion.largest_strain > TORN:
        return assembled(monitor, "march", Outcome(level, *march_status(level), None))
    before = len(monitor.iterations)
    last = [level.control]

    def on_step(control: Floats, update: float, residual: float, damping: float = 0.0, length: float = 1.0) -> None:
        last[0] = control
        record(
            level, control, monitor, update=update, residual=residual, note=method, damping=damping, step_length=length
        )

    solver = solve if method == "spacetime" else paper.solve_as_printed
    try:
        solved = solver(problem, level.motion, level.knots_t, quality.threshold, monitor, on_step)
    except TimeIsUp:
        monitor.phase(method)
        return assembled(monitor, method, out_of_time(level, method, last[0], len(monitor.iterations) - before))
    monitor.phase(method)
    end = ended(level, quality, method, solved, len(monitor.iterations) - before, monitor)
    level, method = end.level, end.method
    if again is not None:
        errors = None if again.errors is None else {**again.errors, "iteration": end.left}
        outcome = Outcome(level, end.status, end.message + again.said, errors)
        return assembled(monitor, method, outcome, end.find_forces, again.judged)
    known = quality.estimate and (method != "paper" or solved.converged)
    compared = by_finer(problem, level, monitor) if known else Compared(None)
    estimate = compared.estimate
    # what the time spline of the march misses is not an error of the least squares
    errors = None if estimate is None else {"grid": max(estimate, level.unseen, level.held_back), "iteration": end.left}
    outcome = Outcome(compared.on(level), end.status, end.message + compared.doubt, errors)
    return assembled(monitor, method, outcome, end.find_forces)


def _given(problem: Problem, quality: Quality, monitor: Monitor, level: Level | None = None) -> Outcome:
    """Return the answer by a march on the given grid; `level` is that march with its time spline, if it is known."""
    assert quality.n_u is not None
    assert quality.n_t is not None
    if level is None:
        check_n_t(problem, quality.n_t)
        level = evenly_fitted(march_given(problem, quality.n_u, quality.n_t, monitor))
    problem = level.problem
    record_level(level, monitor)
    compared = by_coarser(problem, level, monitor) if quality.estimate else Compared(None)
    level = compared.on(level)
    status, message = given_status(level)
    estimate = compared.estimate
    errors = None if estimate is None else with_untold({"grid": estimate}, level)
    return Outcome(level, status, message + compared.doubt, errors)
