"""Draw the ground of the picture: the table, or without one a floor well below the cable."""

import math
from typing import Any

import numpy as np
from viser import SceneApi

from app.viewer.palette import STEEL
from dlocore import Prediction

FLOOR = 0.15  # of the cable's length, from its lowest point down to the floor


class Ground:
    """A grid that receives shadows: distinct for a table, faint for a floor, which the cable never touches."""

    def __init__(self, scene: SceneApi) -> None:
        self._scene = scene
        self._drawn: tuple[Any, ...] | None = None

    def show(self, prediction: Prediction) -> None:
        """Draw the ground of `prediction`, unless it is already drawn."""
        scene = prediction.scene
        length, table = scene.cable.length, scene.environment.table
        size = 10.0 ** math.floor(math.log10(length) + 0.31)  # a round cell: 0.1 m for cables of 0.5 to 5 m
        if table is not None:
            height = table.height - 0.5 * scene.cable.diameter - 1e-3 * size
        else:
            points = prediction.surface.positions(
                np.linspace(0.0, length, 17), np.linspace(0.0, prediction.surface.horizon, 9)
            )
            step = 0.1 * size  # rounded down, so that the floor does not follow every small edit
            height = step * math.floor((float(points[..., 2].min()) - FLOOR * length) / step)
        start = prediction.surface.positions([0.0, length], [0.0])[0]
        middle = np.round(start.mean(axis=0) / (0.5 * size)) * 0.5 * size
        drawn = (table is not None, size, round(height, 9), *middle[:2])
        if drawn == self._drawn:
            return
        self._drawn = drawn
        on_table = table is not None
        self._scene.add_grid(
            "/table",
            width=5.0 * size,
            height=5.0 * size,
            position=(float(middle[0]), float(middle[1]), height),
            cell_size=0.1 * size,
            cell_thickness=0.6,
            cell_color=STEEL,
            section_size=0.5 * size,
            section_thickness=0.9,
            section_color=STEEL,
            plane_color=STEEL,
            plane_opacity=0.10 if on_table else 0.03,
            shadow_opacity=0.34 if on_table else 0.2,
            fade_distance=2.4 * size,
            fade_strength=1.2,
            fade_from="origin",
        )
