"""`method="reference"`: the refined motion of a discrete elastic rod as an ordinary prediction."""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dlocore.answer.parts import Accuracy, EffectReport, GraspReaction, Iteration, Status
from dlocore.compiling.interrupts import interruptible
from dlocore.errors import SceneError
from dlocore.levels.driven import beside
from dlocore.levels.whole_march import sided
from dlocore.prediction import Prediction
from dlocore.problem.buckling import side_notes
from dlocore.problem.events import closed_grasps
from dlocore.problem.notes import edge_notes, start_notes
from dlocore.problem.problem import Problem, pose
from dlocore.reference.chain import chain, grip
from dlocore.reference.energy import energies
from dlocore.reference.fit import LEAST_TIMES, MOST_TIMES, WITHIN_STEPS, Fit, fit
from dlocore.reference.refine import Level, Refined, goes_astray, refine
from dlocore.reference.sampling import between, material_of, stretch_of
from dlocore.reference.strands import refuse_meeting
from dlocore.scene.scene import Scene
from dlocore.solvers.monitor import Monitor
from dlocore.spline import SplineSurface
from dlocore.stability.determined import in_words
from dlocore.statics.tipping import tip_notes
from dlocore.words import in_mm

Floats = NDArray[np.float64]

TARGET = 1e-3  # of the length, if no target error is requested
FITTED = 0.05  # of the target: by how much the spline may miss the rods, which are to agree to the rest
UNTESTED = "The time ran out before it was known whether the scene determines its motion."


@dataclass(frozen=True, eq=False)
class Converged:
    """A converged motion at the nodes of a rod.

    Attributes:
        t: (k,) [s].
        u: (n,) [m].
        positions: (k, n, 3) [m].
        error_estimate: estimated error of any position [m].
        elements: of the finest rod.
        tolerance_met: whether the estimate is below the tolerance.
    """

    t: Floats
    u: Floats
    positions: Floats
    error_estimate: float
    elements: int
    tolerance_met: bool


@interruptible
def converged(scene: Scene, tolerance: float, *, times: ArrayLike | None = None) -> Converged:
    """Return the motion of a scene at the nodes of a rod, refined until its error is about `tolerance` [m].

    Args:
        scene: the scene.
        tolerance: [m].
        times: (k,) [s]; None: 33 evenly spaced ones.

    Raises:
        SceneError: the scene has an effect that the reference does not cover.
    """
    problem = sided(pose(scene), Monitor())
    refuse(problem)
    refined = refine(problem, tolerance, Monitor(), lambda problem, level: None)
    refuse_meeting(refined)
    t = np.linspace(0.0, problem.horizon, 33) if times is None else np.asarray(times, dtype=float)
    elements = len(refined.levels[-1].taken.u) - 1
    return Converged(t, refined.u, refined.positions(t), refined.estimate, elements, refined.ended == "agreed")


def refuse(problem: Problem) -> None:
    """Refuse what the reference does not simulate.

    Raises:
        SceneError: an effect that is switched on, or off, is not covered.
    """
    effects, cable = problem.scene.effects, problem.scene.cable
    if effects.get("inertia") == "off":
        reason = "The reference goes through the motion step by step"
        raise SceneError("effects.inertia", "off", '"on" or "auto" with method "reference"', reason)
    if problem.self_contact is not None:
        reason = "The reference does not simulate contact of the cable with itself"
        raise SceneError(
            "effects.self_contact", effects.get("self_contact", "auto"), '"off", or another method', reason
        )
    damped = cable.bending_damping > 0.0 and effects.get("damping") != "off"
    if problem.plane.dimensions == 3 and effects.get("twist") == "off" and damped:
        reason = "In space the sections of the reference always twist, and damping acts on bends in their frame"
        raise SceneError("effects.twist", "off", '"on" or "auto" with method "reference"', reason)


