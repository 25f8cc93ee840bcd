"""A number field for the panel that reads notations which viser's own number field misreads."""

import re
from typing import Any

from viser import GuiApi

DIGITS = 7  # significant digits that are shown
MOST = 40  # most characters of an invalid input that an error repeats
_NUMBER = re.compile(r"[+-]?([0-9]+([.,][0-9]*)?|[.,][0-9]+)(e[+-]?[0-9]+)?", re.IGNORECASE)


def read(text: str) -> float | None:
    """Return the number in a text such as `0.5`, `0,5` or `1e-4`; None if it is no number."""
    bare = text.strip().replace("−", "-")
    return float(bare.replace(",", ".")) if _NUMBER.fullmatch(bare) else None


def written(value: float) -> str:
    """Return a number in a few characters, such as `0.5` or `1e-6`."""
    mantissa, e, exponent = f"{value + 0.0:.{DIGITS}g}".partition("e")
    return f"{mantissa}e{int(exponent)}" if e else mantissa


def refused(given: str, low: float, high: float) -> str:
    """Return what is allowed in place of what was given."""
    return f"Got {given}, allowed: a number from {written(low)} to {written(high)}."


class NumberField:
    """A text field that holds a number within a range.

    viser's number field drops the `e` of `1e-4` and the comma of `0,5`, and silently clips numbers to its range.

    Args:
        gui: the client's GUI.
        label: name of the number, with its unit in brackets.
        value: initial value.
        low: smallest allowed number.
        high: largest allowed number; it may change.
        hint: text shown on hover.
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
        """The number that the field holds, whatever is being typed."""
        return self._value

    @value.setter
    def value(self, value: float) -> None:
        self._value = value
        typed = self._typed
        if typed is None or written(typed) != written(value):  # otherwise leave it as it was typed
            self._field.value = written(value)

    @property
    def visible(self) -> bool:
        """Whether the field is shown."""
        return self._field.visible

    @visible.setter
    def visible(self, visible: bool) -> None:
        self._field.visible = visible

    @property
    def unclear(self) -> bool:
        """Whether the typed text is not, or not yet, an allowed number."""
        return self._typed is None

    def settle(self) -> str:
        """Take over the typed number and return ""; if it is not allowed, restore the old one and say what is."""
        typed = self._typed
        if typed is not None:
            self._value = typed
            return ""
        given = self._field.value.strip()[:MOST] or "nothing"
        self._field.value = written(self._value)
        return refused(given, self._low, self.high)

    @property
    def _typed(self) -> float | None:
        """The number shown in the field, if it is an allowed one."""
        number = read(self._field.value)
        return number if number is not None and self._low <= number <= self.high else None
