"""What the plots of a study share: colours, marks, axes. Needs matplotlib."""

from collections.abc import Sequence
from functools import partial

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator

# Okabe-Ito, one colour a method everywhere
COLOURS = {"march": "#0072B2", "spacetime": "#D55E00", "paper": "#CC79A7", "reference": "#009E73"}
MARKS = {"march": "o", "spacetime": "s", "paper": "^", "reference": "D"}


def new_figure(width: float, height: float, rows: int = 1, columns: int = 1) -> tuple[Figure, list[Axes]]:
    """Return a figure of so many inches and its axes, row by row; the caption has its place at the bottom."""
    figure = Figure(figsize=(width, height))
    axes = figure.subplots(rows, columns, squeeze=False)
    figure.set_layout_engine("constrained", rect=(0.0, 0.03, 1.0, 0.97))
    return figure, list(axes.ravel())


def write_decimals(axes: Axes, *, only_y: bool = False) -> None:
    """Write the numbers of logarithmic axes as decimals, those between the powers of ten where there is room."""
    for axis in (axes.yaxis,) if only_y else (axes.xaxis, axes.yaxis):
        low, high = axis.get_view_interval()
        axis.set_major_formatter("{x:g}")
        between = (2.0, 5.0) if high < 300 * low else ()
        axis.set_minor_locator(LogLocator(subs=range(2, 10)))
        axis.set_minor_formatter(FuncFormatter(partial(_between, between)))


def _between(shown: Sequence[float], x: float, position: int | None = None) -> str:
    return f"{x:g}" if any(np.isclose(x / 10 ** np.floor(np.log10(x)), digit) for digit in shown) else ""
