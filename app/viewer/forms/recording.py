"""The form of a recording of a tracked cable: open it, choose a window, identify the cable, keep it as a preset."""

from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Any

import viser
from viser import GuiApi, GuiEvent

from app.viewer import report
from app.viewer.forms.base import show_value

EXPLAINED = "Markers tracked along a cable that grippers move: .npz, or .csv with .json (see docs/identification.md)."


@dataclass(frozen=True, kw_only=True)
class RecordingActions:
    """What the form can have the session do.

    Attributes:
        open: open a file of this name and content.
        show: show the window of this number.
        identify: start or stop identifying the cable.
        keep: keep the cable as a preset of this name.
    """

    open: Callable[[str, bytes], Awaitable[None]]
    show: Callable[[int], None]
    identify: Callable[[], None]
    keep: Callable[[str], None]


class RecordingForm:
    """The controls of one client's recording.

    Args:
        gui: the client's GUI.
        actions: what the controls do.
    """

    def __init__(self, gui: GuiApi, actions: RecordingActions) -> None:
        upload = gui.add_upload_button("Open a recording …", hint=EXPLAINED, icon=viser.Icon.FOLDER_OPEN)
        self._said = gui.add_html(report.note(EXPLAINED, good=True))
        self._window = gui.add_dropdown("Window", ("1",), visible=False)
        self._identify = gui.add_button("Identify the cable", icon=viser.Icon.ADJUSTMENTS, disabled=True)
        self._found = gui.add_html("")
        self._name = gui.add_text("Name of the preset", "my cable", visible=False)
        self._keep = gui.add_button("Keep as a preset", icon=viser.Icon.BOOKMARK, color="gray", visible=False)

        @upload.on_upload
        async def _uploaded(_event: GuiEvent[Any]) -> None:
            await actions.open(upload.value.name, upload.value.content)

        @self._window.on_update
        async def _shown(event: GuiEvent[Any]) -> None:
            if event.client is not None:
                actions.show(int(self._window.value.split()[0]) - 1)

        @self._identify.on_click
        async def _identified(_event: GuiEvent[Any]) -> None:
            actions.identify()

        @self._keep.on_click
        async def _kept(_event: GuiEvent[Any]) -> None:
            actions.keep(self._name.value)

    def say(self, text: str, *, good: bool) -> None:
        """Show whether a file was opened, or a preset kept."""
        self._said.content = report.note(text, good=good)

    def take(self, windows: list[str]) -> None:
        """Offer the windows of the open recording; an empty list means that there is no recording in the scene."""
        if windows:
            self._window.options = tuple(windows)
            show_value(self._window, windows[0])
        self._window.visible = len(windows) > 1
        self._identify.disabled = not windows
        self.running(False)
        self.found("", keep=False)

    def running(self, running: bool) -> None:
        """Show whether a search is running."""
        self._identify.label = "Stop" if running else "Identify the cable"
        self._identify.icon = viser.Icon.PLAYER_STOP if running else viser.Icon.ADJUSTMENTS

    def found(self, html: str, *, keep: bool) -> None:
        """Show what has been found so far; offer to keep it if `keep`."""
        self._found.content = html
        self._name.visible = self._keep.visible = keep
