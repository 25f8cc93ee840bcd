"""The front door: predict(scene) -> Prediction."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dlocore.discretisation import smallest_n_u
from dlocore.errors import SceneError
from dlocore.prediction import Accuracy, Iteration, OnIteration, Prediction, Status
from dlocore.problem import Problem, pose
from dlocore.report import effect_reports, reactions, start_energy, surface_of
from dlocore.scene import Quality, Scene
from dlocore.solvers.ladder import ACCEPT, LEVELS, Level, distance, run_level, stretched
from dlocore.solvers.march import smallest_n_t
from dlocore.solvers.monitor import Monitor, TimeIsUp

Floats = NDArray[np.float64]

AUTO_TARGET = 2e-3  # of the length: the target error of quality "auto"


def predict(
    scene: Scene,
    *,
    on_iteration: OnIteration | None = None,
    deadline: float | None = None,
    cancelled: Callable[[], bool] | None = None,
) -> Prediction:
    """Predict the motion of a scene's cable as one bivariate spline.

    Args:
        scene: what to predict.
        on_iteration: called after every iteration, or refinement level, with its record.
        deadline: time allowed [s]; after it the best iterate is returned with status "time_limit".
        cancelled: asked between iterations; where it returns True the solve stops.

    Returns:
        The prediction. Not converging is a status, not an exception.

    Raises:
        SceneError: the scene can't be solved as it was given.
        Cancelled: `cancelled` returned True.
    """
    monitor = Monitor(on_iteration, deadline, cancelled)
    problem = pose(scene)
    quality = scene.quality
    if quality.n_u is not None and quality.method in ("auto", "spacetime", "paper"):
        raise SceneError("quality.method", quality.method, "march")
    return _march(problem, quality, monitor)


def _march(problem: Problem, quality: Quality, monitor: Monitor) -> Prediction:
    level, status, message, estimate = _climb(problem, quality, monitor)
    return _answer(problem, level, monitor, "march", status, message, estimate)


def _climb(problem: Problem, quality: Quality, monitor: Monitor) -> tuple[Level, Status, str, float | None]:
    """March on the given grid, or up the ladder of grids until the target or the time budget is met."""
    if quality.n_u is not None and quality.n_t is not None:
        least = smallest_n_t(problem)
        if quality.n_t < least:
            reason = "Every jump in the grasps' motion needs knots in time"
            raise SceneError("quality.n_t", quality.n_t, f"at least {least} in this scene", reason)
        level = run_level(problem, quality.n_u, quality.n_t, max(48, 5 * quality.n_t), monitor)
        _record(problem, level, monitor)
        status, message = _march_status(problem, level)
        return level, status, message, None
    target = quality.target_error or AUTO_TARGET * problem.scene.cable.length
    budget = quality.time_budget or np.inf
    before: Level | None = None
    last_time = 0.0
    for i in range(len(LEVELS)):
        began = monitor.elapsed()
        try:
            monitor.check()
            level = run_level(problem, *stretched(problem, i), monitor)
        except TimeIsUp:
            break
        if before is not None:
            level = replace(level, change=distance(before, level, problem))
        if level.motion.stopped and before is not None and not before.motion.stopped:
            return (
                before,
                "stalled",
                f"A finer grid did not converge: {_march_status(problem, level)[1]}",
                before.change,
            )
        _record(problem, level, monitor)
        if level.motion.stopped == "time":
            return level, *_march_status(problem, level), None
        before = level
        if level.change <= ACCEPT * target and quality.time_budget is None:
            message = f"Two grids agree to {level.change * 1e3:.2g} mm, target {target * 1e3:.2g} mm."
            return level, "converged", message, level.change
        last_time = monitor.elapsed() - began
        if monitor.elapsed() + 2.5 * last_time > budget:
            message = (
                f"The best grid in {budget * 1e3:.3g} ms; the last refinement moved it by {level.change * 1e3:.2g} mm."
            )
            return level, "converged" if np.isfinite(level.change) else "time_limit", message, _finite(level.change)
    assert before is not None
    status, message = _march_status(problem, before)
    if status == "converged":
        status = "max_iterations"
        message = (
            f"The finest grid still moved the surface by {before.change * 1e3:.3g} mm, more than the target of "
            f"{target * 1e3:.3g} mm. Allow a larger target_error or a shorter motion."
        )
    return before, status, message, _finite(before.change)


def _finite(x: float) -> float | None:
    return x if np.isfinite(x) else None


def _march_status(problem: Problem, level: Level) -> tuple[Status, str]:
    motion = level.motion
    if not motion.stopped:
        return "converged", "Every time step found its equilibrium."
    reached = motion.times[motion.reached]
    rest = f"The surface stands still after {reached:.4g} s of {problem.horizon:.4g} s."
    if motion.stopped == "time":
        return "time_limit", f"The time limit passed. {rest} Allow more time or a coarser grid."
    return (
        "stalled",
        f"A time step found no equilibrium. {rest} Allow more control points, or a slower or smoother motion.",
    )


def _record(problem: Problem, level: Level, monitor: Monitor) -> None:
    monitor.report(
        Iteration(
            number=len(monitor.iterations),
            update=level.change,
            residual=level.motion.update,
            energy=start_energy(problem, level.motion.grid, level.motion.states[-1]),
            wall_time=monitor.elapsed(),
            damping=0.0,
            step_length=1.0,
            n_u=level.motion.grid.n_u,
            n_t=len(level.control),
            surface=surface_of(problem, level.motion.grid, level.knots_t, level.control),
            note="march",
        )
    )


def _answer(
    problem: Problem, level: Level, monitor: Monitor, method: str, status: Status, message: str, estimate: float | None
) -> Prediction:
    grid = level.motion.grid
    surface = surface_of(problem, grid, level.knots_t, level.control)
    return Prediction(
        scene=problem.scene,
        status=status,
        message=message,
        surface=surface,
        grasps=reactions(problem, level.motion),
        effects=effect_reports(problem, surface),
        iterations=tuple(monitor.iterations),
        accuracy=Accuracy(
            method=method,
            error_estimate=estimate,
            wall_time=monitor.elapsed(),
            n_u=grid.n_u,
            n_t=len(level.control),
            delta=problem.scene.quality.delta,
            steps=len(level.motion.times) - 1,
            dimensions=problem.plane.dimensions,
            phases=dict(monitor.phases),
        ),
        start_energy=start_energy(problem, grid, grid.start),
        start_fit=problem.start.fit_rms,
    )


def warm_up() -> None:
    """Compile, or load from the cache, every kernel, so that the first prediction is as fast as the next."""
    from dlocore.cable import Cable
    from dlocore.paths import Move
    from dlocore.scene import Environment, Grasp, Straight, Table

    for table in (Table(), None):
        cable = Cable.preset("paper", bending_damping=1e-4)
        grasp = Grasp(u=0.3, path=Move(displacement=(0.0, 0.1, 0.0), duration=1.0))
        environment = Environment(drag=0.1, drag_quadratic=0.1, table=table)
        predict(Scene(cable=cable, shape=Straight(), grasps=(grasp,), environment=environment))
