"""The common parts of all forms: controls that show a draft and change it."""

from typing import Any

from viser import GuiApi, GuiEvent, GuiVector3Handle

from app.viewer.draft import Draft
from app.viewer.edits import Change, Edits

Vector = tuple[float, float, float]
DECIMALS = 4  # digits after the point in vector fields, where viser accepts and shows only those of the step


def add_vector(gui: GuiApi, label: str, value: Vector, *, step: float, **given: Any) -> GuiVector3Handle:
    """Add a field of three numbers; `step` is what its arrows add, and the rest is given to viser."""
    vector = gui.add_vector3(label, value, step=step, **given)
    vector.precision = DECIMALS
    return vector


def show_value(control: Any, value: Any) -> None:
    """Let a control show `value`, unless it already does."""
    if control.value != value:
        control.value = value


def show_choice(control: Any, options: tuple[str, ...], value: str) -> None:
    """Let a dropdown offer `options` and show `value`, unless it already does."""
    if tuple(control.options) != options:
        control.options = options
    show_value(control, value)


def show_if(control: Any, visible: bool) -> None:
    """Show or hide a control, unless it already is shown or hidden."""
    if control.visible != visible:
        control.visible = visible


def show_content(control: Any, content: str) -> None:
    """Let an HTML control show `content`, unless it already does."""
    if control.content != content:
        control.content = content


class Form:
    """Controls that show a draft and change it. Updates by the program do not count as edits by the user."""

    def __init__(self, draft: Draft, edits: Edits) -> None:
        self._draft = draft
        self._edits = edits

    def _bind(self, control: Any, change: Change) -> None:
        @control.on_update
        async def _edited(event: GuiEvent[Any]) -> None:
            if event.client is not None:
                self._edits.by(control, change)

    def _on_click(self, button: Any, change: Change) -> None:
        @button.on_click
        async def _clicked(_event: GuiEvent[Any]) -> None:
            self._edits.finish()
            self._edits.make(change)
