"""Grids on which a twisted cable can't wind itself into the helix to which it buckles."""

import math

import numpy as np
from numpy.typing import NDArray

from dlocore.kernels.assembly import History
from dlocore.kernels.twisted_rows import TWIST_RATE
from dlocore.problem.discretisation import axial_strain
from dlocore.problem.grid import Grid
from dlocore.problem.problem import Problem

Floats = NDArray[np.float64]

_SHOWN = 0.5 * math.pi  # phase of the helix within a span, at most: four spans a turn show it


def winds_unseen(problem: Problem, grid: Grid, q: Floats, history: History) -> bool:
    """Tell whether torque may buckle a cable to a helix with too many turns for its grid: it stays straight there.

    A taut cable buckles where its torque M exceeds 2 sqrt(EI T), to a helix of wave number M/(2 EI) (Love, 1927).

    Args:
        problem: the posed scene.
        grid: its space discretisation.
        q: control points (n_u, nc).
        history: the history of the cable in that state.
    """
    if problem.twist is None or problem.bend is None:
        return False
    EI = problem.bend.bending_stiffness
    torque = problem.twist.torsional_stiffness * np.abs(history.past[:, TWIST_RATE] - history.memory[:, 2])
    strain = axial_strain(grid.tables, q[:, : problem.plane.dimensions])
    tension = max(0.0, problem.stretch.axial_stiffness * float(np.average(strain, weights=grid.tables.axial.w)))
    cuts = np.unique(grid.knots)
    span = np.diff(cuts)[np.searchsorted(cuts, grid.tables.curvature.u) - 1]
    unseen = (torque > 2.0 * math.sqrt(EI * tension)) & (torque / (2.0 * EI) * span > _SHOWN)
    return bool(unseen.any())
