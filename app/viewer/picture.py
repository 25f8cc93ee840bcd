"""What stands in the 3D scene: table, obstacles, cable, space-time surface, ghosts, grippers, paths and reactions."""

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray
from viser import ClientHandle

from app.viewer import geometry
from app.viewer.draft import Draft
from app.viewer.grippers import GripperPicture
from app.viewer.obstacles import ObstaclesPicture
from app.viewer.palette import QUANTITIES, STEEL, ColourScale, Quantity, colour
from dlocore import Prediction

Floats = NDArray[np.float64]
SurfaceStyle = Literal["on the table", "raised with time", "hidden"]
SURFACE_STYLES: tuple[SurfaceStyle, ...] = get_args(SurfaceStyle)

CABLE_SEGMENTS = 120
STRIPS = 8
STRIP_ROWS = 4  # times in a strip
STRIP_COLUMNS = 49  # points along the cable
GHOSTS = 9
GHOST_COLUMNS = 65
LIFT = 0.45  # height of the raised surface, of the cable's length


@dataclass(frozen=True)
class Look:
    """How the prediction is shown."""

    quantity: Quantity = QUANTITIES["time"]
    surface: SurfaceStyle = "on the table"
    ghosts: bool = True


class Picture:
    """The scene nodes of one client; every method runs on the viewer's event loop."""

    def __init__(self, client: ClientHandle, draft: Draft) -> None:
        self._client = client
        self._scene = client.scene
        self._look = Look()
        self._prediction: Prediction | None = None
        self._scale: ColourScale | None = None
        self._time = 0.0
        self._u = np.linspace(0.0, draft.cable.length, CABLE_SEGMENTS + 1)
        self._grippers: list[GripperPicture] = []
        self._drawn_for: Draft | None = None
        self._strips = [
            self._scene.add_mesh_simple(
                f"/surface/{k}",
                np.zeros((STRIP_ROWS * STRIP_COLUMNS, 3)),
                geometry.strip_faces(STRIP_ROWS, STRIP_COLUMNS),
                color=colour((k + 0.5) / STRIPS),
                opacity=0.34,
                side="double",
                cast_shadow=False,
                receive_shadow=False,
            )
            for k in range(STRIPS)
        ]
        self._obstacles = ObstaclesPicture(self._scene)
        self._add_table(draft)

    def _add_table(self, draft: Draft) -> None:
        """Draw the table: its surface lies half a diameter below the centreline of a cable lying on it."""
        self._table = self._scene.add_grid(
            "/table",
            width=5.0,
            height=5.0,
            position=(0.5, 0.0, draft.table_height - 0.5 * draft.cable.diameter - 1e-3),
            cell_size=0.1,
            cell_thickness=0.6,
            cell_color=STEEL,
            section_size=0.5,
            section_thickness=0.9,
            section_color=STEEL,
            plane_color=STEEL,
            plane_opacity=0.10,
            shadow_opacity=0.34,
            fade_distance=2.4,
            fade_strength=1.2,
            fade_from="origin",
        )

    def show(self, draft: Draft, prediction: Prediction) -> ColourScale:
        """Draw a new prediction of `draft`; return the scale of the colours."""
        self._prediction = prediction
        self._scale = ColourScale.of(self._look.quantity, prediction.surface)
        if self._drawn_for is None or self._drawn_for.cable != draft.cable or len(self._grippers) != len(draft.grasps):
            self._rebuild(draft)
        self._drawn_for = draft
        for gripper, grasp in zip(self._grippers, prediction.grasps, strict=True):
            gripper.take(prediction, grasp)
        self._obstacles.show(prediction.scene.environment.obstacles)
        self._draw_strips()
        self._draw_ghosts()
        self.pose(min(self._time, prediction.surface.horizon))
        return self._scale

    def _rebuild(self, draft: Draft) -> None:
        """Make the nodes anew whose size depends on the cable or on the number of grippers."""
        diameter, length = draft.cable.diameter, draft.cable.length
        self._u = np.linspace(0.0, length, CABLE_SEGMENTS + 1)
        straight = np.column_stack([self._u, np.zeros_like(self._u), np.zeros_like(self._u)])
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
        for gripper in self._grippers:
            gripper.remove()
        self._grippers = [GripperPicture(self._scene, k, diameter, length) for k in range(len(draft.grasps))]
        self._table.position = np.array([0.5 * length, 0.0, draft.table_height - 0.5 * diameter - 1e-3])

    def restyle(self, look: Look) -> ColourScale | None:
        """Show the same prediction in another way; return the scale of the colours, if there is a prediction."""
        self._look = look
        if self._prediction is None:
            return None
        self._scale = ColourScale.of(look.quantity, self._prediction.surface)
        self._draw_strips()
        self._draw_ghosts()
        self.pose(self._time)
        return self._scale

    def pose(self, time: float) -> None:
        """Show the cable and its grippers at `time` [s]."""
        self._time = time
        if self._prediction is None or self._scale is None:
            return
        surface, t = self._prediction.surface, np.array([time])
        centres, wxyz = geometry.segment_poses(surface.positions(self._u, t)[0])
        self._cable.batched_positions = centres.astype(np.float32)
        self._cable.batched_wxyzs = wxyz.astype(np.float32)
        self._cable.batched_colors = self._scale.colours(surface, 0.5 * (self._u[1:] + self._u[:-1]), t)[0]
        for gripper in self._grippers:
            gripper.pose(time)

    def _height(self, t: Floats) -> Floats:
        """Height at which the instants `t` are drawn above where they happen [m]."""
        assert self._prediction is not None
        surface = self._prediction.surface
        return (LIFT * surface.length if self._look.surface == "raised with time" else 0.0) * t / surface.horizon

    def _draw_strips(self) -> None:
        assert self._prediction is not None
        surface = self._prediction.surface
        raised = self._look.surface == "raised with time"
        t = np.linspace(0.0, surface.horizon, STRIPS * (STRIP_ROWS - 1) + 1)
        points = surface.positions(np.linspace(0.0, surface.length, STRIP_COLUMNS), t)
        points[..., 2] += self._height(t)[:, None]
        radius = 0.5 * self._prediction.scene.cable.diameter
        for k, strip in enumerate(self._strips):
            rows = points[k * (STRIP_ROWS - 1) : k * (STRIP_ROWS - 1) + STRIP_ROWS].copy()
            if not raised:
                # strips that lie on each other must not be coplanar: later ones a little higher, all below the cable
                rows[..., 2] -= radius * (1.0 - 0.9 * k / STRIPS)
            strip.vertices = rows.reshape(-1, 3).astype(np.float32)
            strip.color = colour((k + 0.5) / STRIPS) if self._look.quantity.name == "time" else STEEL
            strip.visible = self._look.surface != "hidden"

    def _draw_ghosts(self) -> None:
        assert self._prediction is not None
        assert self._scale is not None
        self._ghosts.visible = self._look.ghosts
        if not self._look.ghosts:
            return
        surface = self._prediction.surface
        t = np.linspace(0.0, surface.horizon, GHOSTS)
        u = np.linspace(0.0, surface.length, GHOST_COLUMNS)
        points = surface.positions(u, t)
        points[..., 2] += self._height(t)[:, None]
        colours = self._scale.colours(surface, u, t)
        self._ghosts.points = np.concatenate([geometry.segments(row) for row in points]).astype(np.float32)
        self._ghosts.colors = np.concatenate([np.stack([row[:-1], row[1:]], axis=1) for row in colours])
