"""The common parts of all forms: controls that show a draft and change it."""

from typing import Any

from viser import GuiEvent, GuiSliderHandle

from app.viewer.draft import Draft
from app.viewer.edits import Change, Edits


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
            if event.client is not None and not _beyond(control):
                self._edits.by(control, change)

    def _on_click(self, button: Any, change: Change) -> None:
        @button.on_click
        async def _clicked(_event: GuiEvent[Any]) -> None:
            self._edits.finish()
            self._edits.make(change)


def _beyond(control: Any) -> bool:
    """Return whether the number next to a slider is out of its range, as 0 is while 0.5 is typed."""
    return isinstance(control, GuiSliderHandle) and not control.min <= control.value <= control.max
