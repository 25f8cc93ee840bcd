"""Parallel transport of vectors: what a frame without spin does while the tangent turns."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def transported(before: Floats, after: Floats, x: Floats) -> Floats:
    """Return the vectors x (..., 3) turned by the smallest rotations from unit tangents `before` to `after` (..., 3).

    `kernels.strain.transport` is its compiled twin for one point.
    """
    both = before + after
    cosine = (before * after).sum(axis=-1, keepdims=True)
    mirrored = x - both * ((both * x).sum(axis=-1, keepdims=True) / (1.0 + cosine))
    return np.asarray(mirrored + 2.0 * after * (before * x).sum(axis=-1, keepdims=True))
