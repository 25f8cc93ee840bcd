"""The handle on the target of the selected gripper, and the texts next to it."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation
from viser import SceneApi, TransformControlsEvent

Floats = NDArray[np.float64]
SIZE = 0.16  # of the cable's length
WARNING_HEIGHT = 0.06  # of the cable's length above the target


class Gizmo:
    """Moves the target in the plane or in space, and rotates it if its gripper holds a direction.

    Args:
        scene: the scene that gets the handle.
        on_begin: called when a drag begins.
        on_drag: called with the position (3,) [m] and the quaternion wxyz (4,) of the handle.
        on_end: called when a drag ends.
    """

    def __init__(
        self,
        scene: SceneApi,
        on_begin: Callable[[], None],
        on_drag: Callable[[Floats, Floats], None],
        on_end: Callable[[], None],
    ) -> None:
        self._handle = scene.add_transform_controls("/target", scale=SIZE, line_width=3.0, depth_test=False)
        self._hint = scene.add_label("/target_hint", "drag me", anchor="top-left")
        self._warning = scene.add_label("/warning", "", visible=False, anchor="bottom-center")
        self._position = np.zeros(3)
        self._size = 1.0

        @self._handle.on_update
        async def _dragged(event: TransformControlsEvent) -> None:
            if event.phase == "start":
                on_begin()
            elif event.phase == "update":
                self._hint.visible = False
                self._position = np.array(self._handle.position, dtype=float)
                on_drag(self._position.copy(), np.array(self._handle.wxyz, dtype=float))
            else:
                on_end()

    def place(self, target: Floats, turn: Floats, *, size: float, in_space: bool, turns: bool) -> None:
        """Put the handle on a target.

        Args:
            target: (3,) [m].
            turn: rotation vector (3,) [rad].
            size: the cable's length [m].
            in_space: whether the handle also moves vertically.
            turns: whether the handle rotates.
        """
        self._position, self._size = target, size
        self._handle.position = target
        self._handle.wxyz = np.roll(Rotation.from_rotvec(turn).as_quat(), 1)
        self._hint.position = target
        axes = (True, True, in_space)
        for name, value in (("scale", SIZE * size), ("active_axes", axes), ("disable_rotations", not turns)):
            if getattr(self._handle, name) != value:
                setattr(self._handle, name, value)

    def show(self, *, visible: bool) -> None:
        """Show the handle, or hide it while something else is edited."""
        if self._handle.visible != visible:
            self._handle.visible = visible
            self._hint.visible = False

    def warn(self, text: str) -> None:
        """Show a warning above the target; "" removes it."""
        if not text:
            if self._warning.visible:
                self._warning.visible = False
            return
        self._warning.text = text
        self._warning.position = self._position + np.array([0.0, 0.0, WARNING_HEIGHT * self._size])
        self._warning.visible = True
