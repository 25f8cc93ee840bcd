"""Whether a planar motion that is its own mirror image stays so, or a lopsided cable departs from it."""

import numpy as np
from numpy.typing import NDArray

from dlocore.problem.buckling import BOW
from dlocore.problem.discretisation import plane_curvature_of
from dlocore.problem.problem import Problem
from dlocore.solvers.march import March, march
from dlocore.solvers.monitor import Monitor
from dlocore.spline import design_matrix, greville

Floats = NDArray[np.float64]

MATTERS = 10.0  # times the disturbance: if it grows less, the motion is as good as symmetric
_EXACT = 1e-7  # of the length: a motion this close to its mirror image is symmetric for the solver too
_LOOKS = 7  # states of a motion
_PLACES = 33  # along the cable


def goes_elsewhere(problem: Problem, motion: March) -> float:
    """Return how far a lopsided cable departs from a symmetric planar motion [m]; 0 if the difference does not grow.

    The stress-free shape is bent by BOW of the length, to one side in one half and to the other side in the other. The
    motion is marched once more from the same start in the same steps.
    """
    length = problem.scene.cable.length
    if problem.plane.dimensions != 2 or motion.stopped or not _is_mirrored(motion, length):
        return 0.0
    grid = motion.grid
    u = greville(grid.knots)
    tangent = design_matrix(grid.knots, u, 1) @ grid.start
    across = np.column_stack([-tangent[:, 1], tangent[:, 0]]) / np.linalg.norm(tangent, axis=1)[:, None]
    bent = grid.start + BOW * length * np.sin(2.0 * np.pi * u / length)[:, None] * across
    history = grid.past()
    history.memory[:] += plane_curvature_of(grid.tables, bent) - plane_curvature_of(grid.tables, grid.start)
    lopsided = grid.changed(history=history)
    other = march(problem, lopsided, motion.asked, Monitor(None, None, None), rho=motion.rho)
    if other.stopped:
        return 0.0
    away = float(np.linalg.norm(other.states - motion.states, axis=2).max())
    return away if away > MATTERS * BOW * length else 0.0


def _is_mirrored(motion: March, length: float) -> bool:
    """Tell whether a cable is always its own mirror image, in the line across the middle between its ends."""
    places = design_matrix(motion.grid.knots, np.linspace(0.0, length, _PLACES))
    looks = np.linspace(0, len(motion.states) - 1, _LOOKS).astype(int)
    r = np.einsum("pi,kid->kpd", places, motion.states[looks])
    chord = r[:, -1] - r[:, 0]
    far = np.linalg.norm(chord, axis=1)
    if not far.min() > _EXACT * length:
        return False
    along = (chord / far[:, None])[:, None]
    middle = 0.5 * (r[:, -1] + r[:, 0])[:, None]
    image = r - 2.0 * ((r - middle) * along).sum(axis=2, keepdims=True) * along
    return bool(np.abs(image[:, ::-1] - r).max() <= _EXACT * length)
