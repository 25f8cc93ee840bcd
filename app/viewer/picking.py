"""Find what a click in the picture hits: a gripper, a place on the cable, or nothing."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
NEAR_CABLE = 0.014  # rad, largest angle between a click and the cable as the camera sees them: about 18 of 900 pixels
NEAR_GRIPPER = 0.022  # rad, the same to the axis of a gripper's body


@dataclass(frozen=True)
class CableClick:
    """A click on the cable at u [m]."""

    u: float


@dataclass(frozen=True)
class GripperClick:
    """A click on the gripper of this number."""

    number: int


def picked(
    origin: Floats, direction: Floats, cable: Floats, length: float, bodies: list[Floats]
) -> CableClick | GripperClick | None:
    """Return what a line of sight hits; a gripper takes precedence over the cable, which it hides.

    Args:
        origin: position of the camera (3,) [m].
        direction: direction of the line of sight (3,).
        cable: points evenly spaced along the cable (n, 3) [m].
        length: length of the cable [m].
        bodies: points along the axis of each gripper's body (k, 3) [m]; none for one that is not shown.
    """
    nearest = [(_angles(origin, direction, body).min(initial=np.inf), k) for k, body in enumerate(bodies)]
    if nearest and min(nearest)[0] < NEAR_GRIPPER:
        return GripperClick(min(nearest)[1])
    angles = _angles(origin, direction, cable)
    k = int(np.argmin(angles))
    return CableClick(k / (len(cable) - 1) * length) if angles[k] < NEAR_CABLE else None


def _angles(origin: Floats, direction: Floats, points: Floats) -> Floats:
    """Return the angles (n,) [rad] between the line of sight and the points."""
    sight = direction / np.linalg.norm(direction)
    to = points - origin
    along = to @ sight
    across = np.linalg.norm(to - along[:, None] * sight, axis=1)
    return np.arctan2(across, along)
