"""The user's edits: sliders and buttons take effect at once, typed values as soon as the typing pauses."""

import asyncio
from collections.abc import Callable
from typing import Any

from viser import GuiSliderHandle, GuiTextHandle, GuiVector3Handle

from app.viewer.draft import Draft
from app.viewer.number_field import NumberField, refused, written

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
        take: takes over an edited draft, and shows it in all controls if it is another one.
        show: shows the draft in all controls.
        tell: shows a notification with this title and text.
    """

    def __init__(
        self,
        draft: Callable[[], Draft],
        take: Callable[[Draft], None],
        show: Callable[[], None],
        tell: Callable[[str, str], object],
    ) -> None:
        self._draft = draft
        self._take = take
        self._show = show
        self._tell = tell
        self._loop = asyncio.get_running_loop()
        self._typed: list[tuple[Any, Change]] = []  # controls with typed values, and their changes
        self._timer: asyncio.TimerHandle | None = None

    def by(self, control: Any, change: Change) -> None:
        """Make the change of a control: at once, or when the typing in it pauses."""
        if isinstance(control, TYPED) or _beyond(control):
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
        if any(_unclear(control) for control, _ in self._typed):
            self._timer = self._loop.call_later(UNCLEAR, self.finish)
        else:
            self.finish()

    def make(self, change: Change) -> None:
        """Make a change at once, after those of values typed before it; notify the user of those that are not allowed.

        All changes are made before the draft is shown again, because they read the controls, and showing the draft
        overwrites those.
        """
        typed = [(control, one, _settle(control)) for control, one in self._typed]
        self.close()
        draft = self._draft()
        for one in (*(one for _, one, words in typed if not words), change):
            draft = one(draft)
        self._take(draft)
        if any(words for _, _, words in typed):
            self._show()
        for control, _, words in typed:
            if words:
                self._tell(f"{control.label} is left at {written(control.value)}", words)

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


def _unclear(control: Any) -> bool:
    """Return whether what is typed in a control is not, or not yet, an allowed number."""
    return control.unclear if isinstance(control, NumberField) else _beyond(control)


def _settle(control: Any) -> str:
    """Return "" if the typed value of a control can be taken over; otherwise what is allowed."""
    if isinstance(control, NumberField):
        return control.settle()
    return refused(written(control.value), control.min, control.max) if _beyond(control) else ""


def _beyond(control: Any) -> bool:
    """Return whether the number next to a slider is out of its range, as 0 may be while 0.5 is typed."""
    return isinstance(control, GuiSliderHandle) and not control.min <= control.value <= control.max
