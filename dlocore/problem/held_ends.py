"""Ends whose direction is held with unit length (docs/model.md eq. 11), although the cable is stretched there."""

import numpy as np
from numpy.typing import NDArray

from dlocore.problem.discretisation import axial_strain
from dlocore.problem.grid import Grid
from dlocore.scene.scene import Scene

Floats = NDArray[np.float64]

_SHORT = 0.21  # missing length beside such an end, over span times strain there (tests/solver/test_held_ends)
_NEAR = 3.0  # spans beside it over which the strain is averaged: that of single points is a fifth off
_MATTERS = 1e-5  # of the length: less is ignored


def held_back(scene: Scene, grid: Grid, states: Floats, strained: float) -> float:
    """Return the largest displacement of a stretched cable due to the unit length at its ends [m].

    This error is of first order in the spans, whereas all others are of higher order, so that two grids show only half
    of it.

    Args:
        scene: the scene with the grasps.
        grid: its space discretisation.
        states: positions of the control points over the motion (k, n_u, 2 or 3) [m].
        strained: the largest axial strain of the motion.
    """
    length, found = scene.cable.length, 0.0
    ends = {g.u for g in scene.grasps if g.hold != "point" and g.u in (0.0, length)}
    if not ends or _SHORT * strained < _MATTERS:
        return found
    breaks = np.unique(grid.knots)
    for u in ends:
        span = float(breaks[1] if u == 0.0 else length - breaks[-2])
        near = np.abs(grid.tables.axial.u - u) < _NEAR * span
        strain = axial_strain(grid.tables, states)[:, near]
        found += _SHORT * span * float(np.abs(np.average(strain, axis=1, weights=grid.tables.axial.w[near])).max())
    return found
