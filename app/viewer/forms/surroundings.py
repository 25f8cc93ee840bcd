"""The form of the surroundings: gravity, air drag, a table, obstacles."""

from typing import Any

import numpy as np
from viser import GuiApi, GuiEvent

from app.viewer import obstacle_edits
from app.viewer.draft import Draft
from app.viewer.edits import Edits
from app.viewer.forms.base import Form, add_vector, show_choice, show_if, show_value
from app.viewer.number_field import NumberField

NONE = "no obstacle"
ADDED = {"Cylinder": "cylinder", "Box": "box", "Sphere": "sphere", "Capsule": "capsule"}
FAR = 1e4  # m, limit of coordinates
ENVIRONMENT = ("environment",)
TABLE = ("environment", "table")


class SurroundingsForm(Form):
    """Edits the environment."""

    def __init__(self, gui: GuiApi, draft: Draft, edits: Edits) -> None:
        super().__init__(draft, edits)
        self._chosen = 0
        with gui.add_folder("Surroundings"):
            self._table = gui.add_checkbox("Table", initial_value=True)
            self._height = NumberField(gui, "Table height [m]", 0.0, low=-FAR, high=FAR)
            self._friction = NumberField(gui, "Table friction", 0.0, low=0.0, high=10.0)
            self._drag = NumberField(gui, "Drag [N s/m²]", 0.0, low=0.0, high=1e6)
            with gui.add_folder("More of the surroundings", expand_by_default=False):
                self._quadratic = NumberField(gui, "Drag [N s²/m³]", 0.0, low=0.0, high=1e6)
                self._gravity = add_vector(gui, "Gravity [m/s²]", (0.0, 0.0, -9.81), step=0.1)
        with gui.add_folder("Obstacles"):
            self._add = gui.add_button_group("Add", tuple(ADDED))
            self._which = gui.add_dropdown("Obstacle", (NONE,))
            self._centre = add_vector(gui, "Centre [m]", (0.0, 0.0, 0.0), step=0.01)
            self._radius = NumberField(gui, "Radius [mm]", 1.0, low=0.1, high=1e7)
            self._size = add_vector(gui, "Size [mm]", (1.0, 1.0, 1.0), step=1.0)
            self._long = NumberField(gui, "Length [mm]", 1.0, low=0.1, high=1e7)
            self._rough = NumberField(gui, "Obstacle friction", 0.0, low=0.0, high=10.0)
            self._remove = gui.add_button("Remove obstacle", color="gray")
        self._bind_controls()

    def _bind_controls(self) -> None:
        self._bind(self._table, lambda d: self._with_table(d, self._table.value))
        self._bind(self._height, lambda d: d.put((*TABLE, "height"), self._height.value))
        self._bind(self._friction, lambda d: d.put((*TABLE, "friction"), self._friction.value))
        self._bind(self._drag, lambda d: d.put((*ENVIRONMENT, "drag"), self._drag.value))
        self._bind(self._quadratic, lambda d: d.put((*ENVIRONMENT, "drag_quadratic"), self._quadratic.value))
        self._bind(self._gravity, lambda d: d.put((*ENVIRONMENT, "gravity"), [float(x) for x in self._gravity.value]))
        self._bind(self._centre, lambda d: obstacle_edits.moved(d, self._chosen, np.array(self._centre.value)))
        self._bind(self._radius, lambda d: obstacle_edits.changed(d, self._chosen, "radius", 1e-3 * self._radius.value))
        self._bind(
            self._size,
            lambda d: obstacle_edits.changed(d, self._chosen, "size", [1e-3 * float(x) for x in self._size.value]),
        )
        self._bind(self._long, lambda d: obstacle_edits.lengthened(d, self._chosen, 1e-3 * self._long.value))
        self._bind(self._rough, lambda d: obstacle_edits.changed(d, self._chosen, "friction", self._rough.value))

        self._on_click(self._add, self._with_new)
        self._on_click(self._remove, lambda d: obstacle_edits.removed(d, self._chosen))

        @self._which.on_update
        async def _chosen(event: GuiEvent[Any]) -> None:
            if event.client is not None and self._which.value in self._names(self._draft):
                chosen = self._names(self._draft).index(self._which.value)
                self._edits.finish()  # what was typed belongs to the previously chosen obstacle
                self._chosen = chosen
                self.take(self._draft)

    def _with_new(self, draft: Draft) -> Draft:
        self._chosen = len(obstacle_edits.obstacles(draft))
        return obstacle_edits.added(draft, ADDED[self._add.value])

    @staticmethod
    def _with_table(draft: Draft, wanted: bool) -> Draft:
        return draft.put(TABLE, {"height": 0.0, "friction": 0.0} if wanted else None)

    @staticmethod
    def _names(draft: Draft) -> tuple[str, ...]:
        return tuple(f"{k + 1}: {body['kind']}" for k, body in enumerate(obstacle_edits.obstacles(draft))) or (NONE,)

    def take(self, draft: Draft) -> None:
        """Show `draft`."""
        self._draft = draft
        table = draft.get(TABLE)
        show_value(self._table, table is not None)
        show_if(self._height, table is not None)
        show_if(self._friction, table is not None)
        show_value(self._height, float(draft.get((*TABLE, "height"), 0.0)))
        show_value(self._friction, float(draft.get((*TABLE, "friction"), 0.0)))
        show_value(self._drag, float(draft.get((*ENVIRONMENT, "drag"), 0.0)))
        show_value(self._quadratic, float(draft.get((*ENVIRONMENT, "drag_quadratic"), 0.0)))
        x, y, z = draft.get((*ENVIRONMENT, "gravity"), (0.0, 0.0, -9.81))
        show_value(self._gravity, (float(x), float(y), float(z)))
        self._take_obstacle(draft)

    def _take_obstacle(self, draft: Draft) -> None:
        bodies, names = obstacle_edits.obstacles(draft), self._names(draft)
        self._chosen = max(0, min(self._chosen, len(bodies) - 1))
        show_choice(self._which, names, names[self._chosen])
        body = bodies[self._chosen] if bodies else {}
        for control in (self._which, self._centre, self._rough, self._remove):
            show_if(control, bool(bodies))
        show_if(self._radius, "radius" in body)
        show_if(self._size, "size" in body)
        show_if(self._long, body.get("kind") in ("cylinder", "capsule"))
        if not bodies:
            return
        show_value(self._centre, tuple(round(float(x), 4) for x in obstacle_edits.centre(body)))
        show_value(self._rough, float(body.get("friction", 0.0)))
        if "radius" in body:
            show_value(self._radius, round(1e3 * body["radius"], 4))
        if "size" in body:
            show_value(self._size, tuple(round(1e3 * float(x), 4) for x in body["size"]))
        if body["kind"] in ("cylinder", "capsule"):
            show_value(self._long, round(1e3 * obstacle_edits.length(body), 4))
