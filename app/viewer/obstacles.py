"""Obstacles in the scene, by their true surfaces."""

import numpy as np
from viser import SceneApi, SceneNodeHandle

from app.solids import pose
from app.viewer import geometry
from app.viewer.palette import OBSTACLE
from dlocore import Box, Capsule, Cylinder, Sphere
from dlocore.scene.obstacles import Obstacle

SIDES, RINGS = 48, 12  # of round ones


class ObstaclesPicture:
    """The nodes of all obstacles."""

    def __init__(self, scene: SceneApi) -> None:
        self._scene = scene
        self._rows: list[list[float]] = []
        self._nodes: list[SceneNodeHandle] = []

    def show(self, obstacles: tuple[Obstacle, ...]) -> None:
        """Draw `obstacles`, unless they are those that stand there."""
        rows = [obstacle.row().tolist() for obstacle in obstacles]
        if rows == self._rows:
            return
        self._rows = rows
        for node in self._nodes:
            node.remove()
        self._nodes = [self._added(k, obstacle) for k, obstacle in enumerate(obstacles)]

    def _added(self, number: int, obstacle: Obstacle) -> SceneNodeHandle:
        vertices, faces = mesh(obstacle)
        centre, wxyz = pose(obstacle)
        return self._scene.add_mesh_simple(
            f"/obstacle/{number}", vertices, faces, color=OBSTACLE, position=centre, wxyz=wxyz
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
