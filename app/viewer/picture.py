"""Draw the 3D scene: table, obstacles, cable, space-time surface, ghosts, grippers, forces, contacts."""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray
from viser import PointCloudHandle, SceneApi

from app.instants import instants
from app.viewer import geometry
from app.viewer.contacts import contact_points
from app.viewer.grippers import GripperPicture
from app.viewer.ground import Ground
from app.viewer.loads import LoadsPicture
from app.viewer.obstacles import ObstaclesPicture
from app.viewer.palette import CONTACT, QUANTITIES, STEEL, ColourScale, Quantity, colour
from app.viewer.picking import CableClick, GripperClick, picked
from dlocore import Prediction
from dlocore.scene.obstacles import Obstacle

Floats = NDArray[np.float64]
SurfaceStyle = Literal["where it moved", "raised with time", "hidden"]
SURFACE_STYLES: tuple[SurfaceStyle, ...] = get_args(SurfaceStyle)

CABLE_SEGMENTS = 120
STRIPS = 8
STRIP_ROWS = 13  # instants in a strip: more would cost the browser time and show little more
STRIP_COLUMNS = 49  # points along the cable
GHOSTS = STRIPS + 1  # where strips begin and end
GHOST_COLUMNS = 65
LIFT = 0.45  # height of the raised surface, of the cable's length
CONTACT_SIZE = 1.7  # of the cable's diameter
MASS_SIZE = 3.5  # of the cable's diameter, of a point mass
SKY_LIGHT = 2.5  # in addition to the viewer's lamps, so that no side is black
GROUND_LIGHT = (200, 205, 210)


@dataclass(frozen=True)
class Look:
    """How the prediction is shown."""

    quantity: Quantity = QUANTITIES["time"]
    surface: SurfaceStyle = "where it moved"
    ghosts: bool = True
    forces: bool = True
    contacts: bool = True


