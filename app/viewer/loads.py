"""Draw the known forces in the scene, as arrows at the places where they act."""

import numpy as np
from numpy.typing import NDArray
from viser import SceneApi

from app.viewer.arrows import ForceArrows
from app.viewer.palette import LOAD
from dlocore import Load, Prediction

Floats = NDArray[np.float64]


class LoadsPicture:
    """The arrows of all known forces.

    Args:
        scene: the scene that gets the arrows.
        cable_diameter: [m].
        cable_length: [m].
    """

    def __init__(self, scene: SceneApi, cable_diameter: float, cable_length: float) -> None:
        self._prediction: Prediction | None = None
        self._newtons = 1.0
        self._shown = True
        self._arrows = ForceArrows(scene, "/loads", LOAD, cable_diameter, cable_length)

    def take(self, prediction: Prediction) -> None:
        """Take over a new prediction; its largest known force has the longest arrow."""
        self._prediction = prediction
        over = [forces_over(load, prediction.surface.horizon)[1] for load in prediction.scene.loads]
        self._newtons = max([1e-12, *(float(np.linalg.norm(forces, axis=1).max()) for forces in over)])

    def show_forces(self, shown: bool) -> None:
        """Show or hide the arrows."""
        self._shown = shown

    def pose(self, time: float) -> None:
        """Show the forces that act at `time` [s]."""
        if self._prediction is None:
            return
        t, end = np.array([time]), self._prediction.surface.horizon
        loads = self._prediction.scene.loads
        forces = np.array([load.at(t, end)[0] for load in loads]).reshape(-1, 3) / self._newtons
        points = self._prediction.surface.positions([load.u for load in loads], t)[0] if loads else np.zeros((0, 3))
        self._arrows.draw(points, forces, self._shown)


def forces_over(load: Load, horizon: float) -> tuple[Floats, Floats]:
    """Return times (k,) [s] from 0 to `horizon` [s] between which a force is linear, and the force there (k, 3) [N].

    Times between the first and the last appear twice, with the force before and after a possible jump.
    """
    given = np.zeros(0) if load.times is None else np.clip(load.times, 0.0, horizon)
    times = np.unique([0.0, *given, horizon])
    both = np.stack([load.at(times, 0.0), load.at(times)], axis=1).reshape(-1, 3)
    return np.repeat(times, 2)[1:-1], both[1:-1]
