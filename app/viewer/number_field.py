"""A field of the panel for a number, in which one may write what viser's own field takes for another number."""

import re
from typing import Any

from viser import GuiApi

DIGITS = 7  # that are shown
MOST = 40  # characters of what is no number that are told
_NUMBER = re.compile(r"[+-]?([0-9]+([.,][0-9]*)?|[.,][0-9]+)(e[+-]?[0-9]+)?", re.IGNORECASE)


def read(text: str) -> float | None:
    """Return the number that a text is, as `0.5`, `0,5` or `1e-4`; None where it is none."""
    bare = text.strip().replace("−", "-")
    return float(bare.replace(",", ".")) if _NUMBER.fullmatch(bare) else None


def written(value: float) -> str:
    """Return a number in a few characters, as `0.5` or `1e-6`."""
    mantissa, e, exponent = f"{value + 0.0:.{DIGITS}g}".partition("e")
    return f"{mantissa}e{int(exponent)}" if e else mantissa


class NumberField:
    """A text field that holds a number of a range.

    viser's number field leaves out the `e` of `1e-4` and the comma of `0,5`, and puts what is out of range at its end,
    without a word.

    Args:
        gui: of the client.
        label: name of the number, and its unit in brackets.
        value: to begin with.
        low: smallest number that is allowed.
        high: the largest, which may change.
        hint: shown on hover.
    """

    def __init__(
        self, gui: GuiApi, label: str, value: float, *, low: float, high: float, hint: str | None = None
    ) -> None:
        self.label = label
        self._low, self.high = low, high
        self._value = value
        self._field: Any = gui.add_text(label, written(value), hint=hint)
        self.on_update = self._field.on_update

    @property
    def value(self) -> float:
        """The number that it holds, whatever is being typed."""
        return self._value

    @value.setter
    def value(self, value: float) -> None:
        self._value = value
        typed = self._typed
        if typed is None or written(typed) != written(value):  # else it is shown as it was typed
            self._field.value = written(value)

    @property
    def visible(self) -> bool:
        """Whether it is shown."""
        return self._field.visible

    @visible.setter
    def visible(self, visible: bool) -> None:
        self._field.visible = visible

    @property
    def unclear(self) -> bool:
        """Whether what was typed is no number that is allowed, or not yet."""
        return self._typed is None

    def settle(self) -> str:
        """Hold what was typed; where that is not allowed, show again what is held, and say what is allowed."""
        typed = self._typed
        if typed is not None:
            self._value = typed
            return ""
        given = self._field.value.strip()[:MOST] or "nothing"
        self._field.value = written(self._value)
        return f"Got {given}, allowed: a number from {written(self._low)} to {written(self.high)}."

    @property
    def _typed(self) -> float | None:
        """The allowed number that stands in the field, if there is one."""
        number = read(self._field.value)
        return number if number is not None and self._low <= number <= self.high else None