class Picture:
    """The scene nodes of one client; every method runs on the viewer's event loop.

    Args:
        scene: the scene that gets the nodes.
    """

    def __init__(self, scene: SceneApi) -> None:
        self._scene = scene
        self._look = Look()
        self._prediction: Prediction | None = None
        self._scale: ColourScale | None = None
        self._time = 0.0
        self._points = np.zeros((CABLE_SEGMENTS + 1, 3))
        self._instants = np.zeros(STRIPS * (STRIP_ROWS - 1) + 1)  # s, of the rows of the swept surface
        self._size: tuple[float, float, int] | None = None  # length, diameter and number of grippers as drawn
        self._grippers: list[GripperPicture] = []
        self._strips = [
            self._scene.add_mesh_simple(
                f"/surface/{k}",
                np.zeros((STRIP_ROWS * STRIP_COLUMNS, 3)),
                geometry.strip_faces(STRIP_ROWS, STRIP_COLUMNS),
                color=STEEL,
                opacity=0.34,
                side="double",
                cast_shadow=False,
                receive_shadow=False,
            )
            for k in range(STRIPS)
        ]
        self._obstacles = ObstaclesPicture(self._scene)
        self._ground = Ground(self._scene)

    def show(self, prediction: Prediction, time: float = 0.0, selected: int | None = None) -> ColourScale:
        """Draw a new prediction at `time` [s], and mark the selected gripper; return the scale of the colours."""
        self._prediction = prediction
        self._scale = ColourScale.of(self._look.quantity, prediction)
        cable = prediction.scene.cable
        size = (cable.length, cable.diameter, len(prediction.grasps))
        if size != self._size:
            self._rebuild(*size)
        self._size = size
        forces = [np.linalg.norm(grasp.reaction, axis=1).max(initial=0.0) for grasp in prediction.grasps]
        for number, gripper in enumerate(self._grippers):
            gripper.take(prediction, number, max(float(max(forces)), 1e-12))
        self._loads.take(prediction)
        self.select(selected)
        self._obstacles.show(prediction.scene.environment.obstacles)
        self._ground.show(prediction)
        self._instants = instants(prediction.surface, len(self._instants))
        self._draw_strips()
        self._draw_ghosts()
        self.pose(time)
        return self._scale

    def refuse(self, obstacles: tuple[Obstacle, ...], refused: frozenset[int]) -> None:
        """Draw the obstacles of an impossible scene with the last prediction, and highlight the `refused` ones."""
        self._obstacles.show(obstacles, refused)

    def select(self, number: int | None) -> None:
        """Mark the selected gripper, if any."""
        for k, gripper in enumerate(self._grippers):
            gripper.mark(k == number)

    def picked(self, origin: Floats, direction: Floats) -> CableClick | GripperClick | None:
        """Return what lies in `direction` (3,) from `origin` (3,) [m]: a gripper, a place on the cable, or nothing."""
        if self._prediction is None:
            return None
        bodies = [gripper.body for gripper in self._grippers]
        return picked(origin, direction, self._points, self._prediction.surface.length, bodies)

    def _rebuild(self, length: float, diameter: float, grippers: int) -> None:
        """Recreate the nodes that depend on the size of the cable or on the number of grippers."""
        self._u = np.linspace(0.0, length, CABLE_SEGMENTS + 1)
        straight = np.column_stack([self._u, np.zeros((len(self._u), 2))])
        centres, wxyz = geometry.segment_poses(straight)
        vertices, faces = geometry.capsule(0.5 * diameter, length / CABLE_SEGMENTS)
        self._cable = self._scene.add_batched_meshes_simple(
            "/cable",
            vertices,
            faces,
            batched_wxyzs=wxyz,
            batched_positions=centres,
            batched_colors=np.full((CABLE_SEGMENTS, 3), STEEL, dtype=np.uint8),
            lod="off",
        )
        self._ghosts = self._scene.add_line_segments(
            "/ghosts",
            np.zeros((GHOSTS * (GHOST_COLUMNS - 1), 2, 3)),
            np.zeros((GHOSTS * (GHOST_COLUMNS - 1), 2, 3), dtype=np.uint8),
            thickness=0.45 * diameter,
        )
        self._marks = self._scene.add_point_cloud(
            "/contacts", np.zeros((1, 3)), CONTACT, point_size=CONTACT_SIZE * diameter, point_shape="circle"
        )
        self._marks.visible = False
        self._masses = self._scene.add_point_cloud(
            "/point_masses", np.zeros((1, 3)), STEEL, point_size=MASS_SIZE * diameter, point_shape="circle"
        )
        self._masses.visible = False
        for gripper in self._grippers:
            gripper.remove()
        self._grippers = [GripperPicture(self._scene, k, diameter, length) for k in range(grippers)]
        self._loads = LoadsPicture(self._scene, diameter, length)

    def restyle(self, look: Look) -> ColourScale | None:
        """Redraw the same prediction with another look; return the scale of the colours, if there is a prediction."""
        self._look = look
        if self._prediction is None:
            return None
        self._scale = ColourScale.of(look.quantity, self._prediction)
        self._draw_strips()
        self._draw_ghosts()
        self.pose(self._time)
        return self._scale

    def pose(self, time: float) -> None:
        """Show the cable, its grippers and its contacts at `time` [s]."""
        self._time = time
        if self._prediction is None or self._scale is None:
            return
        surface, t = self._prediction.surface, np.array([time])
        points = self._points = surface.positions(self._u, t)[0]
        centres, wxyz = geometry.segment_poses(points)
        self._cable.batched_positions = centres.astype(np.float32)
        self._cable.batched_wxyzs = wxyz.astype(np.float32)
        self._cable.batched_colors = self._scale.colours(self._prediction, 0.5 * (self._u[1:] + self._u[:-1]), t)[0]
        for gripper in self._grippers:
            gripper.show_forces(self._look.forces)
            gripper.pose(time)
        self._loads.show_forces(self._look.forces)
        self._loads.pose(time)
        self._mark(self._marks, contact_points(self._prediction, points) if self._look.contacts else points[:0])
        masses = [one.u for one in self._prediction.scene.cable.point_masses]
        self._mark(self._masses, surface.positions(masses, t)[0] if masses else points[:0])

    @staticmethod
    def _mark(marks: PointCloudHandle, points: Floats) -> None:
        if len(points):
            marks.points = points.astype(np.float32)
        if marks.visible != bool(len(points)):
            marks.visible = bool(len(points))

    def _height(self, t: Floats) -> Floats:
        """Return by how much the instants `t` are drawn above their true height [m]."""
        assert self._prediction is not None
        surface = self._prediction.surface
        return (LIFT * surface.length if self._look.surface == "raised with time" else 0.0) * t / surface.horizon

    def _draw_strips(self) -> None:
        assert self._prediction is not None
        surface = self._prediction.surface
        raised = self._look.surface == "raised with time"
        t = self._instants
        points = surface.positions(np.linspace(0.0, surface.length, STRIP_COLUMNS), t)
        points[..., 2] += self._height(t)[:, None]
        radius = 0.5 * self._prediction.scene.cable.diameter
        for k, strip in enumerate(self._strips):
            first = k * (STRIP_ROWS - 1)
            rows = points[first : first + STRIP_ROWS].copy()
            if not raised:
                # overlapping strips must not be coplanar: later ones lie a little higher, all below the cable
                rows[..., 2] -= radius * (1.0 - 0.9 * k / STRIPS)
            strip.vertices = rows.reshape(-1, 3).astype(np.float32)
            middle = t[first + STRIP_ROWS // 2] / surface.horizon
            strip.color = colour(middle) if self._look.quantity.name == "time" else STEEL
            strip.visible = self._look.surface != "hidden"

    def _draw_ghosts(self) -> None:
        assert self._prediction is not None
        assert self._scale is not None
        self._ghosts.visible = self._look.ghosts
        if not self._look.ghosts:
            return
        surface = self._prediction.surface
        t = self._instants[:: STRIP_ROWS - 1]
        u = np.linspace(0.0, surface.length, GHOST_COLUMNS)
        points = surface.positions(u, t)
        points[..., 2] += self._height(t)[:, None]
        colours = self._scale.colours(self._prediction, u, t)
        self._ghosts.points = np.concatenate([geometry.segments(row) for row in points]).astype(np.float32)
        self._ghosts.colors = np.concatenate([np.stack([row[:-1], row[1:]], axis=1) for row in colours])


def light(scene: SceneApi) -> None:
    """Light the scene of a client by sky and ground only.

    The viewer's own environment map delays the first picture by seconds on machines without a GPU. A playback keeps
    that map: lights of its own would be set anew, with all materials, whenever it starts again.
    """
    scene.configure_environment_map(hdri=None)
    scene.add_light_hemisphere("/sky", ground_color=GROUND_LIGHT, intensity=SKY_LIGHT)
