"""Obstacles that stand on the table: their upright walls begin no higher than the centreline of a cable lying there."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dlocore.scene.obstacles import Obstacle, Sphere
from dlocore.scene.scene import Scene

Floats = NDArray[np.float64]

_VERTICAL = 1e-9  # by which the cosine of a wall's axis to the vertical may be below 1


def obstacle_rows(scene: Scene, obstacles: Sequence[Obstacle]) -> Floats:
    """Return the rows (m, ROW) of obstacles of a scene, see `effects/distance.py`.

    Upright walls that begin at the surface of the table, or up to one radius above it, are extended downwards by the
    length of the cable. So no cable gets under them, and a cable inside them is pushed out sideways.
    """
    rows = np.array([obstacle.row() for obstacle in obstacles])
    table, diameter = scene.environment.table, scene.cable.diameter
    if table is None:
        return rows
    for obstacle, row in zip(obstacles, rows, strict=True):
        if isinstance(obstacle, Sphere) or not obstacle.upright_at(table.height, 0.5 * diameter):
            continue
        axis = int(np.argmax(np.abs(row[[6, 9, 12]])))
        base = row[3] - row[13 + axis]
        if abs(row[6 + 3 * axis]) > 1.0 - _VERTICAL and base > table.height - diameter:
            row[3] -= 0.5 * scene.cable.length
            row[13 + axis] += 0.5 * scene.cable.length
    return rows
