"""A gripper in the scene: its body, the path of the point it holds, and the force it gives."""

import numpy as np
from numpy.typing import NDArray
from viser import SceneApi

from app.viewer import geometry
from app.viewer.palette import REACTION, STEEL, linear
from dlocore import GraspReaction, Prediction, SplineSurface

Floats = NDArray[np.float64]
DASHES = 24
ARROW_LENGTH = 0.22  # of the largest reaction, as a fraction of the cable's length
SMALLEST_ARROW = 0.02  # shorter ones, as a fraction of the longest, are not drawn


class GripperPicture:
    """The nodes of one gripper."""

    def __init__(self, scene: SceneApi, number: int, cable_diameter: float, cable_length: float) -> None:
        vertices, faces = geometry.gripper(cable_diameter)
        self._arrow_length = ARROW_LENGTH * cable_length
        self._lift = np.array([0.0, 0.0, 0.6 * cable_diameter])
        # a batch of one: its pose then reaches the browser the same way as the cable's, and they are drawn in step
        self._body = scene.add_batched_meshes_simple(
            f"/gripper/{number}",
            vertices,
            faces,
            batched_wxyzs=np.array([[1.0, 0.0, 0.0, 0.0]]),
            batched_positions=np.zeros((1, 3)),
            batched_colors=linear(np.array(STEEL)),
            lod="off",
        )
        self._path = scene.add_line_segments(
            f"/gripper_path/{number}", np.zeros((DASHES, 2, 3)), STEEL, thickness=2.0, thickness_units="screen"
        )
        self._arrow = scene.add_arrows(
            f"/reaction/{number}",
            np.zeros((1, 2, 3)),
            linear(np.array(REACTION)),
            shaft_radius=0.0035 * cable_length,
            head_radius=0.010 * cable_length,
            head_length=0.030 * cable_length,
            visible=False,
        )
        self._surface: SplineSurface | None = None
        self._grasp: GraspReaction | None = None
        self._newtons = 1.0

    def take(self, prediction: Prediction, grasp: GraspReaction) -> None:
        """Belong to `grasp` of a new prediction."""
        self._surface, self._grasp = prediction.surface, grasp
        self._newtons = max(float(np.linalg.norm(grasp.reaction, axis=1).max(initial=0.0)), 1e-12)
        t = np.linspace(0.0, prediction.surface.horizon, 2 * DASHES)
        track = prediction.surface.positions([grasp.u], t)[:, 0] + self._lift
        self._path.points = track.reshape(DASHES, 2, 3).astype(np.float32)
        self._path.visible = bool(np.ptp(track, axis=0).max() > 1e-6)

    def pose(self, time: float) -> None:
        """Show body and reaction at `time` [s]."""
        if self._surface is None or self._grasp is None:
            return
        grasp = self._grasp
        point = self._surface.positions([grasp.u], [time])[0, 0]
        along = self._surface([grasp.u], [time], du=1)[0, 0, :3]
        self._body.batched_positions = point[None].astype(np.float32)
        self._body.batched_wxyzs = geometry.yaw(along)[None].astype(np.float32)
        force = np.array([np.interp(time, grasp.times, grasp.reaction[:, axis]) for axis in range(3)])
        share = float(np.linalg.norm(force)) / self._newtons
        self._arrow.visible = share > SMALLEST_ARROW
        start = point + self._lift
        self._arrow.points = np.array([[start, start + force / self._newtons * self._arrow_length]], dtype=np.float32)

    def remove(self) -> None:
        """Take the nodes out of the scene."""
        for node in (self._body, self._path, self._arrow):
            node.remove()
