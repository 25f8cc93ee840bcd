"""The front door: predict(scene) -> Prediction."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dlocore.discretisation import smallest_n_u
from dlocore.errors import SceneError
from dlocore.frames import free_control, material_of
from dlocore.prediction import Accuracy, Iteration, MaterialMotion, OnIteration, Prediction, Status
from dlocore.problem import Problem, pose
from dlocore.report import WindowForces, effect_reports, elastic_energy, reactions, surface_of
from dlocore.review import called_for, neglected, objections
from dlocore.scene import Method, Quality, Scene
from dlocore.solvers.ladder import (
    ACCEPT,
    FINER,
    LEVELS,
    Level,
    distance,
    extrapolated,
    given_steps,
    run_level,
    stretched,
)
from dlocore.solvers.march import RHO, STRONGLY_DAMPED, smallest_n_t
from dlocore.solvers.monitor import Monitor, TimeIsUp
from dlocore.solvers.paper import solve_as_printed
from dlocore.solvers.spacetime import solve
from dlocore.spline import SplineSurface, uniform_knots

Floats = NDArray[np.float64]

SAFETY = 1.5  # times the distance to a finer march: what a slowly converging motion may be off beyond it
AUTO_TARGET = 2e-3  # of the length: the target error of quality "auto"
ROUGH = 0.05  # of the length: two grids that differ more are in no order yet: the next is marched with strong damping
TOO_DEEP = 0.25  # of the diameter, in the table, an obstacle or itself
TORN = 0.2  # axial strain: no cable of this kind follows


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
    method = quality.method
    if method == "auto":
        method = automatic_method(problem)
    if method == "march":
        outcome = (_climb if quality.n_u is None else _given)(problem, quality, monitor)
        return _answer(monitor, "march", outcome)
    return _least_squares(problem, quality, monitor, method)


def automatic_method(problem: Problem) -> Method:
    """Return the method of quality "auto": the least squares on a given grid where the motion is smooth, else a march.

    What touches, slips or yields does so at instants that a march steps over and collocation points miss.
    """
    jumps = ("plasticity", "self_contact")
    smooth = problem.contact is None and problem.friction is None and not any(problem.choices[j].active for j in jumps)
    return "spacetime" if problem.scene.quality.n_u is not None and smooth else "march"


def _least_squares(problem: Problem, quality: Quality, monitor: Monitor, method: str) -> Prediction:
    """Solve on the given grid by the weighted least squares from a march, or by the printed scheme from rest."""
    assert quality.n_u is not None
    assert quality.n_t is not None
    _check_n_t(problem, quality.n_t)
    level = _level(problem, quality.n_u, quality.n_t, given_steps(quality.n_t), monitor)
    problem = level.problem
    if level.motion.stopped or level.motion.largest_strain > TORN:
        return _answer(monitor, "march", Outcome(level, *_march_status(problem, level), None))
    knots_t = level.knots_t
    last = [level.control]

    def on_step(control: Floats, update: float, residual: float, damping: float = 0.0, length: float = 1.0) -> None:
        last[0] = control
        _record(problem, level, control, update, residual, monitor, damping, length, method)

    forces: tuple[WindowForces, ...] | None = None
    try:
        if method == "spacetime":
            solved = solve(problem, level.motion, knots_t, quality.delta, monitor, on_step)
            control, converged, update, forces = solved.control, solved.converged, solved.update, solved.forces
        else:
            control, converged, update = solve_as_printed(
                problem, level.motion, knots_t, quality.delta, monitor, on_step
            )
    except TimeIsUp:
        monitor.phase(method)
        level = replace(level, control=last[0])
        message = "The time limit passed; this is the last iterate. Allow more time or a coarser grid."
        return _answer(monitor, method, Outcome(level, "time_limit", message, None))
    monitor.phase(method)
    count = len(monitor.iterations)
    status: Status = "converged" if converged else "max_iterations"
    message = f"The update fell below delta = {quality.delta:g} m in {count} iterations."
    if not converged:
        message = (
            f"The update is still {update:.2g} m after {count} iterations, above delta = {quality.delta:g} m. "
            "Raise n_u and n_t, allow a larger delta, or take method march."
        )
    if problem.self_contact is not None:
        message += " The least squares does not know of contact of the cable with itself; method march does."
    if not converged and method == "spacetime":
        message += " The surface is that of the march it started from."
        control, forces = level.control, None
    elif not np.isfinite(control).all():
        status = "stalled"
        message += " The iterates grew beyond all bounds; the surface is that of a march."
        control = level.control
    level = replace(level, control=control)
    estimate = _companion(problem, quality, level, monitor) if method == "spacetime" or converged else None
    return _answer(monitor, method, Outcome(level, status, message, estimate), forces)


def _companion(problem: Problem, quality: Quality, level: Level, monitor: Monitor) -> float | None:
    """Return the error estimate [m]: the distance to a march on a grid half as fine again, with a margin."""
    assert quality.n_u is not None
    assert quality.n_t is not None
    if not quality.estimate:
        return None
    n_u = max(smallest_n_u(problem), round(FINER * quality.n_u))
    n_t = max(smallest_n_t(problem), round(FINER * quality.n_t))
    try:
        monitor.check()
        finer = run_level(problem, n_u, n_t, round(FINER * given_steps(quality.n_t)), monitor, booked=False)
    except TimeIsUp:
        return None
    estimate = None if finer.motion.stopped else SAFETY * distance(level, finer, problem)
    monitor.phase("estimate")
    return estimate


def _check_n_t(problem: Problem, n_t: int) -> None:
    least = smallest_n_t(problem)
    if n_t < least:
        reason = "Every jump in the grasps' motion needs knots in time"
        raise SceneError("quality.n_t", n_t, f"at least {least} in this scene", reason)


class Outcome(NamedTuple):
    """A level of refinement, what to say of it, and its estimated error [m]."""

    level: Level
    status: Status
    message: str
    estimate: float | None


def _given(problem: Problem, quality: Quality, monitor: Monitor) -> Outcome:
    """March on the given grid."""
    assert quality.n_u is not None
    assert quality.n_t is not None
    _check_n_t(problem, quality.n_t)
    level = _level(problem, quality.n_u, quality.n_t, given_steps(quality.n_t), monitor)
    problem = level.problem
    _record_level(problem, level, monitor)
    estimate = None if level.motion.stopped else _companion(problem, quality, level, monitor)
    return Outcome(level, *_march_status(problem, level), estimate)


def _level(
    problem: Problem,
    n_u: int,
    n_t: int,
    steps: int,
    monitor: Monitor,
    rho: float = RHO,
    free_knots: bool = False,
    rough: bool = False,
    known: Level | None = None,
) -> Level:
    """March on one grid; where the motion calls for effects that were left out, again with them.

    On a `rough` grid, which another follows, strands that meet may do so because of the grid. A march of this grid that
    is `known` is not done again.
    """
    called = dict(problem.called_for)
    while True:
        if free_knots:
            n_u, n_t = max(n_u, smallest_n_u(problem)), max(n_t, smallest_n_t(problem))
        level = known or run_level(problem, n_u, n_t, steps, monitor, rho=rho, free_knots=free_knots)
        known = None
        new = {} if level.motion.stopped == "time" else called_for(level)
        if rough:
            new.pop("self_contact", None)
        if not new:
            return level
        _record_level(problem, replace(level, note=f"calls for {', '.join(new)}"), monitor)
        called |= new
        problem = pose(problem.scene, called)


def _climb(problem: Problem, quality: Quality, monitor: Monitor) -> Outcome:
    """March up the ladder of grids until two agree within the target, or the time budget is used."""
    target = quality.target_error or AUTO_TARGET * problem.scene.cable.length
    budget = quality.time_budget or np.inf
    best: Level | None = None
    estimate = np.inf
    rho = RHO
    for i in range(len(LEVELS)):
        began = monitor.elapsed()
        try:
            if best is not None:
                monitor.check()
            level = _level(problem, *stretched(problem, i), monitor, rho, free_knots=True, rough=True)
            if best is not None and level.posed is problem:
                level = replace(level, change=distance(best, level, problem))
                if level.change <= ROUGH * problem.scene.cable.length:  # so strands do not meet because of the grid
                    level = _level(problem, *stretched(problem, i), monitor, rho, free_knots=True, known=level)
            if level.posed is not problem:
                best = None  # another motion: the grid before says nothing about it
            problem = level.posed  # a rough grid may have needed contact that is too stiff for a fine one
        except TimeIsUp:
            break
        if best is not None:
            estimate = extrapolated(level.change, best.change)
            if level.motion.stopped and not best.motion.stopped:
                status, message = _march_status(problem, level)
                return Outcome(best, status, f"A finer grid was not finished: {message}", _finite(best.change))
            rho = STRONGLY_DAMPED if level.change > ROUGH * problem.scene.cable.length else RHO
        _record_level(problem, level, monitor)
        best = level
        status, message = _march_status(problem, level)
        moved = f"the last refinement moved the surface by {level.change * 1e3:.2g} mm"
        if level.motion.stopped == "time":
            return Outcome(level, status, message, None)
        if estimate <= ACCEPT * target and quality.time_budget is None:
            agreed = f"Two grids agree to {level.change * 1e3:.2g} mm, target {target * 1e3:.2g} mm."
            return Outcome(level, status, agreed if status == "converged" else message, estimate)
        if 2.5 * (monitor.elapsed() - began) > budget - monitor.elapsed():
            if i == 0:
                return Outcome(level, "time_limit", f"{budget * 1e3:.3g} ms allow one grid, unchecked.", None)
            return Outcome(level, status, f"The best grid in {budget * 1e3:.3g} ms; {moved}.", estimate)
    assert best is not None
    status, message = _march_status(problem, best)
    moved = f"the last refinement moved the surface by {best.change * 1e3:.3g} mm, target {target * 1e3:.3g} mm"
    advice = "Allow a larger target_error, more time or a shorter motion."
    if status == "converged" and estimate <= target:
        message = f"Two grids agree to {best.change * 1e3:.2g} mm, target {target * 1e3:.2g} mm."
    elif status == "converged" and monitor.remaining() <= 0:
        status, message = "time_limit", f"The time limit passed; {moved}. {advice}"
    elif status == "converged":
        status, message = "max_iterations", f"No finer grid; {moved}. {advice}"
    return Outcome(best, status, message, _finite(estimate))


def _finite(x: float) -> float | None:
    return x if np.isfinite(x) else None


def _march_status(problem: Problem, level: Level) -> tuple[Status, str]:
    motion = level.motion
    if not motion.stopped and motion.largest_strain > TORN:
        strain = f"The motion strains the cable along itself by {motion.largest_strain:.0%}, which no cable follows."
        advice = "Bring the grasps no farther apart than the cable between them, or make the motion slower."
        push = "A straight cable pushed along itself has no side to buckle to: start it slightly bent."
        return "stalled", f"{strain} {advice} {push}"
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


def _record_level(problem: Problem, level: Level, monitor: Monitor) -> None:
    motion = level.motion
    note = "march" + (", strongly damped" if motion.rho == STRONGLY_DAMPED else "")
    note += f", {motion.split} steps in smaller ones" if motion.split else ""
    note += f", {level.note}" if level.note else ""
    _record(problem, level, level.control, level.change, motion.update, monitor, 0.0, 1.0, note)


def _record(
    problem: Problem,
    level: Level,
    control: Floats,
    update: float,
    residual: float,
    monitor: Monitor,
    damping: float,
    step_length: float,
    note: str,
) -> None:
    grid = level.motion.grid
    monitor.report(
        Iteration(
            number=len(monitor.iterations),
            update=update,
            residual=residual,
            energy=elastic_energy(problem, grid, np.ascontiguousarray(control[-1]), level.motion.history),
            wall_time=monitor.elapsed(),
            damping=damping,
            step_length=step_length,
            n_u=grid.n_u,
            n_t=len(control),
            surface=_surface(problem, level, control),
            note=note,
        )
    )


def _answer(
    monitor: Monitor,
    method: str,
    outcome: Outcome,
    forces: tuple[WindowForces, ...] | None = None,
) -> Prediction:
    level = outcome.level
    problem = level.problem
    grid = level.motion.grid
    surface = _surface(problem, level, level.control)
    left_out = neglected(level)
    estimate = None if outcome.estimate is None else outcome.estimate + left_out
    message = " ".join([outcome.message, *[f"Note: {objection}." for objection in objections(level)]])
    return Prediction(
        scene=problem.scene,
        status=outcome.status,
        message=message,
        surface=surface,
        grasps=reactions(problem, grid, level.motion.forces if forces is None else forces),
        report_effects=partial(effect_reports, problem, grid, partial(_material, problem, level)),
        report_material=partial(_material, problem, level),
        iterations=tuple(monitor.iterations),
        accuracy=Accuracy(
            method=method,
            error_estimate=estimate,
            neglected=left_out,
            wall_time=monitor.elapsed(),
            n_u=grid.n_u,
            n_t=len(level.control),
            delta=problem.scene.quality.delta,
            steps=len(level.motion.times) - 1,
            dimensions=problem.plane.dimensions,
            dimensions_reason=problem.plane.reason,
            phases=dict(monitor.phases),
        ),
        start_energy=elastic_energy(problem, grid, grid.start, grid.history),
        start_fit=problem.start.fit_rms,
    )


def _surface(problem: Problem, level: Level, control: Floats) -> SplineSurface:
    grid = level.motion.grid
    free = free_control(problem, grid, level.knots_t, control, level.motion.times, level.motion.frames)
    return surface_of(problem, grid.knots, level.knots_t, free)


def _material(problem: Problem, level: Level) -> MaterialMotion | None:
    motion = level.motion
    if len(motion.log) == 0 and not np.any(motion.grid.history.memory):
        return None
    memory, axial = motion.memory, motion.axial_memory
    if len(motion.log) == 0:
        memory = np.broadcast_to(motion.grid.history.memory[:, :1], (len(motion.times), len(motion.history.memory), 1))
    if len(motion.log) == 0 or axial.shape[1] == 0:
        axial = np.broadcast_to(motion.grid.history.axial[:, 0], (len(motion.times), len(motion.history.axial)))
    return material_of(problem, motion.grid, motion.times, motion.states, memory, axial)


def warm_up() -> None:
    """Compile, or load from the cache, every kernel, so that the first prediction is as fast as the next."""
    from dlocore.cable import Cable
    from dlocore.effects.selfcontact import nearest_strands
    from dlocore.paths import Move
    from dlocore.scene import Environment, Grasp, Points, Switch, Table
    from dlocore.statics import equilibrium

    cable = Cable.preset("paper", bending_damping=1e-4)
    u = np.linspace(0.0, 1.0, 12)[:, None]
    arc = u * [1.0, 0.0, 0.0] + 0.05 * np.sin(3.0 * u) * [0.0, 1.0, 0.0]
    grasp = Grasp(u=0.3, hold="clamp", path=Move(displacement=(0.0, 0.01, 0.0), duration=1.0))
    kinds: tuple[tuple[Table | None, Switch], ...] = ((Table(), "auto"), (None, "auto"), (None, "on"))
    for table, switch in kinds:  # two, three and four coordinates
        environment = Environment(drag=0.1, drag_quadratic=0.1, table=table)
        for quality in (Quality(), Quality(n_u=9, n_t=9)):
            scene = Scene(
                cable=cable,
                shape=Points(points=arc, settle=table is None),
                grasps=(grasp,),
                environment=environment,
                effects={"twist": switch},
                quality=quality,
            )
            predict(scene)
        equilibrium(scene, n_u=9)
    loop = np.column_stack([np.cos(np.linspace(0.0, 7.0, 9)), np.sin(np.linspace(0.0, 7.0, 9)), 0.1 * u[:9, 0]])
    nearest_strands(uniform_knots(9, 1.0), loop[None], 3, 0.01, 0.03)
