"""Draw the obstacles in the scene with their true surfaces."""

import numpy as np
from viser import SceneApi, SceneNodeHandle

from app.solids import pose
from app.viewer import geometry
from app.viewer.palette import OBSTACLE, WARNING
from dlocore import Box, Capsule, Cylinder, Sphere
from dlocore.scene.obstacles import Obstacle

SIDES, RINGS = 48, 12  # of round obstacles
REFUSED_OPACITY = 0.5  # a refused obstacle lets the cable show through


class ObstaclesPicture:
    """The nodes of all obstacles."""

    def __init__(self, scene: SceneApi) -> None:
        self._scene = scene
        self._drawn: tuple[list[list[float]], frozenset[int]] = ([], frozenset())
        self._nodes: list[SceneNodeHandle] = []

    def show(self, obstacles: tuple[Obstacle, ...], refused: frozenset[int] = frozenset()) -> None:
        """Draw `obstacles` unless they are already drawn; highlight the `refused` ones."""
        drawn = ([obstacle.row().tolist() for obstacle in obstacles], refused)
        if drawn == self._drawn:
            return
        self._drawn = drawn
        for node in self._nodes:
            node.remove()
        self._nodes = [self._added(k, obstacle, refused=k in refused) for k, obstacle in enumerate(obstacles)]

    def _added(self, number: int, obstacle: Obstacle, *, refused: bool) -> SceneNodeHandle:
        vertices, faces = mesh(obstacle)
        centre, wxyz = pose(obstacle)
        colour, opacity = (WARNING, REFUSED_OPACITY) if refused else (OBSTACLE, None)
        return self._scene.add_mesh_simple(
            f"/obstacle/{number}", vertices, faces, color=colour, opacity=opacity, position=centre, wxyz=wxyz
        )


def mesh(obstacle: Obstacle) -> geometry.Mesh:
    """Return the surface of an obstacle in its own axes, about its centre."""
    match obstacle:
        case Sphere():
            return geometry.capsule(obstacle.radius, 0.0, SIDES, RINGS)
        case Capsule():
            length = float(np.linalg.norm(np.subtract(obstacle.end, obstacle.start)))
            return geometry.capsule(obstacle.radius, length, SIDES, RINGS)
        case Cylinder():
            vertices, faces = geometry.cylinder(obstacle.radius, SIDES)
            return vertices * (1.0, 1.0, obstacle.height), faces
        case Box():
            x, y, z = np.asarray(obstacle.size)
            return geometry.box((x, y, z), (0.0, 0.0, 0.0))
