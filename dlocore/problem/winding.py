"""Helices to which a twisted cable buckles, and that its grid can't show."""

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


def unseen_helix(problem: Problem, grid: Grid, q: Floats, history: History) -> float:
    """Return the largest radius of a helix [m] to which torque may buckle a cable unseen; 0 if its grid shows it.

    A taut cable buckles where its torque M exceeds 2 sqrt(EI T), to a helix of wave number k = M/(2 EI) (Love, 1927).
    With too few control points it stays straight. A helix of radius r takes r^2 k^2/2 of the length: at most what the
    cable is longer than its chord, and what it is stretched.

    Args:
        problem: the posed scene.
        grid: its space discretisation.
        q: control points (n_u, nc).
        history: the history of the cable in that state.
    """
    if problem.twist is None or problem.bend is None:
        return 0.0
    EI, r = problem.bend.bending_stiffness, q[:, : problem.plane.dimensions]
    torque = problem.twist.torsional_stiffness * np.abs(history.past[:, TWIST_RATE] - history.memory[:, 2])
    strain = max(0.0, float(np.average(axial_strain(grid.tables, r), weights=grid.tables.axial.w)))
    wave_number = torque / (2.0 * EI)
    cuts = np.unique(grid.knots)
    span = np.diff(cuts)[np.searchsorted(cuts, grid.tables.curvature.u) - 1]
    buckles = torque > 2.0 * math.sqrt(EI * problem.stretch.axial_stiffness * strain)
    unseen = buckles & (wave_number * span > _SHOWN)
    chord = float(np.linalg.norm(r[-1] - r[0])) / problem.scene.cable.length
    spare = max(0.0, 1.0 + 2.0 * strain - chord)
    return math.sqrt(2.0 * spare) / float(wave_number[unseen].min()) if unseen.any() else 0.0
