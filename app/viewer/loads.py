"""The known forces in the scene, as arrows at the places where they act."""

import numpy as np
from numpy.typing import NDArray
from viser import SceneApi

from app.viewer.grippers import ARROW_LENGTH, SMALLEST_ARROW
from app.viewer.palette import LOAD, linear
from dlocore import Load, Prediction

Floats = NDArray[np.float64]


class LoadsPicture:
    """The arrows of all known forces.

    Args:
        scene: where they go.
        cable_diameter: [m].
        cable_length: [m].
    """

    def __init__(self, scene: SceneApi, cable_diameter: float, cable_length: float) -> None:
        self._arrow_length = ARROW_LENGTH * cable_length
        self._prediction: Prediction | None = None
        self._newtons = 1.0
        self._shown = True
        self._lift = np.array([0.0, 0.0, 0.6 * cable_diameter])
        self._arrows = scene.add_arrows(
            "/loads",
            np.zeros((1, 2, 3)),
            linear(np.array(LOAD)),
            shaft_radius=0.0035 * cable_length,
            head_radius=0.010 * cable_length,
            head_length=0.030 * cable_length,
            visible=False,
        )

    def take(self, prediction: Prediction) -> None:
        """Belong to a new prediction, in which the largest of them has the longest arrow."""
        self._prediction = prediction
        over = [forces_over(load, prediction.surface.horizon)[1] for load in prediction.scene.loads]
        self._newtons = max([1e-12, *(float(np.linalg.norm(forces, axis=1).max()) for forces in over)])

    def show_forces(self, shown: bool) -> None:
        """Draw the arrows, or not."""
        self._shown = shown

    def pose(self, time: float) -> None:
        """Show the forces that act at `time` [s]."""
        if self._prediction is None:
            return
        t = np.array([time])
        loads = self._prediction.scene.loads
        forces = np.array([load.at(t)[0] for load in loads]).reshape(-1, 3) / self._newtons
        acting = (np.linalg.norm(forces, axis=1) > SMALLEST_ARROW) & self._shown
        if self._arrows.visible != bool(acting.any()):
            self._arrows.visible = bool(acting.any())
        if acting.any():
            places = [load.u for load, acts in zip(loads, acting, strict=True) if acts]
            starts = self._prediction.surface.positions(places, t)[0] + self._lift
            ends = starts + forces[acting] * self._arrow_length
            self._arrows.points = np.stack([starts, ends], axis=1).astype(np.float32)


def forces_over(load: Load, horizon: float) -> tuple[Floats, Floats]:
    """Return times (k,) [s] until `horizon` [s] between which a force changes evenly, and the force then (k, 3) [N]."""
    given = np.zeros(0) if load.times is None else np.clip(load.times, 0.0, horizon)
    times = np.unique([0.0, *given, horizon])
    return times, load.at(times)
