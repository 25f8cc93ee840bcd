"""Small SVG plots for the panel: they stay sharp, follow the light or dark theme, and load nothing."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape

import numpy as np

from app import svg

WIDTH, HEIGHT = 300, 190
LEFT, RIGHT, TOP, BOTTOM = 44, 14, 8, 34
_POWERS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True, kw_only=True)
class Series:
    """Points of a plot.

    Attributes:
        name: name in the legend.
        points: (x, y) of each point.
        colour: CSS colour.
        line: whether to join the points.
        size: radius of the dots [px].
        titles: shown on hover, one for each point, or none.
    """

    name: str
    points: Sequence[tuple[float, float]]
    colour: str
    line: bool = True
    size: float = 2.5
    titles: Sequence[str] = ()


@dataclass(frozen=True)
class Axis:
    """An axis from `low` to `high`; powers of ten if it is logarithmic."""

    label: str
    low: float
    high: float
    log: bool

    @staticmethod
    def of(label: str, values: Sequence[float], *, log: bool) -> "Axis":
        """Return an axis that spans `values`: in whole decades if logarithmic, else from smallest to largest."""
        low, high = min(values), max(values)
        if not log:
            return Axis(label, low, max(high, low + 1.0), log)
        first, last = math.floor(math.log10(low) + 1e-9), math.ceil(math.log10(high) - 1e-9)
        return Axis(label, float(first), float(max(last, first + 1)), log)

    def place(self, value: float) -> float:
        """Return the position of a value on the axis, 0 to 1."""
        return ((math.log10(value) if self.log else value) - self.low) / (self.high - self.low)

    def ticks(self) -> list[tuple[float, str]]:
        """Return the positions, 0 to 1, and the labels of at most seven ticks."""
        step = max(1, math.ceil((self.high - self.low) / 6))
        marks = np.arange(math.ceil(self.low), math.floor(self.high) + 1, step)
        return [((k - self.low) / (self.high - self.low), self._text(int(k))) for k in marks]

    def _text(self, k: int) -> str:
        if not self.log:
            return str(k)
        if -2 <= k <= 3:
            return f"{10.0**k:g}"
        return f"10{str(k).translate(_POWERS)}"


def plot(x_label: str, y_label: str, series: Sequence[Series], *, log_x: bool, mark: str) -> str:
    """Return an SVG with a logarithmic y axis, or "" if no series has points.

    Args:
        x_label: quantity and unit.
        y_label: quantity and unit.
        series: what to draw, in this order; all values on a logarithmic axis must be positive.
        log_x: whether the x axis is logarithmic too.
        mark: name by which the plot can be found in the page.
    """
    drawn = [one for one in series if one.points]
    if not drawn:
        return ""
    x = Axis.of(x_label, [point[0] for one in drawn for point in one.points], log=log_x)
    y = Axis.of(y_label, [point[1] for one in drawn for point in one.points], log=True)
    parts = [*_frame(x, y), *(_series(one, x, y) for one in drawn)]
    legend = "".join(
        f'<span style="white-space: nowrap;"><span style="color: {one.colour};">●</span> {escape(one.name)}</span>'
        for one in drawn
        if one.name
    )
    return (
        f'<div style="margin: 0.3rem 0.5rem;" data-plot="{escape(mark, quote=True)}">'
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{escape(y_label)} against {escape(x_label)}" '
        f'style="width: 100%; display: block;" font-size="10" fill="currentColor" stroke="none">{"".join(parts)}</svg>'
        f'<div style="display: flex; flex-wrap: wrap; column-gap: 0.7rem; font-size: 0.72rem; padding-left: 0.4rem;">'
        f"{legend}</div></div>"
    )


def _at(x: Axis, y: Axis, point: tuple[float, float]) -> tuple[float, float]:
    across = LEFT + x.place(point[0]) * (WIDTH - LEFT - RIGHT)
    return across, HEIGHT - BOTTOM - y.place(point[1]) * (HEIGHT - TOP - BOTTOM)


def _frame(x: Axis, y: Axis) -> list[str]:
    right, bottom = WIDTH - RIGHT, HEIGHT - BOTTOM
    parts = []
    for place, text in x.ticks():
        across = LEFT + place * (right - LEFT)
        parts += [_rule((across, TOP), (across, bottom)), svg.text(across, bottom + 13, text, opacity=0.75)]
    for place, text in y.ticks():
        down = bottom - place * (bottom - TOP)
        parts += [_rule((LEFT, down), (right, down)), svg.text(LEFT - 5, down + 3, text, "end", opacity=0.75)]
    parts.append(svg.text(0.5 * (LEFT + right), HEIGHT - 5, x.label))
    parts.append(svg.upright(10, 0.5 * (TOP + bottom), y.label))
    return parts


def _rule(begin: tuple[float, float], end: tuple[float, float]) -> str:
    return svg.line([begin, end], "currentColor", 1.0, stroke_opacity=0.13)


def _series(one: Series, x: Axis, y: Axis) -> str:
    places = [_at(x, y, point) for point in one.points]
    titles = one.titles or [""] * len(places)
    parts = [svg.line(places, one.colour, 1.6)] if one.line and len(places) > 1 else []
    parts += [svg.dot(place, one.size, one.colour, title) for place, title in zip(places, titles, strict=True)]
    return "".join(parts)
