"""Detect that the grippers pull the cable taut: the path between them is longer than the cable."""

from typing import cast

import numpy as np
from numpy.typing import NDArray

from dlocore.kernels.assembly import largest_curvature
from dlocore.levels.level import Level
from dlocore.problem.discretisation import axial_strain
from dlocore.words import in_newtons

Floats = NDArray[np.float64]

TAUT = 10.0  # times the sum of all other forces on the cable: the mean tension from which on it is pulled taut
_LOOKS = 65  # states of a motion that are checked, at most


def taut_notes(level: Level) -> list[str]:
    """Return a note if the grippers, which are stiffer than anything, pull the cable taut.

    The mean tension along the cable is then far above the sum of weight, inertia, drag, bending and loads, in at least
    two successive looks. Waves of stretch pass between looks.
    """
    problem, motion = level.problem, level.motion
    scene, cable = problem.scene, problem.scene.cable
    if not scene.grasps or problem.stretch_memory is not None or motion.reached < 2:
        return []
    most = cast(float, cable.axial_stiffness) * motion.largest_strain
    if most <= TAUT * (scene.weight + cast(float, cable.bending_stiffness) / cable.length**2):
        return []  # most motions
    at = np.unique(np.linspace(0, motion.reached, _LOOKS).round().astype(int))
    states, times, tables = motion.states[at], motion.times[at], motion.grid.tables
    strain = axial_strain(tables, states[..., : problem.plane.dimensions]) @ tables.axial.w / cable.length
    tension, others = cast(float, cable.axial_stiffness) * strain, _others(level, states, times)
    taut = np.flatnonzero(tension > TAUT * others)
    if not (np.diff(taut) == 1).any():
        return []
    worst = int(tension.argmax())
    pull, rest = in_newtons(tension[worst]), in_newtons(others)
    return [
        f"the grippers pull the cable taut: at {times[worst]:.3g} s its mean tension is {pull}, while all other forces "
        f"on it add up to {rest}; bring the grippers no farther apart than the length of cable between them"
    ]


def _others(level: Level, states: Floats, times: Floats) -> float:
    """Return about the largest sum of all forces on a cable except those of its grippers [N]."""
    problem = level.problem
    scene, cable, around, grid = problem.scene, problem.scene.cable, problem.scene.environment, level.motion.grid
    velocity = np.diff(states[..., : problem.plane.dimensions], axis=0) / np.diff(times)[:, None, None]
    acceleration = np.diff(velocity, axis=0) / np.diff(times)[1:, None, None]
    speed, change = (float(np.linalg.norm(x, axis=2).max()) for x in (velocity, acceleration))
    spread = cable.linear_density * change + (around.drag + around.drag_quadratic * speed) * speed
    bend = float(largest_curvature(problem.axes, states, grid.tables.curvature, grid.history.memory)) + 1 / cable.length
    loads = sum(float(np.linalg.norm(np.atleast_2d(load.force), axis=1).max()) for load in scene.loads)
    stiff = cast(float, cable.bending_stiffness) * bend**2
    heavy = change * sum(one.mass for one in cable.point_masses)
    return scene.weight + cable.length * spread + heavy + cable.linear_density * speed**2 + stiff + loads
