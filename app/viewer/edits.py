"""What a person edits: by a slider or a button at once, what is typed as soon as the typing rests."""

import asyncio
from collections.abc import Callable
from typing import Any

from viser import GuiTextHandle, GuiVector3Handle

from app.viewer.draft import Draft
from app.viewer.number_field import NumberField, written

REST = 0.4  # s without a keystroke, after which a number counts as typed
UNCLEAR = 1.6  # s more, after which what is no number that is allowed is not the beginning of one
TYPED = (NumberField, GuiTextHandle, GuiVector3Handle)  # what sends every keystroke
Change = Callable[[Draft], Draft]


class Edits:
    """Changes of the draft of one tab; every method runs on the viewer's event loop, so nothing is locked.

    What is typed passes through what nobody means: 0.5 through 0, 15 through 1. It waits until the typing rests, or
    until something else is done, which then finds it in the draft. What is then no number that is allowed is told.

    Args:
        draft: returns the draft.
        take: takes over an edited one, and shows it in all controls.
        tell: shows a notification of this title and text.
    """

    def __init__(
        self, draft: Callable[[], Draft], take: Callable[[Draft], None], tell: Callable[[str, str], object]
    ) -> None:
        self._draft = draft
        self._take = take
        self._tell = tell
        self._loop = asyncio.get_running_loop()
        self._typed: list[tuple[Any, Change]] = []  # the controls in which it was typed, and what they stand for
        self._timer: asyncio.TimerHandle | None = None

    def by(self, control: Any, change: Change) -> None:
        """Make the change that a control stands for: at once, or when the typing in it rests."""
        if isinstance(control, TYPED):
            if not any(control is other for other, _ in self._typed):
                self._typed.append((control, change))
            self.go_on()
        else:
            self.make(change)

    def go_on(self) -> None:
        """Wait anew where something is being typed: a keystroke came, which may leave the number as it was."""
        if self._typed:
            self._cancel()
            self._timer = self._loop.call_later(REST, self._rest)

    def _rest(self) -> None:
        """Take over what was typed, unless it may be the beginning of a number."""
        if any(isinstance(control, NumberField) and control.unclear for control, _ in self._typed):
            self._timer = self._loop.call_later(UNCLEAR, self.finish)
        else:
            self.finish()

    def make(self, change: Change) -> None:
        """Make a change at once, after what was typed before it.

        All are made before the draft is shown again, since they read controls, which then show the draft.
        """
        changes = [one for control, one in self._typed if self._settled(control)]
        self.close()
        draft = self._draft()
        for one in (*changes, change):
            draft = one(draft)
        self._take(draft)

    def _settled(self, control: Any) -> bool:
        """Return whether what was typed in a control can be taken over; tell where not."""
        words = control.settle() if isinstance(control, NumberField) else ""
        if words:
            self._tell(f"{control.label} is left at {written(control.value)}", words)
        return not words

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
