"""Draw a study: error against time, convergence, time by phase and effect, cost against size. Needs matplotlib."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from dlocore.cost import exponent, pareto_front
from dlocore.study.record import Run, Scaled, Study

# Okabe-Ito, one colour a method everywhere
COLOURS = {"march": "#0072B2", "spacetime": "#D55E00", "paper": "#CC79A7", "reference": "#009E73"}
MARKS = {"march": "o", "spacetime": "s", "paper": "^", "reference": "D"}
_GRIDS = ("#56B4E9", "#0072B2", "#009E73", "#E69F00", "#D55E00", "#CC79A7", "#000000")
_PHASES = {
    "setup": "#999999",
    "march": "#0072B2",
    "fit": "#56B4E9",
    "spacetime": "#D55E00",
    "paper": "#CC79A7",
    "estimate": "#009E73",
    "report": "#F0E442",
}
_DPI = 110


def draw_all(study: Study, folder: Path, command: str = "dlo study") -> list[Path]:
    """Draw every plot that a study has the measurements for, and return the files.

    Args:
        study: what was measured.
        folder: where the pictures go; made where it does not exist.
        command: what the captions name as the command.
    """
    folder.mkdir(parents=True, exist_ok=True)
    plots: dict[str, tuple[Callable[[Study], Figure], bool]] = {
        "work-precision": (work_precision, bool(study.runs)),
        "convergence": (convergence, any(run.method != "march" for run in study.runs)),
        "phases": (phases, bool(study.runs)),
        "effects": (effect_costs, bool(study.effects)),
        "scaling": (scaling, bool(study.scaling)),
    }
    files = []
    with mpl.rc_context({"font.size": 10, "axes.titlesize": 11, "axes.spines.top": False, "axes.spines.right": False}):
        for name, (draw, possible) in plots.items():
            if not possible:
                continue
            figure = draw(study)
            _caption(figure, study, command)
            file = folder / f"{name}.png"
            figure.savefig(file, dpi=_DPI)
            files.append(file)
    return files


def _caption(figure: Figure, study: Study, command: str) -> None:
    machine = ", ".join([study.machine["processor"], f"Python {study.machine.get('Python', '?')}"])
    day = study.measured_at.replace("T", " ").replace("Z", " UTC")
    text = f"{command}; {machine}; {day}; program {study.source}; one thread, time on a core of its own"
    figure.text(0.995, 0.008, text, ha="right", va="bottom", fontsize=7, color="#666666")


def _figure(width: float, height: float, rows: int = 1, columns: int = 1) -> tuple[Figure, list[Axes]]:
    figure = Figure(figsize=(width, height))
    axes = figure.subplots(rows, columns, squeeze=False)
    figure.set_layout_engine("constrained", rect=(0.0, 0.03, 1.0, 0.97))
    return figure, list(axes.ravel())


def work_precision(study: Study) -> Figure:
    """Draw error against time, in the plane and in space: one curve a method, the front, and a slope."""
    kinds = sorted({run.dimensions for run in study.runs})
    figure, panels = _figure(6.2 * len(kinds), 5.0, 1, len(kinds))
    for axes, dimensions in zip(panels, kinds, strict=True):
        runs = [run for run in study.runs if run.dimensions == dimensions and run.error > 0]
        points = _work_precision_panel(axes, runs)
        _front(axes, points)
        scenes = len({run.scene for run in runs})
        where = "in the plane" if dimensions == 2 else "in space"
        axes.set_title(f"{where}, {scenes} scene{'s' if scenes > 1 else ''}: {_finding(points)}")
        axes.set(xscale="log", yscale="log", xlabel="time of a solve [ms]", ylabel="largest error [mm]")
        _decimal(axes)
        axes.grid(alpha=0.25, which="both", linewidth=0.5)
        axes.legend(fontsize=8)
    return figure


Point = tuple[float, float, str, str]  # time [ms], error [mm], method, grid


def _work_precision_panel(axes: Axes, runs: Sequence[Run]) -> list[Point]:
    """Draw every run faintly and the geometric mean over the scenes strongly; return the means of what was solved."""
    points: list[Point] = []
    for method in dict.fromkeys(run.method for run in runs):
        colour, mark = COLOURS[method], MARKS[method]
        mine = [run for run in runs if run.method == method]
        good = [run for run in mine if run.status == "converged"]
        for run in mine:
            axes.errorbar(
                1e3 * run.wall_time, 1e3 * run.error, xerr=1e3 * min(run.spread, 0.9 * run.wall_time), fmt=mark,
                markersize=3.5, color=colour, alpha=0.3, elinewidth=1,
                markerfacecolor=colour if run.status == "converged" else "none",
            )  # fmt: skip
        curve = []
        for grid in sorted({(run.n_u, run.n_t) for run in good}):
            group = [run for run in good if (run.n_u, run.n_t) == grid]
            if len({run.scene for run in group}) < len({run.scene for run in mine}):
                continue  # a mean over other scenes than its neighbours'
            time, error = (
                float(np.exp(np.mean(np.log([1e3 * getattr(run, name) for run in group]))))
                for name in ("wall_time", "error")
            )
            curve.append((time, error, method, f"{grid[0]} × {grid[1]}"))
        axes.plot(*zip(*[p[:2] for p in curve], strict=True), mark + "-", color=colour, label=method) if curve else None
        if len(curve) < len(mine):
            axes.plot([], [], mark, color=colour, alpha=0.3, markersize=3.5, label=f"{method}, each scene")
        points += curve
    return points


def _front(axes: Axes, points: list[Point]) -> None:
    """Mark the Pareto front with the grids on it, and draw the slope that halving every spacing would give."""
    if not points:
        return
    times, errors = np.array([p[0] for p in points]), np.array([p[1] for p in points])
    front = pareto_front(times, errors)
    axes.plot(times[front], errors[front], color="#666666", linewidth=7, alpha=0.22, zorder=0, label="Pareto front")
    for k, i in enumerate(front):
        if k % max(1, len(front) // 5) == 0 or k == len(front) - 1:
            axes.annotate(points[i][3], (times[i], errors[i]), (6, 5), textcoords="offset points", fontsize=8)
    x = np.array([times[front[0]], times[front[-1]]])
    if len(front) > 1 and x[1] > 1.2 * x[0]:
        middle = len(front) // 2
        y = 0.35 * errors[front[middle]] * (x / times[front[middle]]) ** -2.0
        axes.plot(x, y, ":", color="black", linewidth=1, label="error ∝ time$^{-2}$")


def _finding(points: list[Point]) -> str:
    """Return what the front says: the method that is on it, and the fastest way to a millimetre."""
    if not points:
        return "nothing converged"
    good = [p for p in points if p[1] <= 1.0]
    if not good:
        best = min(points, key=lambda p: p[1])
        return f"at best {best[1]:.2g} mm, in {best[0]:.2g} ms by {best[2]}"
    fastest = min(good)
    return f"1 mm in {fastest[0]:.2g} ms by {fastest[2]}"


def convergence(study: Study) -> Figure:
    """Draw the update against the iteration, by scene and grid: the paper's Fig. 2."""
    methods = [m for m in dict.fromkeys(run.method for run in study.runs) if m != "march"]
    figure, panels = _figure(6.8 * len(methods), 4.8, 1, len(methods))
    for axes, method in zip(panels, methods, strict=True):
        runs = [run for run in study.runs if run.method == method]
        grids = sorted({(run.n_u, run.n_t) for run in runs})
        scenes = list(dict.fromkeys(run.scene for run in runs))
        styles: tuple[Any, ...] = ("-", "--", "-.", ":", (0, (1, 3)), (0, (5, 5)))
        for run in runs:
            updates = [step.update if step.update is not None else np.nan for step in run.iterations]
            colour = _GRIDS[grids.index((run.n_u, run.n_t)) % len(_GRIDS)]
            style = styles[scenes.index(run.scene) % len(styles)]
            axes.semilogy(
                range(1, len(updates) + 1),
                updates,
                marker="o",
                markersize=3,
                color=colour,
                linestyle=style,
                linewidth=1.2,
            )
        for k, (n_u, n_t) in enumerate(grids):
            axes.plot([], [], "o-", color=_GRIDS[k % len(_GRIDS)], label=f"{n_u} × {n_t}")
        if len(scenes) <= len(styles):
            for scene, style in zip(scenes, styles, strict=False):
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
        axes.legend(fontsize=7.5, ncols=2)
    return figure


