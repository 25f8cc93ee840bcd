"""Plots of the accuracy that a study measured: error against time, and the convergence of the iterations."""

from collections.abc import Sequence
from textwrap import fill
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from dlocore.accuracy.cost import pareto_front
from dlocore.study.record import Run, Study
from dlocore.study.style import COLOURS, DASHES, MARKS, SET_MARKS, name_of, new_figure, write_decimals

_TITLE = 62  # characters in a line of a panel's title
_CURVES = 3  # at most, for a legend on the axes: a longer one would hide some of them, and lies below
_GRIDS = ("#56B4E9", "#0072B2", "#009E73", "#E69F00", "#D55E00", "#CC79A7", "#000000")


def work_precision(study: Study) -> Figure:
    """Draw error against time, in the plane and in space, with the front and a slope.

    Each method has a curve for each set of effects and each threshold.
    """
    kinds = sorted({run.dimensions for run in study.runs})
    many = len({name_of(run, study.runs) for run in study.runs}) > _CURVES
    figure, panels = new_figure(6.2 * len(kinds), 7.0 if many else 5.0, 1, len(kinds))
    place: dict[str, Any] = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.13), "ncols": 2} if many else {}
    for axes, dimensions in zip(panels, kinds, strict=True):
        runs = [run for run in study.runs if run.dimensions == dimensions and run.error > 0]
        points = _work_precision_panel(axes, runs, study.runs)
        _front(axes, points)
        scenes = len({run.scene for run in runs})
        where = "in the plane" if dimensions == 2 else "in space"
        title = f"{where}, {scenes} scene{'s' if scenes > 1 else ''}: {_finding(points)}"
        axes.set_title(fill(title, _TITLE))
        axes.set(xscale="log", yscale="log", xlabel="time of a solve [ms]", ylabel="largest error [mm]")
        write_decimals(axes.xaxis, axes.yaxis)
        axes.grid(alpha=0.25, which="both", linewidth=0.5)
        axes.legend(fontsize=8, **place)
    return figure


class Point(NamedTuple):
    """A method with a set of effects and a threshold on a grid.

    It has the geometric means of time [ms] and error [mm] over the scenes, and the largest error [mm].
    """

    time: float
    error: float
    method: str
    grid: str
    largest: float


def _work_precision_panel(axes: Axes, runs: Sequence[Run], of: Sequence[Run]) -> list[Point]:
    """Draw every run faintly and the geometric mean over the scenes strongly; return the means of the solved runs.

    The marks and names are those of all panels, whose runs are `of`.
    """
    points: list[Point] = []
    sets = list(dict.fromkeys((run.effects, run.delta) for run in of))
    for method, effects, delta in dict.fromkeys((run.method, run.effects, run.delta) for run in runs):
        number = sets.index((effects, delta))
        colour, dashes = COLOURS[method], DASHES[number % len(DASHES)]
        mark = SET_MARKS[number % len(SET_MARKS)] or MARKS[method]
        mine = [run for run in runs if (run.method, run.effects, run.delta) == (method, effects, delta)]
        name = name_of(mine[0], of)
        good = [run for run in mine if run.status == "converged"]
        for run in mine:
            axes.errorbar(
                1e3 * run.wall_time, 1e3 * run.error, xerr=1e3 * min(run.spread, 0.9 * run.wall_time), fmt=mark,
                markersize=3.5, color=colour, alpha=0.3, elinewidth=1,
                markerfacecolor=colour if run.status == "converged" else "none",
            )  # fmt: skip
        curve = list[Point]()
        for grid in sorted({(run.n_u, run.n_t) for run in good}):
            group = [run for run in good if (run.n_u, run.n_t) == grid]
            if len({run.scene for run in group}) < len({run.scene for run in mine}):
                continue  # a mean over other scenes than its neighbours
            time, error = (
                float(np.exp(np.mean(np.log([1e3 * getattr(run, of_what) for run in group]))))
                for of_what in ("wall_time", "error")
            )
            largest = 1e3 * max(run.error for run in group)
            curve.append(Point(time, error, name, f"{grid[0]} × {grid[1]}", largest))
        if curve:
            means = zip(*[p[:2] for p in curve], strict=True)
            axes.plot(*means, marker=mark, linestyle=dashes, color=colour, label=name)
        if len(curve) < len(mine):
            axes.plot([], [], mark, color=colour, alpha=0.3, markersize=3.5, label=f"{name}, each scene")
        points += curve
    if any(run.status != "converged" for run in runs):
        axes.plot([], [], "o", color="#666666", markerfacecolor="none", markersize=3.5, label="open: did not converge")
    return points


