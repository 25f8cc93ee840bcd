"""Draw a gripper in the scene: its body, the path of the point it holds, and the force it exerts."""

import numpy as np
from numpy.typing import NDArray
from viser import SceneApi

from app.viewer import geometry
from app.viewer.arrows import ForceArrows
from app.viewer.palette import BRAND, REACTION, STEEL, linear
from dlocore import Grasp, GraspReaction, Prediction

Floats = NDArray[np.float64]
DASHES = 24
REACH = (0.03, 0.12)  # of the cable's length: the part of the body that is well above the cable


class GripperPicture:
    """The nodes of one gripper.

    Args:
        scene: the scene that gets the nodes.
        number: index of the gripper.
        cable_diameter: [m].
        cable_length: [m].

    Attributes:
        body: points along its axis, for picking by clicks (k, 3) [m]; none while the gripper is open.
    """

    def __init__(self, scene: SceneApi, number: int, cable_diameter: float, cable_length: float) -> None:
        vertices, faces = geometry.gripper(cable_diameter, cable_length)
        # a batch of one, so that its pose reaches the browser like the cable's, and both are drawn in step
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
        self._arrow = ForceArrows(scene, f"/reaction/{number}", REACTION, cable_diameter, cable_length)
        self._prediction: Prediction | None = None
        self._held: tuple[Grasp, GraspReaction] | None = None
        self._newtons = 1.0
        self._reactions = True
        self._reach = np.linspace(REACH[0], REACH[1], 5) * cable_length
        self.body = np.zeros((0, 3))

    def take(self, prediction: Prediction, number: int, newtons: float) -> None:
        """Take over grasp `number` of a new prediction, whose largest reaction of all grasps is `newtons` [N]."""
        self._prediction, self._newtons = prediction, newtons
        self._held = (prediction.scene.grasps[number], prediction.grasps[number])
        grasp, horizon = self._held[0], prediction.surface.horizon
        closes, opens = min(grasp.start, horizon), min(grasp.release_time or horizon, horizon)
        track = prediction.surface.positions([grasp.u], np.linspace(closes, opens, 2 * DASHES))[:, 0] + self._arrow.lift
        self._path.points = track.reshape(DASHES, 2, 3).astype(np.float32)
        self._path.visible = bool(np.ptp(track, axis=0).max() > 1e-6)

    def mark(self, selected: bool) -> None:
        """Show whether the gripper is selected."""
        self._body.batched_colors = linear(np.array(BRAND if selected else STEEL))

    def show_forces(self, shown: bool) -> None:
        """Show or hide the arrow of the reaction."""
        self._reactions = shown

    def pose(self, time: float) -> None:
        """Show body and reaction at `time` [s]; an open gripper is not shown."""
        if self._prediction is None or self._held is None:
            return
        grasp, given = self._held
        closed = grasp.start <= time and (grasp.release_time is None or time <= grasp.release_time)
        if self._body.visible != closed:
            self._body.visible = closed
        surface = self._prediction.surface
        point = surface.positions([grasp.u], [time])[0, 0]
        along = surface([grasp.u], [time], du=1)[0, 0, :3]
        self._body.batched_positions = point[None].astype(np.float32)
        axes = self._axes(grasp, time, along)
        self._body.batched_wxyzs = geometry.quaternion(axes)[None].astype(np.float32)
        self.body = point + np.outer(self._reach, axes[:, 2]) if closed else np.zeros((0, 3))
        force = np.array([np.interp(time, given.times, given.reaction[:, axis]) for axis in range(3)])
        self._arrow.draw(point[None], force[None] / self._newtons, self._reactions and closed)

    def _axes(self, grasp: Grasp, time: float, along: Floats) -> Floats:
        """Return the axes (3, 3) of the body: along the cable, and rotated with the path if that rotates."""
        turned = grasp.path.rotation_at(np.array([max(time - grasp.start, 0.0)]))
        if turned is None:
            return geometry.upright(along)
        return geometry.upright(along, turned[0] @ geometry.upright(turned[0].T @ along)[:, 2])

    def remove(self) -> None:
        """Remove the nodes from the scene."""
        for node in (self._body, self._path, self._arrow):
            node.remove()
