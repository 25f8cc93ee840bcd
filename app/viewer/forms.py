"""The controls that edit a draft, in the units people use: mm, g/m, 10⁻³ N m²."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, get_args

from viser import GuiApi, GuiEvent

from app.viewer.draft import CableDraft, Draft, ObstacleKind, QualityDraft, QualityMode
from dlocore import PRESETS

OnEdit = Callable[[Draft], None]
CUSTOM = "own values"
REACH = 2.0  # m, of the target's coordinates


def show_value(control: Any, value: Any) -> None:
    """Let a control show `value`, unless it does."""
    if control.value != value:
        control.value = value


class Form:
    """Controls that show a draft and change it; a change by the program is not taken for one by a person."""

    def __init__(self, draft: Draft, on_edit: OnEdit) -> None:
        self._draft = draft
        self._on_edit = on_edit

    def _bind(self, control: Any, change: Callable[[Draft], Draft]) -> None:
        @control.on_update
        async def _edited(event: GuiEvent[Any]) -> None:
            if event.client is not None:
                self._on_edit(change(self._draft))


class GraspForm(Form):
    """Where the gripper holds the cable, where it goes, and how long it takes."""

    def __init__(self, gui: GuiApi, draft: Draft, on_edit: OnEdit) -> None:
        super().__init__(draft, on_edit)
        length, grasp = draft.cable.length, draft.grasps[0]
        self._u = gui.add_slider("Grasp u [m]", min=0.0, max=length, step=0.005, initial_value=grasp.u)
        self._target = gui.add_vector2(
            "Target x, y [m]", draft.target[:2], min=(-REACH, -REACH), max=(REACH, REACH), step=0.01
        )
        self._duration = gui.add_slider("Duration [s]", min=0.2, max=5.0, step=0.05, initial_value=draft.duration)
        self._held = gui.add_checkbox(
            "Hold the far end", initial_value=draft.end_is_held, hint="A second gripper holds the end u = L still"
        )
        self._bind(self._u, lambda d: self._regrasped(d, self._u.value))
        self._bind(self._target, lambda d: d.with_target(*self._target.value))
        self._bind(self._duration, lambda d: replace(d, duration=self._duration.value))
        self._bind(self._held, lambda d: d.with_held_end(self._held.value).with_target_in_reach())

    @staticmethod
    def _regrasped(draft: Draft, u: float) -> Draft:
        """Grasp at another `u` [m]; the displacement stays, so the target moves with it."""
        return draft.with_grasp(u=u)

    def take(self, draft: Draft) -> None:
        """Show `draft`."""
        self._draft = draft
        if self._u.max != draft.cable.length:
            self._u.max = draft.cable.length
        show_value(self._u, draft.grasps[0].u)
        show_value(self._target, (round(draft.target[0], 4), round(draft.target[1], 4)))
        show_value(self._duration, draft.duration)
        show_value(self._held, draft.end_is_held)


class CableForm(Form):
    """The cable and the air around it."""

    def __init__(self, gui: GuiApi, draft: Draft, on_edit: OnEdit) -> None:
        super().__init__(draft, on_edit)
        cable = draft.cable
        with gui.add_folder("Cable"):
            self._preset = gui.add_dropdown("Preset", (*PRESETS, CUSTOM), initial_value="paper")
            self._length = gui.add_number("Length [m]", cable.length, min=0.05, max=10.0, step=0.05)
            self._diameter = gui.add_number("Diameter [mm]", 1e3 * cable.diameter, min=0.2, max=60.0, step=0.1)
            self._density = gui.add_number("Density [g/m]", 1e3 * cable.linear_density, min=0.5, max=5e3, step=0.1)
            self._stiffness = gui.add_number(
                "EI [10⁻³ N m²]", 1e3 * cable.bending_stiffness, min=0.01, max=1e4, step=0.01
            )
            self._drag = gui.add_number("Drag [N s/m²]", draft.drag, min=0.0, max=5.0, step=0.005)
        self._bind(self._preset, self._with_preset)
        self._bind(self._length, lambda d: self._with(d, length=self._length.value))
        self._bind(self._diameter, lambda d: self._with(d, diameter=1e-3 * self._diameter.value))
        self._bind(self._density, lambda d: self._with(d, linear_density=1e-3 * self._density.value))
        self._bind(self._stiffness, lambda d: self._with(d, bending_stiffness=1e-3 * self._stiffness.value))
        self._bind(self._drag, lambda d: replace(d, drag=self._drag.value))

    @staticmethod
    def _with(draft: Draft, **values: float) -> Draft:
        return draft.with_cable(replace(draft.cable, **values))

    def _with_preset(self, draft: Draft) -> Draft:
        name = self._preset.value
        return draft if name == CUSTOM else draft.with_cable(CableDraft.preset(name))

    def take(self, draft: Draft) -> None:
        """Show `draft`, and the preset that it is, if it is one."""
        self._draft = draft
        cable = draft.cable
        show_value(self._preset, next((name for name in PRESETS if CableDraft.preset(name) == cable), CUSTOM))
        show_value(self._length, cable.length)
        show_value(self._diameter, round(1e3 * cable.diameter, 6))
        show_value(self._density, round(1e3 * cable.linear_density, 6))
        show_value(self._stiffness, round(1e3 * cable.bending_stiffness, 6))
        show_value(self._drag, draft.drag)


class SurroundingsForm(Form):
    """What the cable lies on, and what stands in its way."""

    def __init__(self, gui: GuiApi, draft: Draft, on_edit: OnEdit) -> None:
        super().__init__(draft, on_edit)
        obstacle = draft.obstacle
        with gui.add_folder("Table and obstacle"):
            self._friction = gui.add_number("Table friction", draft.table_friction, min=0.0, max=2.0, step=0.05)
            self._kind = gui.add_dropdown("Obstacle", get_args(ObstacleKind), initial_value=obstacle.kind)
            self._place = gui.add_vector2(
                "Obstacle x, y [m]", (obstacle.x, obstacle.y), min=(-REACH, -REACH), max=(REACH, REACH), step=0.01
            )
        self._bind(self._friction, lambda d: replace(d, table_friction=self._friction.value))
        self._bind(self._kind, lambda d: d.with_obstacle(kind=self._kind.value))
        self._bind(self._place, lambda d: d.with_obstacle(x=self._place.value[0], y=self._place.value[1]))

    def take(self, draft: Draft) -> None:
        """Show `draft`."""
        self._draft = draft
        obstacle = draft.obstacle
        show_value(self._friction, draft.table_friction)
        show_value(self._kind, obstacle.kind)
        show_value(self._place, (round(obstacle.x, 4), round(obstacle.y, 4)))
        if self._place.visible != (obstacle.kind != "none"):
            self._place.visible = obstacle.kind != "none"


class QualityForm(Form):
    """What accuracy or grid is asked for; only the numbers of the chosen way are shown."""

    def __init__(self, gui: GuiApi, draft: Draft, on_edit: OnEdit) -> None:
        super().__init__(draft, on_edit)
        quality = draft.quality
        with gui.add_folder("Quality"):
            self._mode = gui.add_dropdown("Ask for", get_args(QualityMode), initial_value=quality.mode)
            self._error = gui.add_number("Target error [mm]", 1e3 * quality.target_error, min=0.01, max=100.0, step=0.1)
            self._n_u = gui.add_slider("Points along n_u", min=5, max=65, step=1, initial_value=quality.n_u)
            self._n_t = gui.add_slider("Points in time n_t", min=5, max=129, step=1, initial_value=quality.n_t)
        self._bind(self._mode, lambda d: self._with(d, mode=self._mode.value))
        self._bind(self._error, lambda d: self._with(d, target_error=1e-3 * self._error.value))
        self._bind(self._n_u, lambda d: self._with(d, n_u=self._n_u.value))
        self._bind(self._n_t, lambda d: self._with(d, n_t=self._n_t.value))

    @staticmethod
    def _with(draft: Draft, **values: Any) -> Draft:
        return replace(draft, quality=replace(draft.quality, **values))

    def take(self, draft: Draft) -> None:
        """Show `draft`."""
        self._draft = draft
        quality: QualityDraft = draft.quality
        show_value(self._mode, quality.mode)
        show_value(self._error, round(1e3 * quality.target_error, 6))
        show_value(self._n_u, quality.n_u)
        show_value(self._n_t, quality.n_t)
        for control in (self._n_u, self._n_t):
            if control.visible != (quality.mode == "grid"):
                control.visible = quality.mode == "grid"
        if self._error.visible != (quality.mode == "target error"):
            self._error.visible = quality.mode == "target error"