def _front(axes: Axes, points: list[Point]) -> None:
    """Mark the Pareto front with its grids, and draw the slope that halving all spacings would give."""
    if not points:
        return
    times, errors = np.array([p.time for p in points]), np.array([p.error for p in points])
    front = pareto_front(times, errors)
    axes.plot(times[front], errors[front], color="#666666", linewidth=7, alpha=0.22, zorder=0, label="Pareto front")
    for k, i in enumerate(front):
        if k % max(1, len(front) // 5) == 0 or k == len(front) - 1:
            axes.annotate(points[i].grid, (times[i], errors[i]), (6, 5), textcoords="offset points", fontsize=8)
    first, below = times[front[0]], 0.5 * float(np.min(errors[front] * times[front] ** 2))
    x = first * np.array([1.0, min(4.0, max(1.5, times[front[-1]] / first))])
    axes.plot(x, below * x**-2.0, ":", color="black", linewidth=1.2, label="error ∝ time$^{-2}$")
    axes.margins(x=0.12)


def _finding(points: list[Point]) -> str:
    """Return the fastest way to an error of a millimetre in every scene, or how near the best one comes."""
    if not points:
        return "nothing converged"
    good = [p for p in points if p.largest <= 1.0]
    if not good:
        best = min(points, key=lambda p: p.largest)
        return f"at best {best.largest:.2g} mm, in {best.time:.2g} ms by {best.method}"
    fastest = min(good)
    return f"1 mm in {fastest.time:.2g} ms by {fastest.method}"


def _set_mark(number: int) -> str:
    return SET_MARKS[number % len(SET_MARKS)] or "o"


def convergence(study: Study) -> Figure:
    """Draw the update against the iteration, by scene, grid and set of effects: the paper's Fig. 2."""
    methods = [m for m in dict.fromkeys(run.method for run in study.runs) if m != "march"]
    figure, panels = new_figure(8.0 * len(methods), 4.8, 1, len(methods))
    for axes, method in zip(panels, methods, strict=True):
        runs = [run for run in study.runs if run.method == method]
        grids = sorted({(run.n_u, run.n_t) for run in runs})
        scenes = list(dict.fromkeys(run.scene for run in runs))
        sets = list(dict.fromkeys(run.effects for run in runs))
        for run in runs:
            updates = [step.update if step.update is not None else np.nan for step in run.iterations]
            colour = _GRIDS[grids.index((run.n_u, run.n_t)) % len(_GRIDS)]
            style = DASHES[scenes.index(run.scene) % len(DASHES)]
            axes.semilogy(
                range(1, len(updates) + 1),
                updates,
                marker=_set_mark(sets.index(run.effects)),
                markersize=3 if run.effects == sets[0] else 5,
                color=colour,
                linestyle=style,
                linewidth=1.2,
            )
        for k, (n_u, n_t) in enumerate(grids):
            axes.plot([], [], "o-", color=_GRIDS[k % len(_GRIDS)], label=f"{n_u} × {n_t}")
        for k, effects in enumerate(sets if len(sets) > 1 else []):
            axes.plot([], [], _set_mark(k), color="black", label=f"effects {effects}")
        if len(scenes) <= len(DASHES):
            for scene, style in zip(scenes, DASHES, strict=False):
                axes.plot([], [], color="black", linestyle=style, linewidth=1.2, label=scene)
        for delta in sorted({run.delta for run in runs}):
            axes.axhline(delta, color="grey", linewidth=1)
            axes.annotate(f"δ = {delta:g} m", (1.0, delta), (-2, 3), xycoords=("axes fraction", "data"),
                          textcoords="offset points", ha="right", fontsize=8, color="grey")  # fmt: skip
        counts = [len(run.iterations) for run in runs if run.status == "converged"]
        range_ = f"in {min(counts)} to {max(counts)} iterations (median {np.median(counts):g})" if counts else ""
        axes.set_title(f"{method}: {len(counts)} of {len(runs)} solves converge {range_}")
        axes.set(xlabel="iteration", ylabel="norm of the control-point update [m]")
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        axes.grid(alpha=0.25)
        axes.legend(fontsize=7.5, handlelength=3.5, loc="upper left", bbox_to_anchor=(1.0, 1.0))
    return figure
