"""Ends of a cable whose direction is held, with unit length (docs/model.md eq. 11), though the cable is stretched."""

import numpy as np
from numpy.typing import NDArray

from dlocore.problem.discretisation import axial_strain
from dlocore.problem.grid import Grid
from dlocore.scene.scene import Scene

Floats = NDArray[np.float64]

_SHORT = 0.21  # of the span beside such an end, times the strain there, is what it lacks (tests/solver/test_held_ends)
_NEAR = 3.0  # spans beside it over which the strain is taken: that of single points is a fifth off
_MATTERS = 1e-5  # of the length: less is not looked for


def held_back(scene: Scene, grid: Grid, states: Floats, strained: float) -> float:
    """Return how far unit length at its ends keeps a stretched cable from where it would be, at most [m].

    It is of first order in the spans, where all else is of higher order, so that two grids tell half of it only.

    Args:
        scene: whose grasps hold.
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
