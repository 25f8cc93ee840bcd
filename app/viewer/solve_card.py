"""The card at the top of the panel with the state of the solve, and the button that stops or restarts it."""

from collections.abc import Callable
from typing import Any, Literal

import viser
from viser import GuiApi, GuiEvent

Offer = Literal["stop", "solve"]


class SolveCard:
    """The card, with at most one button below it.

    Args:
        gui: the client's GUI.
        html: the first content of the card.
        stop: stops the running solve.
        solve: solves the scene again after a stop.
    """

    def __init__(self, gui: GuiApi, html: str, stop: Callable[[], None], solve: Callable[[], None]) -> None:
        self._card = gui.add_html(html)
        stopping = gui.add_button("Stop", icon=viser.Icon.PLAYER_STOP, color="gray", visible=False)
        solving = gui.add_button("Solve it", icon=viser.Icon.PLAYER_PLAY, color="gray", visible=False)
        self._buttons = {"stop": stopping, "solve": solving}

        @stopping.on_click
        async def _stop(_event: GuiEvent[Any]) -> None:
            stop()

        @solving.on_click
        async def _solve(_event: GuiEvent[Any]) -> None:
            solve()

    def show(self, html: str, offer: Offer | None = None) -> None:
        """Show the state of the solve, and the button that is offered, if any."""
        self._card.content = html
        for name, button in self._buttons.items():
            if button.visible != (name == offer):
                button.visible = name == offer