def phases(study: Study) -> Figure:
    """Draw the time by phase, stacked, for each method and grid; the median over the scenes."""
    rows = []
    for method in dict.fromkeys(run.method for run in study.runs):
        for grid in sorted({(run.n_u, run.n_t) for run in study.runs if run.method == method}):
            group = [run for run in study.runs if run.method == method and (run.n_u, run.n_t) == grid]
            rows.append((f"{method}  {grid[0]} × {grid[1]}", group))
    figure, (axes,) = _figure(8.6, 1.4 + 0.32 * len(rows))
    shares: dict[str, list[float]] = {}
    for k, (_, group) in enumerate(rows):
        left = 0.0
        totals = [sum(run.phases.values()) for run in group]
        for phase in [p for p in _PHASES if any(p in run.phases for run in group)]:
            share = float(np.median([run.phases.get(phase, 0.0) / t for run, t in zip(group, totals, strict=True)]))
            axes.barh(k, 100 * share, left=left, color=_PHASES[phase], height=0.72)
            shares.setdefault(phase, []).append(share)
            left += 100 * share
        time = 1e3 * float(np.median([run.wall_time for run in group]))
        axes.text(101.5, k, f"{time:.3g} ms", va="center", fontsize=8.5)
    for phase, colour in _PHASES.items():
        if phase in shares:
            axes.bar(0, 0, color=colour, label=phase)
    axes.set_yticks(range(len(rows)), [name for name, _ in rows])
    axes.invert_yaxis()
    axes.set(xlabel="share of the time of a solve [%]", xlim=(0, 112), xticks=range(0, 101, 20))
    largest = max(shares, key=lambda phase: float(np.median(shares[phase])))
    axes.set_title(f"Most of the time goes to the {largest}: {100 * np.median(shares[largest]):.0f} % in the median")
    axes.legend(ncols=len(shares), fontsize=8, loc="upper center", bbox_to_anchor=(0.45, -0.16 - 0.5 / len(rows)))
    return figure


