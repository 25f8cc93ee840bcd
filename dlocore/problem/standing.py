"""What stands on the table: obstacles whose upright walls begin no higher than the middle of a cable lying there."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from dlocore.scene.obstacles import Obstacle, Sphere
from dlocore.scene.scene import Scene

Floats = NDArray[np.float64]

_VERTICAL = 1e-9  # of 1, by which the axis of a wall may be off


def obstacle_rows(scene: Scene, obstacles: Sequence[Obstacle]) -> Floats:
    """Return the rows (m, ROW) of obstacles of a scene, see `effects/distance.py`.

    Upright walls that begin at the surface of the table, or up to the middle of a cable on it, go on below that by its
    length: no cable gets under them, and what is in them is pushed out sideways.
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
