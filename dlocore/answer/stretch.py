"""The axial strain over a whole motion, accurate enough for a tension."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from dlocore.answer.frames import unit
from dlocore.answer.parts import GraspReaction, StretchMotion
from dlocore.problem.discretisation import axial_strain
from dlocore.problem.grid import Grid
from dlocore.problem.problem import Problem
from dlocore.problem.tension import balanced, told_ends

Floats = NDArray[np.float64]

STRETCH_TIMES = 257  # most times at which the stretch of a motion is stored


def stretch_of(
    problem: Problem, grid: Grid, times: Floats, states: Floats, grasps: Sequence[GraspReaction]
) -> StretchMotion:
    """Return the axial strain of a cable from the states (k, n_u, nc) at the times (k,) [s] of a motion.

    Where a force acts at a point the tension jumps, and the strain is given on both sides as well. `grasps` are the
    reactions of the grippers.
    """
    scene = problem.scene
    kept = np.unique(np.linspace(0, len(times) - 1, STRETCH_TIMES).round().astype(int))
    length = float(grid.knots[-1])
    at = np.array([g for g in scene.places if 0.0 < g < length])
    sides = [np.nextafter(at, 0.0), at, np.nextafter(at, length)]
    u = np.unique(np.concatenate([[0.0], grid.tables.axial.u, *sides, [length]]))
    elastic = problem.stretch_memory is None and not np.any(grid.history.axial[:, 0])
    ends = told_ends(scene, grid) if elastic else []
    at_points = axial_strain(grid.tables, states[kept][..., : problem.plane.dimensions])
    at_ends = [_pulled(problem, grid, times, states, grasps, end)[kept] for end in ends]
    known = np.column_stack([at_points, *at_ends])
    return StretchMotion(times=times[kept], u=u, strain=known @ balanced(scene, grid, u, ends).T)


def _pulled(
    problem: Problem, grid: Grid, times: Floats, states: Floats, grasps: Sequence[GraspReaction], end: float
) -> Floats:
    """Return the elastic axial strain (k,) at an `end` [m] due to its gripper and loads, at the times (k,) [s].

    The force along the cable is EA e + eta_e e_t (docs/model.md eq. 7a), so that the strain follows it with a delay.
    """
    force = np.zeros((len(times), 3))
    for grasp in grasps:
        if grasp.u == end:
            until = np.searchsorted(grasp.times, times)  # at an event, the force before it
            force += grasp.reaction[until.clip(max=len(grasp.times) - 1)]
    for load in problem.scene.loads:
        if load.u == end:
            force += load.at(times, problem.horizon)
    slopes = grid.at(states, end, 1)[:, : problem.plane.dimensions]
    outwards = 1.0 if end > 0.0 else -1.0
    pull = outwards * (force * unit(problem.plane.world_vectors(slopes))).sum(axis=1)
    strain = pull / problem.stretch.axial_stiffness
    if problem.stretch_damping is None:
        return strain
    late = problem.stretch_damping.axial_damping / problem.stretch.axial_stiffness
    steps = np.diff(times) / late
    left, share = np.exp(-steps), -np.expm1(-steps) / steps  # factors of the old difference and of the pull's change
    out = strain.copy()
    for k, (was, new) in enumerate(pairwise(strain)):
        out[k + 1] = new + left[k] * (out[k] - was) - share[k] * (new - was)
    return out
