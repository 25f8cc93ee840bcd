"""Points in order along a whole cable, which give a start or a stress-free shape."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dlocore.errors import SceneError, points_array
from dlocore.words import counted

MIN_POINTS, MAX_POINTS = 4, 100_000


def points_along(field: str, value: ArrayLike) -> NDArray[np.float64]:
    """Return points (n, 3) [m] of the points (n, 2 or 3) `value`, 2D points at z = 0.

    Raises:
        SceneError: they are not such points, too few, too many, or all the same.
    """
    points = points_array(field, value)
    if not MIN_POINTS <= len(points) <= MAX_POINTS:
        raise SceneError(field, counted(len(points), "point"), f"{MIN_POINTS} to {MAX_POINTS} points")
    if not np.ptp(points, axis=0).max() > 1e-9:
        raise SceneError(field, points, "points that are not all the same")
    return points
