"""The result of an identification, as JSON and as one HTML page: tables, plots, worst moments."""

from collections import Counter
from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app import svg
from app.schemas.describe import from_cable
from dlocore.identify import Fit, Identification
from dlocore.words import counted

Floats = NDArray[np.float64]

_LYING = 0.2  # of its width: a cable whose height is less than this lies flat
_STYLE = """body{font:15px/1.5 system-ui,sans-serif;max-width:60rem;margin:2rem auto;padding:0 1rem;color:#1c2024}
h1{font-size:1.5rem}h2{font-size:1.15rem;margin-top:2rem}table{border-collapse:collapse;width:100%}
td,th{padding:.3rem .6rem;border-bottom:1px solid #dde;text-align:right}td:first-child,th:first-child{text-align:left}
figure{margin:1rem 0}figcaption{color:#555;font-size:.9rem}svg{width:100%;height:auto}.row{display:flex;gap:1rem}
.row figure{flex:1}.unknown{color:#8a8f98}"""


def document_of_identification(found: Identification) -> dict[str, Any]:
    """Return an identification as JSON-ready data: cable and drag as scenes take them, and how well they are known."""
    candidate = found.candidate
    document: dict[str, Any] = {
        "status": found.status,
        "message": found.message,
        "cable": from_cable(found.cable),
        "environment": {
            "drag": candidate.environment.drag,
            "drag_quadratic": candidate.environment.drag_quadratic,
            "gravity": np.asarray(candidate.environment.gravity).tolist(),
        },
        "parameters": [
            {
                "name": p.name, "unit": p.unit, "value": p.value, "low": p.low, "high": p.high,
                "identifiable": p.identifiable, "statement": p.statement, "rests_on": p.rests_on,
            }
            for p in found.parameters
        ],
        "correlations": [[None if np.isnan(x) else float(x) for x in row] for row in found.correlations],
        "fit": [
            {
                "recording": name,
                "mean": float(np.nanmean(fit.distances)),
                "median": float(np.nanmedian(fit.distances)),
                "worst": float(np.nanmax(fit.distances)),
                "stalled": fit.stalled,
            }
            for name, fit in zip(_window_names(found.fits), found.fits, strict=True)
        ],
        "deviation": found.deviation,
        "iterations": found.iterations,
        "seconds": found.seconds,
    }  # fmt: skip
    if candidate.rest_curvature is not None:
        document["rest_curvature"] = candidate.rest_curvature.tolist()
    if candidate.clamp_angles is not None:
        document["clamp_angles"] = candidate.clamp_angles.tolist()
    if candidate.marker_offsets is not None:
        document["marker_offsets"] = candidate.marker_offsets.tolist()
    if any(p.name == "turn" for p in found.parameters):
        document["turn"] = candidate.turn
    return document


def report_of(found: Identification, title: str) -> str:
    """Return a self-contained page: parameters with intervals, fits, errors over time, and the worst moments."""
    rows = "".join(
        f"<tr{'' if p.identifiable else ' class=unknown'}><td>{escape(p.name)}</td>"
        + (
            f"<td>{p.value:.4g}</td><td>{p.low:.3g} to {p.high:.3g}</td>"
            if p.identifiable
            else "<td>not identifiable</td><td>-</td>"
        )
        + f"<td>{escape(p.unit)}</td></tr>"
        for p in found.parameters
    )
    names = _window_names(found.fits)
    fits = "".join(
        f"<tr><td>{escape(name)}</td><td>{1e3 * np.nanmean(f.distances):.1f}</td>"
        f"<td>{1e3 * np.nanmedian(f.distances):.1f}</td><td>{1e3 * np.nanmax(f.distances):.1f}</td>"
        f"<td>{'stalled' if f.stalled else ''}</td></tr>"
        for name, f in zip(names, found.fits, strict=True)
    )
    figures = "".join(_figures(*pair) for pair in zip(names[:8], found.fits[:8], strict=True))
    more = f"<p>The table lists {len(found.fits) - 8} more windows.</p>" if len(found.fits) > 8 else ""
    every = np.concatenate([f.distances.ravel() for f in found.fits])
    typical = 1e3 * float(np.nanmedian(every))
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{escape(title)}</title>'
        f"<style>{_STYLE}</style></head><body><h1>{escape(title)}: half of the markers are within {typical:.1f} mm of "
        f"the prediction</h1><p>{escape(found.message)}</p><h2>Parameters</h2><table><tr><th>parameter</th>"
        f"<th>value</th><th>95 % interval</th><th>unit</th></tr>{rows}</table>{_correlations(found)}"
        f"<h2>Distance of free markers from the prediction [mm]</h2><table><tr><th>recording</th><th>mean</th>"
        f"<th>median</th><th>worst</th><th></th></tr>{fits}</table>{figures}{more}"
        f"<p>{counted(found.iterations, 'iteration')} in {found.seconds:.1f} s.</p></body></html>"
    )


def _correlations(found: Identification) -> str:
    names = [p.name for p in found.parameters]
    if len(names) < 2 or len(names) > 12:
        return ""
    head = "".join(f"<th>{escape(n)}</th>" for n in names)
    body = "".join(
        f"<tr><td>{escape(name)}</td>"
        + "".join("<td>-</td>" if np.isnan(x) else f"<td>{x:.2f}</td>" for x in row)
        + "</tr>"
        for name, row in zip(names, found.correlations, strict=True)
    )
    return f"<h2>Correlations</h2><table><tr><th></th>{head}</tr>{body}</table>"


