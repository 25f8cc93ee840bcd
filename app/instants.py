"""The instants at which a whole motion is drawn: evenly spaced along its way, not in time."""

import numpy as np
from numpy.typing import NDArray

from dlocore import SplineSurface

Floats = NDArray[np.float64]
POINTS = 17  # along the cable, of which the one that moves farthest counts
FINENESS = 8  # parts of a knot span of time, within which the speed counts as even
RESTS = 1e-6  # of the cable's length: the way that the whole time counts as, so that a cable at rest has instants, too


def instants(surface: SplineSurface, count: int) -> Floats:
    """Return `count` times (count,) [s], the first and the last among them, between which a motion goes equally far.

    Between two of them no point moves by more than its share of the whole way, however short a move is, or long a rest.
    """
    knots = np.unique(surface.knots_t)
    parts = np.linspace(knots[:-1], knots[1:], FINENESS, endpoint=False, axis=1).ravel()
    t = np.append(parts, surface.horizon)
    points = surface.positions(np.linspace(0.0, surface.length, POINTS), t)
    steps = np.linalg.norm(np.diff(points, axis=0), axis=-1).max(axis=1) + RESTS * surface.length * np.diff(t) / t[-1]
    way = np.append(0.0, np.cumsum(steps))
    if not np.isfinite(way[-1]):  # of a motion that has diverged
        return np.linspace(0.0, surface.horizon, count)
    return np.interp(np.linspace(0.0, way[-1], count), way, t)