def reference(problem: Problem, monitor: Monitor) -> Prediction:
    """Return the reference solution of a posed scene, refined to its `target_error` or 0.1 % of the length.

    Raises:
        SceneError: the scene has an effect that the reference does not cover.
        Cancelled: the caller asked to stop.
    """
    refuse(problem)
    target = problem.scene.quality.target_error or TARGET * problem.scene.cable.length

    def on_level(posed: Problem, level: Level) -> None:
        monitor.phase("simulation")
        motion = level.motion
        surface = _surface(posed, Refined(posed, (replace(level, orderly=False),), "finest"), FITTED * target).surface
        monitor.phase("fit")
        monitor.report(
            Iteration(
                number=len(monitor.iterations),
                update=level.change,
                residual=motion.left,
                wall_time=monitor.elapsed(),
                damping=0.0,
                step_length=1.0,
                n_u=surface.control_points.shape[1],
                n_t=len(surface.control_points),
                find_surface=lambda: surface,
                find_energy=partial(_elastic_energy, level, len(motion.states) - 1),
                note=f"rod of {len(motion.rod.u) - 1} elements, {motion.steps} steps",
            )
        )

    fits: dict[Level, Fit] = {}  # by the finest rod

    def fitted(refined: Refined) -> Fit:
        finest = refined.levels[-1]
        if finest not in fits:
            fits[finest] = _surface(refined.problem, refined, FITTED * target)
            monitor.phase("fit")
        return fits[finest]

    def suffices(refined: Refined) -> bool:
        return refined.estimate + fitted(refined).missed <= target

    refined = refine(problem, (1.0 - FITTED) * target, monitor, on_level, suffices)
    refuse_meeting(refined)
    refined = replace(refined, astray=goes_astray(refined, target, monitor))
    monitor.phase("simulation")
    return _prediction(refined, fitted(refined), target, monitor)


def _surface(problem: Problem, refined: Refined, tolerance: float) -> Fit:
    """Return the spline through the answer of a refinement."""
    last = refined.levels[-1]
    taken = last.taken
    steps, first = np.unique(taken.times, return_index=True)
    # several within each step, unless that is too many: the spans of the spline are no shorter than a few of them
    last_step, parts = len(steps) - 1, min(WITHIN_STEPS, MOST_TIMES / len(steps))
    times = np.interp(np.append(np.arange(0.0, last_step, 1.0 / parts), last_step), np.arange(len(steps)), steps)
    # between long steps too, and up to the horizon; it stands still if it could not continue
    times = np.union1d(times, np.linspace(0.0, problem.horizon, LEAST_TIMES))
    q = np.empty((len(times), len(refined.u), 4))
    q[..., :3] = refined.positions(times)
    theta = taken.theta[first]
    if len(steps) > 1:
        theta = between(steps, theta, np.gradient(theta, steps, axis=0), times)
    q[..., 3] = theta[:, ::2] if last.orderly else theta
    return fit(problem, refined.u, times, q, tolerance)


def _elastic_energy(level: Level, k: int) -> float:
    """Return the elastic energy [J] at the step k of a motion."""
    rod, now = level.motion.rod, level.motion.states[k]
    t = float(level.motion.times[k])
    held = closed_grasps(rod.problem.scene, t, t)
    grips = tuple(grip(rod, g, level.motion.states[int(np.searchsorted(level.motion.times, g.start))]) for g in held)
    link = chain(rod, grips, t, t + 1.0)
    return float(sum(energies(link.body, link.state(now))[1:]))


