"""Draw forces as arrows in the scene."""

import numpy as np
from numpy.typing import NDArray
from viser import SceneApi

from app.viewer.palette import linear

Floats = NDArray[np.float64]
ARROW_LENGTH = 0.22  # length of the arrow of the largest force, as a fraction of the cable's length
SMALLEST_ARROW = 0.02  # shorter arrows, as a fraction of the longest, are not drawn


class ForceArrows:
    """Arrows of one colour, a little above the places where forces act on the cable.

    Args:
        scene: the scene that gets the arrows.
        name: name of their node.
        colour: colour of all arrows.
        cable_diameter: [m].
        cable_length: [m].

    Attributes:
        lift: offset of the arrows above the cable (3,) [m].
    """

    def __init__(
        self, scene: SceneApi, name: str, colour: tuple[int, int, int], cable_diameter: float, cable_length: float
    ) -> None:
        self._longest = ARROW_LENGTH * cable_length
        self.lift = np.array([0.0, 0.0, 0.6 * cable_diameter])
        self._node = scene.add_arrows(
            name,
            np.zeros((1, 2, 3)),
            linear(np.array(colour)),
            shaft_radius=0.0035 * cable_length,
            head_radius=0.010 * cable_length,
            head_length=0.030 * cable_length,
            visible=False,
        )

    def draw(self, points: Floats, forces: Floats, shown: bool) -> None:
        """Draw forces (k, 3), as fractions of the largest of all times, at points (k, 3) [m] on the cable, or none."""
        long = (np.linalg.norm(forces, axis=1) > SMALLEST_ARROW) & shown
        if self._node.visible != bool(long.any()):
            self._node.visible = bool(long.any())
        if long.any():
            starts = points[long] + self.lift
            self._node.points = np.stack([starts, starts + self._longest * forces[long]], axis=1).astype(np.float32)

    def remove(self) -> None:
        """Remove the arrows from the scene."""
        self._node.remove()
