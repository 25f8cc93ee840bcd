"""What the plots of a study share: colours, markers, axes. Needs matplotlib."""

from collections.abc import Sequence
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator

from dlocore.study.record import Run

# Okabe-Ito, one colour per method in all plots of a study; static/style.css has those of the landing page's methods
COLOURS = {"march": "#0072B2", "spacetime": "#D55E00", "paper": "#CC79A7", "reference": "#009E73"}
MARKS = {"march": "o", "spacetime": "s", "paper": "^", "reference": "D"}
# one per set of effects and threshold; the first has the marker of the method
SET_MARKS = ("", "v", "P", "X", "*", "h")
DASHES: tuple[str | tuple[int, tuple[int, int]], ...] = ("-", "--", "-.", ":", (0, (1, 3)), (0, (5, 5)))
_LEAST = 3  # numbers on an axis


def name_of(run: Run, runs: Sequence[Run]) -> str:
    """Return the method of a run, with its set of effects and threshold if its study has several of them."""
    effects = f", effects {run.effects}" if len({other.effects for other in runs}) > 1 else ""
    several = len({other.delta for other in runs if other.method == run.method}) > 1
    return run.method + effects + (f", δ = {run.delta:g} m" if several else "")


def new_figure(width: float, height: float, rows: int = 1, columns: int = 1) -> tuple[Figure, list[Axes]]:
    """Return a figure of the given size in inches and its axes, row by row."""
    figure = Figure(figsize=(width, height))
    axes = figure.subplots(rows, columns, squeeze=False)
    figure.set_layout_engine("constrained")
    return figure, list(axes.ravel())


def write_decimals(*axes: Axis) -> None:
    """Write the numbers of logarithmic axes as decimals, at least three of them, and more if there is room."""
    for axis in axes:
        low, high = axis.get_view_interval()
        axis.set_major_formatter("{x:g}")
        axis.set_minor_locator(LogLocator(subs=range(2, 10)))
        choices = ((2, 5), range(2, 10)) if high < 300 * low else ((), (2, 5))
        between = next((digits for digits in choices if _numbers(low, high, digits) >= _LEAST), ())
        if _numbers(low, high, between) < _LEAST:  # the axis spans hardly more than one digit
            axis.set_major_locator(MaxNLocator(_LEAST + 1))
        axis.set_minor_formatter(FuncFormatter(partial(_between, between)))


def _numbers(low: float, high: float, digits: Sequence[int]) -> int:
    """Return how many numbers are between `low` and `high` if powers of ten times these digits are written."""
    powers = 10.0 ** np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1)
    at = np.outer(powers, (1, *digits))
    return int(((at >= low) & (at <= high)).sum())


def _between(shown: Sequence[int], x: float, position: int | None = None) -> str:
    return f"{x:g}" if any(np.isclose(x / 10 ** np.floor(np.log10(x)), digit) for digit in shown) else ""
