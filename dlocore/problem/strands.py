"""How near the strands of a cable come to each other."""

import numpy as np
from numpy.typing import NDArray

from dlocore.effects.selfcontact import APART
from dlocore.kernels.basis import basis_rows
from dlocore.kernels.strands import lengths_apart, nearest_of

Floats = NDArray[np.float64]

_MOST_PARTS = 1000  # into which the cable is divided to find near strands


def nearest_strands(knots: Floats, states: Floats, dimensions: int, diameter: float, within: float) -> float:
    """Return the smallest distance of two strands [m] in the states of a motion, infinite if it is above `within`.

    Strands that are a length s apart along the cable are at least s cos(T/2) apart in space if the cable turns by
    T < pi between them (Schur), and the control polygon turns at least as much. So most states need no closer look, and
    in the others only strands that are far apart along the cable do.

    Args:
        knots: (n + 4,) [m].
        states: control points (k, n, nc) [m].
        dimensions: of the centreline, 2 or 3.
        diameter: of the cable [m].
        within: largest distance of interest [m], less than `APART` diameters.
    """
    knots = np.array(knots)  # those of a given start are read-only, and kernels are compiled for writable arrays
    apart = lengths_apart(states, knots, dimensions, 2.0 * float(np.arccos(within / (APART * diameter))))
    which = np.flatnonzero(apart < knots[-1])
    if len(which) == 0:
        return np.inf
    length = float(knots[-1])
    u = np.linspace(0.0, length, 1 + int(np.ceil(length / max(diameter, length / _MOST_PARTS))))
    first, table = basis_rows(knots, u, 0)
    rows = np.ascontiguousarray(table[:, 0])
    found = float(nearest_of(states, which, apart, first, rows, u, dimensions, APART * diameter, within))
    return found if found < within else np.inf
