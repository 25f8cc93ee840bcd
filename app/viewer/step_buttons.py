"""Undo and redo, by button and by key."""

from collections.abc import Callable
from typing import Any

from viser import GuiApi, GuiEvent

UNDO, REDO = "Undo", "Redo"


class StepButtons:
    """Two buttons next to each other, and their usual keys.

    Args:
        gui: the client's GUI.
        back: undoes the last change.
        forward: redoes it.
    """

    def __init__(self, gui: GuiApi, back: Callable[[], None], forward: Callable[[], None]) -> None:
        self._group = gui.add_button_group("Changes", (UNDO, REDO), hint="Ctrl+Z: undo; Ctrl+Shift+Z: redo")
        by_key = (
            (gui.add_command(f"{UNDO} the last change", hotkey="Z", modifier="cmd/ctrl"), back),
            (gui.add_command(f"{REDO} the last change", hotkey="Z", modifier="cmd/ctrl+shift"), forward),
        )

        @self._group.on_click
        async def _stepped(_event: GuiEvent[Any]) -> None:
            (back if self._group.value == UNDO else forward)()

        for command, step in by_key:

            @command.on_trigger
            async def _pressed(_event: Any, step: Callable[[], None] = step) -> None:
                step()
