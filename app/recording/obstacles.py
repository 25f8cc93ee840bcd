"""The obstacles of a scene, as solids that show on every timeline."""

from typing import TYPE_CHECKING, Any, cast

import numpy as np

from app.recording.style import OBSTACLE, Floats, chunk
from app.solids import pose
from dlocore import Box, Capsule, Cylinder, Sphere
from dlocore.scene.obstacles import Obstacle

if TYPE_CHECKING:
    from rerun.chunk import Chunk


def obstacle_chunks(obstacles: tuple[Obstacle, ...], origin: str) -> "list[Chunk]":
    """Return a solid for each obstacle under the entity `origin`."""
    return [chunk(f"{origin}/{k}", [], _solid(obstacle)) for k, obstacle in enumerate(obstacles)]


def _solid(obstacle: Obstacle) -> Any:
    import rerun as rr

    centre, wxyz = pose(obstacle)
    look: dict[str, Any] = {
        "quaternions": [np.roll(wxyz, -1)],
        "colors": [OBSTACLE],
        "fill_mode": [rr.components.FillMode.Solid],
    }
    match obstacle:
        case Sphere():
            return rr.Ellipsoids3D.columns(centers=[centre], half_sizes=[[obstacle.radius] * 3], **look)
        case Capsule():  # rerun places a capsule by the end from which it extends
            start, end = cast(Floats, obstacle.start), cast(Floats, obstacle.end)
            length = float(np.linalg.norm(end - start))
            return rr.Capsules3D.columns(translations=[start], lengths=[length], radii=[obstacle.radius], **look)
        case Cylinder():
            return rr.Cylinders3D.columns(centers=[centre], lengths=[obstacle.height], radii=[obstacle.radius], **look)
        case Box():
            return rr.Boxes3D.columns(centers=[centre], half_sizes=[0.5 * cast(Floats, obstacle.size)], **look)