def _window_names(fits: Sequence[Fit]) -> list[str]:
    """Return the name of each fit's recording, with the times of the window if the recording has several."""
    several = Counter(fit.name for fit in fits)
    return [f"{f.name}, {f.begin:.4g} to {f.end:.4g} s" if several[f.name] > 1 else f.name for f in fits]


def _figures(name: str, fit: Fit) -> str:
    # the median over the markers, which is robust to outliers of the tracking; NaN where all markers were lost
    seen = np.asarray(np.isfinite(fit.distances).any(axis=1))
    distance = np.full(len(seen), np.nan)
    distance[seen] = 1e3 * np.nanmedian(fit.distances[seen], axis=1)
    worst = int(np.nanargmax(distance))
    overlay = _overlay(fit, worst)
    when = f"shape {worst + 1} of {len(seen)}" if fit.static else f"at {fit.times[worst]:.2f} s"
    what = "worst shape" if fit.static else "worst moment"
    caption = f"{name}: {what}, {when}, with a median distance of {distance[worst]:.0f} mm"
    if fit.static or len(fit.times) < 10:
        return f"<figure>{overlay}<figcaption>{escape(caption)}</figcaption></figure>"
    return (
        f'<div class="row"><figure>{_over_time(fit.times, distance)}<figcaption>{escape(name)}: median distance of '
        f"the free markers over time</figcaption></figure><figure>{overlay}<figcaption>{escape(caption)}: "
        f'<span style="color:{svg.ORANGE}">measured</span>, <span style="color:{svg.BLUE}">predicted</span>'
        "</figcaption></figure></div>"
    )


def _over_time(times: Floats, distance: Floats) -> str:
    left, top, width, height = 48.0, 10.0, 360.0, 190.0
    most = svg.round_up(float(np.nanmax(distance)))
    x = left + width * (times - times[0]) / (times[-1] - times[0])
    y = top + height * (1.0 - distance / most)
    lost = np.flatnonzero(np.diff(np.isfinite(y))) + 1
    pieces = np.split(np.column_stack([x, y]), lost)
    parts = [svg.line(piece, svg.BLUE) for piece in pieces if np.isfinite(piece[0, 1])]
    for share in (0.0, 0.5, 1.0):
        at = top + height * (1.0 - share)
        parts.append(svg.line([(left, at), (left + width, at)], "#dde", 1.0))
        parts.append(svg.text(left - 6, at + 4, f"{share * most:g}" + (" mm" if share == 1.0 else ""), "end"))
        when = times[0] + share * (times[-1] - times[0])
        parts.append(svg.text(left + share * width, top + height + 16, f"{when:.3g}"))
    parts.append(svg.text(left + width / 2, top + height + 32, "time [s]"))
    return _drawing(parts)


def _overlay(fit: Fit, frame: int) -> str:
    """Return a drawing of the measured and the predicted markers of a frame."""
    measured, predicted = fit.measured[frame], fit.predicted[frame]
    middle = predicted.mean(axis=0)
    right, up = _view(fit.gravity, predicted - middle)

    def seen(points: Floats) -> Floats:
        return np.asarray((points - middle) @ np.column_stack([right, up]))

    a, b = seen(measured), seen(predicted)
    every = np.concatenate([a[np.isfinite(a).all(axis=1)], b])
    low, high = every.min(axis=0), every.max(axis=0)
    scale = min(390.0 / max(high[0] - low[0], 1e-3), 210.0 / max(high[1] - low[1], 1e-3))

    def placed(points: Floats) -> Floats:
        x = 210.0 + scale * (points[:, 0] - 0.5 * (low[0] + high[0]))
        return np.column_stack([x, 120.0 - scale * (points[:, 1] - 0.5 * (low[1] + high[1]))])

    parts = [svg.line(placed(b), svg.BLUE, 2.0)]
    for there, here in zip(placed(a), placed(b), strict=True):
        if np.isfinite(there[0]):
            parts += [svg.line([there, here], svg.GREY, 1.0), svg.dot(there, 4.0, svg.ORANGE)]
        parts.append(svg.dot(here, 2.5, svg.BLUE))
    parts += [svg.line([(10, 232), (10 + 0.1 * scale, 232)], "#333", 2.0), svg.text(10, 226, "0.1 m", "start")]
    return _drawing(parts)


def _view(gravity: Floats, points: Floats) -> tuple[Floats, Floats]:
    """Return unit vectors (3,) that point right and up in a view of points (m, 3), given relative to their middle.

    Up is against gravity, or z without gravity. A cable that lies flat is seen from above, and up is horizontal.
    """
    weight = float(np.linalg.norm(gravity))
    up = -gravity / weight if weight > 0.0 else np.array([0.0, 0.0, 1.0])
    level = np.eye(3) - np.outer(up, up)
    right = np.linalg.svd(np.vstack([points @ level, 1e-9 * level]))[2][0]
    right = right * (1.0 if right[np.argmax(np.abs(right))] > 0 else -1.0)
    across = np.cross(up, right)
    return right, across if np.ptp(points @ up) < _LYING * np.ptp(points @ across) else up


def _drawing(parts: list[str]) -> str:
    return f'<svg viewBox="0 0 420 240" role="img" font-size="12" fill="#555">{"".join(parts)}</svg>'
