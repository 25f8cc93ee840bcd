"""Lower bands of symmetric matrices, as the kernels store them, for code that is not compiled."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def dense_of(band: Floats) -> Floats:
    """Return the symmetric matrix (n, n) of a lower band (n, width)."""
    n, width = band.shape
    full = np.zeros((n, n))
    for o in range(min(width, n)):
        at = np.arange(n - o)
        full[at + o, at] = full[at, at + o] = band[: n - o, o]
    return full
