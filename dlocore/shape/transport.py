"""Parallel transport of vectors: the motion of a frame without spin while the tangent turns."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_OPPOSITE = -0.999999  # cosine below which tangents count as reversed: the smallest rotation is not unique


def transported(before: Floats, after: Floats, x: Floats) -> Floats:
    """Return the vectors x (..., 3) turned by the smallest rotations from unit tangents `before` to `after` (..., 3).

    Reversed tangents leave them as they are. `kernels.strain.transport` is its compiled twin for one point.
    """
    both = before + after
    cosine = (before * after).sum(axis=-1, keepdims=True)
    reversed_ = cosine < _OPPOSITE
    mirrored = x - both * ((both * x).sum(axis=-1, keepdims=True) / np.where(reversed_, 1.0, 1.0 + cosine))
    return np.where(reversed_, x, mirrored + 2.0 * after * (before * x).sum(axis=-1, keepdims=True))
