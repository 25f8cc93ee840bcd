"""Plots of the cost that a study measured: time by phase and by effect, and against the size of a problem."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.ticker import NullFormatter

from dlocore.accuracy.cost import exponent
from dlocore.study.record import Run, Scaled, Study
from dlocore.study.style import COLOURS, MARKS, name_of, new_figure, write_decimals

_PHASES = {
    "setup": "#999999",
    "march": "#0072B2",
    "fit": "#56B4E9",
    "spacetime": "#D55E00",
    "paper": "#CC79A7",
    "estimate": "#009E73",
}
_WORK = {"march": "its steps", "spacetime": "its iterations", "paper": "its iterations", "setup": "the setup"}


def phases(study: Study) -> Figure:
    """Draw the time by phase, stacked, for each method, set of effects, threshold and grid; the median over scenes."""
    names = {run.key: name_of(run, study.runs) for run in study.runs}
    rows = []
    for name in dict.fromkeys(names.values()):
        mine = [run for run in study.runs if names[run.key] == name]
        for grid in sorted({(run.n_u, run.n_t) for run in mine}):
            group = [run for run in mine if (run.n_u, run.n_t) == grid]
            rows.append((f"{name}  {grid[0]} × {grid[1]}", group))
    longest = max(len(name) for name, _ in rows)
    figure, (axes,) = new_figure(7.2 + 0.08 * longest, 1.7 + 0.32 * len(rows))
    used = [phase for phase in _PHASES if any(phase in run.phases for run in study.runs)]
    for k, (_, group) in enumerate(rows):
        shares = _shares(group)
        left = 0.0
        for phase in used:
            axes.barh(k, 100 * shares.get(phase, 0.0), left=left, color=_PHASES[phase], height=0.72)
            left += 100 * shares.get(phase, 0.0)
        time = 1e3 * float(np.median([run.wall_time for run in group]))
        axes.text(101.5, k, f"{time:.3g} ms", va="center", fontsize=8.5)
    axes.set_yticks(range(len(rows)), [name for name, _ in rows])
    axes.invert_yaxis()
    axes.set(xlabel="share of the time of a solve [%]", xlim=(0, 112), xticks=range(0, 101, 20))
    parts = []
    for method in dict.fromkeys(run.method for run in study.runs):
        shares = _shares([run for run in study.runs if run.method == method])
        largest = max(shares, key=lambda phase: shares[phase])
        parts.append(f"{method}: {100 * shares[largest]:.0f} % of the time in {_WORK.get(largest, largest)}")
    axes.set_title("; ".join(parts))
    handles = [Patch(color=_PHASES[phase], label=phase) for phase in used]
    figure.legend(handles=handles, ncols=len(used), fontsize=8, loc="outside upper center")
    return figure


def _shares(runs: Sequence[Run]) -> dict[str, float]:
    """Return the share of each phase in the time of some runs, with equal weight for each run."""
    found: dict[str, float] = {}
    for run in runs:
        total = sum(run.phases.values())
        for phase, time in run.phases.items():
            found[phase] = found.get(phase, 0.0) + time / total / len(runs)
    return found


def effect_costs(study: Study) -> Figure:
    """Draw the time of a march with each effect relative to that without it."""
    rows = sorted(study.effects, key=lambda cost: cost.present / cost.absent)
    figure, (axes,) = new_figure(7.4, 1.3 + 0.34 * len(rows))
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
        xlim=(0.8 * min(1, *ratios), 1.6 * max(ratios)),
    )
    write_decimals(axes.xaxis)
    axes.set_title(f"The dearest effect is {rows[-1].effect.replace('_', ' ')}: {ratios[-1]:.1f} times as long with it")
    axes.set_axisbelow(True)
    axes.grid(alpha=0.25, axis="x", linewidth=0.5)
    return figure


_VARIABLES = {
    "n_u": "control points along the cable n_u [-]",
    "n_u in space": "control points along a cable in space with twist n_u [-]",
    "n_t": "control points in time n_t [-]",
    "horizon": "horizon at equal spacing in time [s]",
    "grasps": "number of grasps [-]",
}


def scaling(study: Study) -> Figure:
    """Draw the cost against n_u, n_t, horizon and number of grasps, with the exponents of fitted power laws."""
    figure, (*panels, spare) = new_figure(15.5, 7.6, 2, 3)
    spare.remove()
    for axes, (variable, label) in zip(panels, _VARIABLES.items(), strict=True):
        rows = [row for row in study.scaling if row.variable == variable]
        methods = dict.fromkeys(row.method for row in rows)
        found = [_scaling_curve(axes, [row for row in rows if row.method == method], method) for method in methods]
        axes.set(xscale="log", yscale="log", xlabel=label, ylabel="time [ms]")
        values = sorted({row.value for row in rows})
        axes.set_xticks(values, [f"{v:g}" for v in values])
        axes.xaxis.set_minor_formatter(NullFormatter())
        write_decimals(axes.yaxis)
        axes.set_title(f"{variable}: exponent " + ", ".join(f"{p:.2f} ({method})" for method, p in found))
        axes.grid(alpha=0.25, which="major", linewidth=0.5)
        axes.legend(fontsize=8)
    figure.suptitle("How the cost grows: time of a march, and of one iteration of spacetime")
    return figure


def _scaling_curve(axes: Axes, rows: Sequence[Scaled], method: str) -> tuple[str, float]:
    values, times = np.array([row.value for row in rows]), np.array([1e3 * row.wall_time for row in rows])
    spread = np.array([min(1e3 * row.spread, 0.9 * t) for row, t in zip(rows, times, strict=True)])
    upper = slice(len(rows) // 3, None)  # below, the part that does not grow with the size distorts the exponent
    p, c = exponent(values[upper], times[upper])
    axes.errorbar(values, times, yerr=spread, fmt=MARKS[method], markersize=5, color=COLOURS[method], label=method)
    axes.plot(values[upper], c * values[upper] ** p, "-", color=COLOURS[method], linewidth=1.2, alpha=0.8)
    return method, p
