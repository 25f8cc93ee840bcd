"""Find where a predicted cable touches a table, an obstacle or itself, to mark it in the picture."""

import numpy as np
from numpy.typing import NDArray

from dlocore import Prediction
from dlocore.effects.distance import distances
from dlocore.effects.selfcontact import APART

Floats = NDArray[np.float64]
TOUCHING = 0.1  # of the diameter: a smaller gap between two surfaces counts as contact


def contact_points(prediction: Prediction, points: Floats) -> Floats:
    """Return the points that touch something (m, 3) [m], out of `points` (n, 3) [m] evenly spaced along the cable.

    A cable that lies on the table all the time touches it everywhere; this is not marked.
    """
    scene = prediction.scene
    diameter = scene.cable.diameter
    touches = np.zeros(len(points), dtype=bool)
    obstacles = scene.environment.obstacles
    if obstacles:
        rows = np.array([obstacle.row() for obstacle in obstacles])
        touches |= distances(rows, np.ascontiguousarray(points)).min(axis=1) < (0.5 + TOUCHING) * diameter
    if prediction.accuracy.dimensions == 3:
        table = scene.environment.table
        if table is not None:
            touches |= points[:, 2] < table.height + TOUCHING * diameter
        touches |= _itself(points, diameter, scene.cable.length)
    return points[touches]


def _itself(points: Floats, diameter: float, length: float) -> NDArray[np.bool_]:
    """Return which of the points touch another strand of the cable."""
    skipped = int(np.ceil(APART * diameter / length * (len(points) - 1))) + 1
    gaps = np.linalg.norm(points[:, None] - points[None], axis=-1)
    index = np.arange(len(points))
    gaps[np.abs(index[:, None] - index[None]) < skipped] = np.inf
    near: NDArray[np.bool_] = gaps.min(axis=1) < (1.0 + TOUCHING) * diameter
    return near