def _prediction(refined: Refined, fitted: Fit, target: float, monitor: Monitor) -> Prediction:
    problem, last = refined.problem, refined.levels[-1]
    motion = last.motion
    estimate = sum(_parts(refined, fitted).values())
    status, message = _status(refined, fitted, target)
    off = beside(problem.scene, lambda g: fitted.surface.positions(g.u, g.start)[0, 0])
    if off and not motion.stopped:
        status, message = "stalled", off
    control = fitted.surface.control_points
    return Prediction(
        scene=problem.scene,
        status=status,
        said=message,
        surface=fitted.surface,
        iterations=tuple(monitor.iterations),
        accuracy=Accuracy(
            method="reference",
            error_estimate=estimate if np.isfinite(estimate) else None,
            error_parts=_parts(refined, fitted) if np.isfinite(estimate) else {},
            neglected=0.0,
            wall_time=monitor.elapsed(),
            n_u=control.shape[1],
            n_t=len(control),
            delta=problem.scene.quality.threshold,
            steps=motion.steps,
            dimensions=problem.plane.dimensions,
            dimensions_reason=problem.plane.reason,
            phases=dict(monitor.phases),
        ),
        find_start_energy=partial(_elastic_energy, last, 0),
        start_fit=problem.start.fit_rms,
        report_contacts=tuple,
        report_grasps=lambda: tuple(
            GraspReaction(g.u, motion.given_times, motion.forces[i], motion.moments[i])
            for i, g in enumerate(problem.scene.grasps)
        ),
        report_effects=lambda surface: _effects(refined, surface),
        report_material=lambda: material_of(motion, last.taken),
        report_stretch=lambda: stretch_of(motion),
        find_objections=lambda: [
            *start_notes(problem.scene, problem.start),
            *edge_notes(problem.scene, problem.obstacles),
            *side_notes(problem.start),
            *tip_notes(motion.tipped, problem.scene.cable.length),
        ],
    )


def _parts(refined: Refined, fitted: Fit) -> dict[str, float]:
    """Return the parts of the error [m]."""
    parts = {"grid": refined.estimate, "time": fitted.missed}
    return {**parts, "start": refined.astray} if refined.astray > 0.0 else parts


def _status(refined: Refined, fitted: Fit, target: float) -> tuple[Status, str]:
    last = refined.levels[-1]
    motion = last.motion
    count = len(motion.rod.u) - 1
    moved = f"the last refinement, to {count} elements, moved it by {in_mm(last.change)}"
    if len(refined.levels) == 1:
        moved = f"only one rod, of {count} elements, so its error is not checked"
    if motion.stopped:
        moved = f"it stands still after {motion.times[-1]:.4g} s of {refined.problem.horizon:.4g} s"
    if refined.ended == "agreed":
        agreed = f"Rods of up to {count} elements agree to {in_mm(refined.estimate)}, target {in_mm(target)}."
        if refined.astray > 0.0:  # by a bend alone: no sections of its rods are turned
            return "stalled", f"{agreed} But {in_words(refined.problem.line, refined.astray)}."
        if refined.estimate + fitted.missed > target:
            missed = f"The spline through them misses them by {in_mm(fitted.missed)}"
            return "max_iterations", f"{agreed} {missed}. Allow a larger target_error, or predict less time."
        return "converged", agreed + (f" {UNTESTED}" if np.isnan(refined.astray) else "")
    if refined.ended == "time":
        return "time_limit", f"The time limit passed; {moved}. Allow more time or a larger target_error."
    if refined.ended == "step":
        return "stalled", f"A step found no solution; {moved}. Make the motion slower or smoother."
    return "max_iterations", f"No finer rod was tried; {moved}, target {in_mm(target)}. Allow a larger target_error."


def _effects(refined: Refined, surface: SplineSurface) -> tuple[EffectReport, ...]:
    """Return what was simulated: everything that the scene has and does not switch off."""
    problem, motion = refined.problem, refined.levels[-1].motion
    space = problem.plane.dimensions == 3
    yields = problem.scene.cable.yields and problem.scene.effects.get("plasticity") != "off"
    own = {
        "inertia": (True, "the reference goes through the motion step by step"),
        "twist": (space, "in space the sections of the reference always twist" if space else "the motion is planar"),
        "plasticity": (yields, "the cable has a yield strain" if yields else problem.choices["plasticity"].reason),
    }
    if problem.choices["twist"].reason == "switched off in the scene":
        del own["twist"]
    found = []
    for name, choice in problem.choices.items():
        active, reason = own.get(name, (choice.active, choice.reason))
        found.append(EffectReport(name, active, reason))
    if problem.obstacles or problem.table is not None:
        deep = EffectReport("contact", True, "", motion.deepest, "m")
        name = "obstacles" if problem.obstacles else "table"
        found = [
            EffectReport(name, True, e.reason, deep.magnitude, "m, the largest depth") if e.name == name else e
            for e in found
        ]
    return tuple(found)
