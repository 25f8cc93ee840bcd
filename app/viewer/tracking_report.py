"""Texts about a recording, as small pieces of HTML: the error, the progress of a search, its result."""

from html import escape

import numpy as np
from numpy.typing import NDArray

from app import svg
from dlocore.identify import Identification, Progress

Floats = NDArray[np.float64]
DRAWN = 200  # points of the error over time
WIDTH, HEIGHT = 300, 84


def progress(progress: Progress) -> str:
    """Return the progress of a search."""
    values = ", ".join(f"{name} {value:.3g}" for name, value in progress.values.items())
    return (
        f'<div style="margin: 0.2rem 0.75rem; font-size: 0.78rem;" data-identify="running"><b>Iteration '
        f"{progress.iteration}: {1e3 * progress.distance:.1f} mm</b><br>{escape(values)}</div>"
    )


def result(found: Identification) -> str:
    """Return the result of a search: a table of the parameters with their intervals."""
    rows = "".join(
        f'<tr><td>{escape(p.name)}</td><td style="text-align: right;">'
        + (
            f"{p.value:.3g}</td><td>{p.low:.2g} to {p.high:.2g} {escape(p.unit)}</td></tr>"
            if p.identifiable
            else "-</td><td>not identifiable</td></tr>"
        )
        for p in found.parameters
    )
    return (
        f'<div style="margin: 0.2rem 0.75rem; font-size: 0.75rem;" data-identify="{escape(found.status)}">'
        f'<table style="width: 100%; border-spacing: 0.4rem 0.15rem;">{rows}</table>'
        f'<div style="opacity: 0.75;">95 % intervals. {escape(found.message)}</div></div>'
    )


def error_card(times: Floats, distances: Floats, time: float) -> str:
    """Return the distance of the markers from the prediction: now as a number [mm], and as a plot with a cursor.

    Args:
        times: (k,) [s].
        distances: (k,) [m], NaN where unknown.
        time: time of the cursor [s].
    """
    known = np.isfinite(distances)
    if not known.any():
        return ""
    t, mm = times[known], 1e3 * distances[known]
    now, most = float(np.interp(time, t, mm)), max(float(mm.max()), 1.0)
    drawn = np.linspace(t[0], t[-1], min(DRAWN, len(t)))
    left, top, bottom = 30.0, 8.0, HEIGHT - 6.0

    def place(at: float, value: float) -> tuple[float, float]:
        across = left + (WIDTH - left - 6.0) * (at - t[0]) / max(t[-1] - t[0], 1e-9)
        return across, bottom - (bottom - top) * value / most

    here = place(float(np.clip(time, t[0], t[-1])), now)
    parts = [
        *(svg.line([(left, at), (WIDTH - 6, at)], "currentColor", 1.0, stroke_opacity=0.2) for at in (top, bottom)),
        svg.text(left - 4, top + 4, f"{most:.0f}", "end"),
        svg.text(left - 4, bottom + 2, "0", "end"),
        svg.line([place(at, float(np.interp(at, t, mm))) for at in drawn], svg.BLUE, 1.4),
        svg.line([(here[0], top), (here[0], bottom)], svg.ORANGE, 1.0),
        svg.dot(here, 3.5, svg.ORANGE),
    ]
    return (
        f'<div style="margin: 0 0.75rem 0.5rem; font-size: 0.78rem;" data-error="{now:.2f}"><b>{now:.1f} mm</b> '
        f'from the measured markers <span style="opacity: 0.7;">(median of the markers; over time: median '
        f"{np.median(mm):.1f}, at most {most:.0f} mm)</span>"
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="error over time" '
        'style="width: 100%; display: block;" '
        f'font-size="10" fill="currentColor">{"".join(parts)}</svg></div>'
    )