def effect_costs(study: Study) -> Figure:
    """Draw how many times as long a march takes with each effect as without it."""
    rows = sorted(study.effects, key=lambda cost: cost.present / cost.absent)
    figure, (axes,) = _figure(7.4, 1.3 + 0.34 * len(rows))
    ratios = [cost.present / cost.absent for cost in rows]
    axes.barh(range(len(rows)), [r - 1.0 for r in ratios], left=1.0, height=0.66, color=COLOURS["march"])
    for k, (cost, ratio) in enumerate(zip(rows, ratios, strict=True)):
        text = f"{1e3 * cost.absent:.3g} → {1e3 * cost.present:.3g} ms"
        axes.text(max(ratio, 1.0) * 1.03, k, text, va="center", fontsize=8.5)
    axes.axvline(1.0, color="black", linewidth=1)
    axes.set_yticks(range(len(rows)), [cost.effect.replace("_", " ") for cost in rows])
    axes.set(
        xlabel="time with the effect over time without it [-]",
        xscale="log",
        xlim=(0.5 * min(1, *ratios), 2.2 * max(ratios)),
    )
    axes.xaxis.set_major_formatter("{x:g}")
    axes.xaxis.set_minor_formatter("")
    axes.set_title(f"The dearest effect is {rows[-1].effect.replace('_', ' ')}: {ratios[-1]:.1f} times as long with it")
    axes.grid(alpha=0.25, axis="x", which="both", linewidth=0.5)
    return figure


_VARIABLES = {
    "n_u": "control points along the cable n_u [-]",
    "n_t": "control points in time n_t [-]",
    "horizon": "horizon at equal spacing in time [s]",
    "grasps": "number of grasps [-]",
}


def scaling(study: Study) -> Figure:
    """Draw the cost against n_u, n_t, horizon and number of grasps, with the exponents of fitted power laws."""
    figure, panels = _figure(10.5, 7.6, 2, 2)
    for axes, (variable, label) in zip(panels, _VARIABLES.items(), strict=True):
        rows = [row for row in study.scaling if row.variable == variable]
        methods = dict.fromkeys(row.method for row in rows)
        found = [_scaling_curve(axes, [row for row in rows if row.method == method], method) for method in methods]
        axes.set(xscale="log", yscale="log", xlabel=label, ylabel="time [ms]")
        values = sorted({row.value for row in rows})
        axes.set_xticks(values, [f"{v:g}" for v in values])
        axes.xaxis.set_minor_formatter("")
        _decimal(axes, only_y=True)
        axes.set_title("exponent " + ", ".join(f"{p:.2f} ({method})" for method, p in found))
        axes.grid(alpha=0.25, which="major", linewidth=0.5)
        axes.legend(fontsize=8)
    figure.suptitle(
        "How the cost grows: time of a march, and of one iteration of spacetime with its share of the march"
    )
    return figure


def _scaling_curve(axes: Axes, rows: Sequence[Scaled], method: str) -> tuple[str, float]:
    values, times = np.array([row.value for row in rows]), np.array([1e3 * row.wall_time for row in rows])
    spread = np.array([min(1e3 * row.spread, 0.9 * t) for row, t in zip(rows, times, strict=True)])
    upper = slice(len(rows) // 3, None)  # below, what does not grow with the size tells on the exponent
    p, c = exponent(values[upper], times[upper])
    axes.errorbar(values, times, yerr=spread, fmt=MARKS[method], markersize=5, color=COLOURS[method], label=method)
    axes.plot(values[upper], c * values[upper] ** p, "-", color=COLOURS[method], linewidth=1.2, alpha=0.8)
    return method, p


def _decimal(axes: Axes, *, only_y: bool = False) -> None:
    """Write the numbers of logarithmic axes as decimals."""
    for axis in (axes.yaxis,) if only_y else (axes.xaxis, axes.yaxis):
        axis.set_major_formatter("{x:g}")
