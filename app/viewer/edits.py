"""What a person edits: by a slider or a button at once, what is typed as soon as the typing rests."""

import asyncio
from collections.abc import Callable
from typing import Any

from viser import GuiNumberHandle, GuiTextHandle, GuiVector3Handle

from app.viewer.draft import Draft

REST = 0.4  # s without a keystroke, after which a number counts as typed
TYPED = (GuiNumberHandle, GuiTextHandle, GuiVector3Handle)  # what sends every keystroke
Change = Callable[[Draft], Draft]


class Edits:
    """Changes of the draft of one tab; every method runs on the viewer's event loop, so nothing is locked.

    What is typed passes through what nobody means: 0.5 through 0, 15 through 1. It waits until the typing rests, or
    until something else is done, which then finds it in the draft.

    Args:
        draft: returns the draft.
        take: takes over an edited one, and shows it in all controls.
    """

    def __init__(self, draft: Callable[[], Draft], take: Callable[[Draft], None]) -> None:
        self._draft = draft
        self._take = take
        self._loop = asyncio.get_running_loop()
        self._typed: list[Change] = []
        self._timer: asyncio.TimerHandle | None = None

    def by(self, control: Any, change: Change) -> None:
        """Make the change that a control stands for: at once, or when the typing in it rests."""
        if isinstance(control, TYPED):
            if change not in self._typed:
                self._typed.append(change)
            self.go_on()
        else:
            self.make(change)

    def go_on(self) -> None:
        """Wait anew where something is being typed: a keystroke came, which may leave the number as it was."""
        if self._typed:
            self._cancel()
            self._timer = self._loop.call_later(REST, self.finish)

    def make(self, change: Change) -> None:
        """Make a change at once, after what was typed before it.

        All are made before the draft is shown again, since they read controls, which then show the draft.
        """
        changes = [*self._typed, change]
        self.close()
        draft = self._draft()
        for one in changes:
            draft = one(draft)
        self._take(draft)

    def finish(self) -> None:
        """Take over what was typed until now."""
        if self._typed:
            self.make(lambda draft: draft)

    def close(self) -> None:
        """Forget what is being typed."""
        self._cancel()
        self._typed = []

    def _cancel(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
