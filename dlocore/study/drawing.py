"""Draw the plots of a study. Needs matplotlib."""

from collections.abc import Callable
from pathlib import Path
from textwrap import wrap

import matplotlib as mpl
from matplotlib.figure import Figure

from dlocore.study.accuracy_plots import convergence, work_precision
from dlocore.study.cost_plots import effect_costs, phases, scaling
from dlocore.study.record import Study

_DPI = 110
_PER_INCH = 17  # characters of the caption
_LINE = 0.12  # [in] height of its lines


def draw_all(study: Study, folder: Path) -> list[Path]:
    """Draw every plot for which a study has the measurements, and return the files.

    Args:
        study: what was measured.
        folder: where the pictures go; created if it does not exist.
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
            _caption(figure, study)
            file = folder / f"{name}.png"
            figure.savefig(file, dpi=_DPI)
            files.append(file)
    return files


def _caption(figure: Figure, study: Study) -> None:
    """Write below a figure what was measured and where, in as many lines as its width requires."""
    machine = ", ".join([study.machine["processor"], f"Python {study.machine.get('Python', '?')}"])
    day = study.measured_at.replace("T", " ").replace("Z", " UTC")
    text = f"dlo study; {machine}; {day}; program {study.source}; one thread, time on a core of its own"
    width, height = figure.get_size_inches()
    lines = wrap(text, int(_PER_INCH * width))
    below = (_LINE * len(lines) + 0.04) / height
    figure.set_layout_engine("constrained", rect=(0.0, below, 1.0, 1.0 - below))
    figure.text(
        0.995, 0.04 / height, "\n".join(lines), ha="right", va="bottom", fontsize=7, linespacing=1.2, color="#666666"
    )
