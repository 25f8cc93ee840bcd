"""The user's edits: sliders and buttons take effect at once, typed values as soon as the typing pauses."""

import asyncio
from collections.abc import Callable
from typing import Any

from viser import GuiTextHandle, GuiVector3Handle

from app.viewer.draft import Draft
from app.viewer.number_field import NumberField, written

REST = 0.4  # s without a keystroke after which a number counts as typed
UNCLEAR = 1.6  # further s after which an invalid number no longer counts as the beginning of a valid one
TYPED = (NumberField, GuiTextHandle, GuiVector3Handle)  # controls that send every keystroke
Change = Callable[[Draft], Draft]


class Edits:
    """Changes to the draft of one tab. Every method runs on the viewer's event loop, so no locks are needed.

    While a number is typed, the field holds other numbers that nobody means: 0 on the way to 0.5, 1 on the way to 15.
    So a typed value is taken over only when the typing pauses, or before anything else is done. If it is not an allowed
    number by then, the user is notified.

    Args:
        draft: returns the draft.
        take: takes over an edited draft, and shows it in all controls.
        tell: shows a notification with this title and text.
    """

    def __init__(
        self, draft: Callable[[], Draft], take: Callable[[Draft], None], tell: Callable[[str, str], object]
    ) -> None:
        self._draft = draft
        self._take = take
        self._tell = tell
        self._loop = asyncio.get_running_loop()
        self._typed: list[tuple[Any, Change]] = []  # controls with typed values, and their changes
        self._timer: asyncio.TimerHandle | None = None

    def by(self, control: Any, change: Change) -> None:
        """Make the change of a control: at once, or when the typing in it pauses."""
        if isinstance(control, TYPED):
            if not any(control is other for other, _ in self._typed):
                self._typed.append((control, change))
            self.go_on()
        else:
            self.make(change)

    def go_on(self) -> None:
        """Restart the wait if something is being typed: there was a keystroke, perhaps one that changed no number."""
        if self._typed:
            self._cancel()
            self._timer = self._loop.call_later(REST, self._rest)

    def _rest(self) -> None:
        """Take over typed values, unless one may be the beginning of a number."""
        if any(isinstance(control, NumberField) and control.unclear for control, _ in self._typed):
            self._timer = self._loop.call_later(UNCLEAR, self.finish)
        else:
            self.finish()

    def make(self, change: Change) -> None:
        """Make a change at once, after those of values typed before it.

        All changes are made before the draft is shown again, because they read the controls, and showing the draft
        overwrites those.
        """
        changes = [one for control, one in self._typed if self._settled(control)]
        self.close()
        draft = self._draft()
        for one in (*changes, change):
            draft = one(draft)
        self._take(draft)

    def _settled(self, control: Any) -> bool:
        """Return whether the typed value of a control can be taken over; notify the user if not."""
        words = control.settle() if isinstance(control, NumberField) else ""
        if words:
            self._tell(f"{control.label} is left at {written(control.value)}", words)
        return not words

    def finish(self) -> None:
        """Take over what has been typed so far."""
        if self._typed:
            self.make(lambda draft: draft)

    def close(self) -> None:
        """Drop what is being typed."""
        self._cancel()
        self._typed = []

    def _cancel(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
