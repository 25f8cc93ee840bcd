"""The instants at which a whole motion is drawn: evenly spaced along its path, not in time."""

import numpy as np
from numpy.typing import NDArray

from dlocore import SplineSurface

Floats = NDArray[np.float64]
POINTS = 17  # along the cable; the one that moves farthest counts
FINENESS = 8  # parts of a knot span of time, within each of which the speed is taken as constant
RESTS = 1e-6  # of the cable's length: extra distance for the whole time, so that a cable at rest also has instants


def instants(surface: SplineSurface, count: int) -> Floats:
    """Return `count` times (count,) [s], from the first to the last, between which the motion covers equal distances.

    Between two of them no point moves by more than that share of the whole distance, however short a move or long a
    rest is.
    """
    knots = np.unique(surface.knots_t)
    parts = np.linspace(knots[:-1], knots[1:], FINENESS, endpoint=False, axis=1).ravel()
    t = np.append(parts, surface.horizon)
    points = surface.positions(np.linspace(0.0, surface.length, POINTS), t)
    steps = np.linalg.norm(np.diff(points, axis=0), axis=-1).max(axis=1) + RESTS * surface.length * np.diff(t) / t[-1]
    way = np.append(0.0, np.cumsum(steps))
    if not np.isfinite(way[-1]):  # the motion has diverged
        return np.linspace(0.0, surface.horizon, count)
    return np.interp(np.linspace(0.0, way[-1], count), way, t)
