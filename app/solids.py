"""Position and orientation of an obstacle, for drawing it."""

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from dlocore.scene.obstacles import Obstacle

Floats = NDArray[np.float64]


def pose(obstacle: Obstacle) -> tuple[Floats, Floats]:
    """Return the centre (3,) [m] of an obstacle and the quaternion wxyz (4,) that rotates its own axes into the world.

    The axis of capsules and cylinders is their own z.
    """
    row = obstacle.row()
    axes = row[4:13].reshape(3, 3)
    return row[1:4], np.roll(Rotation.from_matrix(axes.T).as_quat(), 1)
