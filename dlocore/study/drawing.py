"""Draw a study into pictures. Needs matplotlib."""

from collections.abc import Callable
from pathlib import Path

import matplotlib as mpl
from matplotlib.figure import Figure

from dlocore.study.accuracy_plots import convergence, work_precision
from dlocore.study.cost_plots import effect_costs, phases, scaling
from dlocore.study.record import Study

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
