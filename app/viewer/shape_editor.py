"""Beads on the start shape, for dragging it."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from viser import ClientHandle

from app.viewer import geometry, shapes
from app.viewer.palette import BRAND, linear
from dlocore.shape.shape import StartCurve

Floats = NDArray[np.float64]
BEAD = 0.016  # radius, of the cable's length
FLATTEST = 0.05  # slope below which a line of sight meets the table too far away


class ShapeEditor:
    """Shows the beads of a start shape while it is edited.

    Args:
        client: the client whose scene shows the beads.
        on_drag: called with the dragged points (n, 3) [m], and with whether a bead is still held.
    """

    def __init__(self, client: ClientHandle, on_drag: Callable[[Floats, bool], None]) -> None:
        self._client = client
        self._on_drag = on_drag
        self._beads: Any = None
        self._points = np.zeros((shapes.HANDLES, 3))
        self._begun: Floats | None = None
        self.in_space = False

    @property
    def active(self) -> bool:
        """Whether the beads are shown."""
        return self._beads is not None

    @property
    def held(self) -> bool:
        """Whether a bead is being dragged."""
        return self._begun is not None

    def show(self, start: StartCurve, length: float) -> None:
        """Show the beads of a start shape."""
        self._points = shapes.handles(start, length)
        if self._beads is not None:
            self._beads.remove()
        vertices, faces = geometry.capsule(BEAD * length, 0.0, 20, 6)
        count = len(self._points)
        self._beads = self._client.scene.add_batched_meshes_simple(
            "/start_shape",
            vertices,
            faces,
            batched_wxyzs=np.tile([1.0, 0.0, 0.0, 0.0], (count, 1)),
            batched_positions=self._points,
            batched_colors=linear(np.array(BRAND)),
            lod="off",
            cast_shadow=False,
        )

        @self._beads.on_drag
        async def _dragged(event: Any) -> None:
            if event.instance_index is None:
                return
            if event.phase == "start":
                self._begun = self._points.copy()
            if self._begun is None:
                return
            to = self._reached(np.array(event.end_position, dtype=float), self._begun[event.instance_index])
            self._points = shapes.dragged(self._begun, event.instance_index, to)
            self._beads.batched_positions = self._points.astype(np.float32)
            if event.phase == "end":
                self._begun = None
            self._on_drag(self._points, event.phase != "end")

    def follow(self, start: StartCurve, length: float) -> None:
        """Move the beads to another start shape, unless one is being dragged."""
        if self.active and not self.held:
            self.show(start, length)

    def hide(self) -> None:
        """Remove the beads."""
        if self._beads is not None:
            self._beads.remove()
        self._beads, self._begun = None, None

    def _reached(self, pointer: Floats, before: Floats) -> Floats:
        """Return where the pointer moves a bead: in a plane that faces the camera, or at the bead's own height."""
        if self.in_space:
            return pointer
        eye = np.asarray(self._client.camera.position, dtype=float)
        sight = pointer - eye
        if abs(sight[2]) < FLATTEST * float(np.linalg.norm(sight)):
            return before
        return np.append((eye + sight * (before[2] - eye[2]) / sight[2])[:2], before[2])
