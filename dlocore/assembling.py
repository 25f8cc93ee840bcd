"""From a solved level to a prediction: its surface, and its forces, reports and errors when they are asked for."""

from collections.abc import Callable
from functools import cache, partial

import numpy as np

from dlocore.answer.contacts import contact_forces, contacts_taken_on, with_contact_errors
from dlocore.answer.frames import material_of
from dlocore.answer.parts import Accuracy, ContactForce, GraspReaction, MaterialMotion, StretchMotion
from dlocore.answer.reactions import Windows, reactions, taken_on, with_reaction_errors
from dlocore.answer.report import effect_reports, elastic_energy
from dlocore.answer.stretch import stretch_of
from dlocore.levels.level import Level
from dlocore.levels.progress import surface_at
from dlocore.levels.review import neglected, objections
from dlocore.levels.whole_march import Outcome
from dlocore.prediction import Prediction
from dlocore.problem.grid import Grid
from dlocore.problem.problem import Problem
from dlocore.solvers.monitor import Monitor
from dlocore.solvers.spacetime import FindForces


def assembled(
    monitor: Monitor,
    method: str,
    outcome: Outcome,
    find_forces: FindForces | None = None,
    judged: Prediction | None = None,
) -> Prediction:
    """Return the prediction of a solve. What costs time beyond the surface is found when it is first asked for.

    Args:
        monitor: of the solve.
        method: that found the answer.
        outcome: its level, status, message and errors.
        find_forces: the forces of the motion; None: those of the march.
        judged: the similar prediction whose error estimate is used, if there is one.
    """
    level = outcome.level
    problem = level.problem
    grid = level.motion.grid
    surface = surface_at(level, level.control)
    left_out = neglected(level)
    find_once: FindForces = (lambda: level.motion.forces) if find_forces is None else cache(find_forces)
    stretch = partial(_stretch, level)
    material = partial(_material, problem, level)
    pressing = cache(partial(_pressing, level, find_once, find_forces is None))
    errors: dict[str, float] = {}
    if outcome.errors is not None:
        errors = {**outcome.errors, "neglected": left_out}
        errors.setdefault("iteration", level.motion.update)
    return Prediction(
        scene=problem.scene,
        status=outcome.status,
        said=outcome.message,
        surface=surface,
        report_grasps=partial(_reactions, level, find_once, judged),
        report_contacts=partial(_contacts, level, find_once, judged, pressing),
        report_effects=partial(effect_reports, problem, material, stretch, pressing),
        report_material=material,
        report_stretch=stretch,
        iterations=tuple(monitor.iterations),
        accuracy=Accuracy(
            method=method,
            error_estimate=sum(errors.values()) if errors else None,
            error_parts=errors,
            neglected=left_out,
            wall_time=monitor.elapsed(),
            n_u=grid.n_u,
            n_t=len(level.control),
            delta=problem.scene.quality.threshold,
            steps=level.motion.steps,
            dimensions=problem.plane.dimensions,
            dimensions_reason=problem.plane.reason,
            phases=dict(monitor.phases),
        ),
        find_objections=partial(objections, level),
        find_start_energy=partial(_start_energy, level),
        start_fit=problem.start.fit_rms,
        level=level,
        judged=judged,
    )


def _reactions(level: Level, find_forces: FindForces, judged: Prediction | None) -> tuple[GraspReaction, ...]:
    windows = find_forces()
    found = reactions(level.problem, level.motion.grid, windows)
    if judged is not None:
        return taken_on(found, judged.grasps)
    return with_reaction_errors(found, windows, _beside(level))


def _pressing(level: Level, find_forces: FindForces, marched: bool) -> tuple[ContactForce, ...]:
    return contact_forces(level.marched, level.motion.grid, find_forces(), marched)


def _contacts(
    level: Level, find_forces: FindForces, judged: Prediction | None, pressing: Callable[[], tuple[ContactForce, ...]]
) -> tuple[ContactForce, ...]:
    windows, found = find_forces(), pressing()
    if judged is not None:
        return contacts_taken_on(found, level.problem.scene, judged.contacts, judged.scene)
    return with_contact_errors(found, level.marched, windows, _beside(level))


def _beside(level: Level) -> list[tuple[Problem, Grid, Windows]]:
    return [(other.marched, other.motion.grid, other.motion.forces) for other in level.beside]


def _start_energy(level: Level) -> float:
    grid = level.motion.grid
    return elastic_energy(level.problem, grid, grid.start, grid.history)


def _stretch(level: Level) -> StretchMotion:
    problem, motion = level.problem, level.motion
    grasps = reactions(problem, motion.grid, motion.forces)
    return stretch_of(problem, motion.grid, motion.times, motion.states, grasps)


def _material(problem: Problem, level: Level) -> MaterialMotion | None:
    motion = level.motion
    if len(motion.log) == 0 and not np.any(motion.grid.history.memory) and not problem.rests_as_it_begins:
        return None
    kept, memory, axial = motion.logged, motion.memory, motion.axial_memory
    if len(motion.log) == 0:
        of_bends = motion.grid.history.memory[:, : 1 if problem.nc == 2 else 3]
        memory = np.broadcast_to(of_bends, (len(kept), *of_bends.shape))
    if len(motion.log) == 0 or axial.shape[1] == 0:
        axial = np.broadcast_to(motion.grid.history.axial[:, 0], (len(kept), len(motion.history.axial)))
    return material_of(problem, motion.grid, motion.times[kept], motion.states[kept], memory, axial)
