"""A prediction in plain words and small pieces of HTML for the panel; every inserted text is escaped."""

import json
from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.viewer.palette import ColourScale, css_ramp
from dlocore import Prediction

Floats = NDArray[np.float64]
_CARD = (
    "margin: 0 0.75rem 0.6rem; padding: 0.55rem 0.7rem; border-radius: 0.5rem; font-size: 0.8rem; line-height: 1.35;"
)
_GOOD = "rgba(46, 107, 214, 0.10)"
_DOUBT = "rgba(235, 150, 30, 0.16)"
_BAD = "rgba(222, 72, 50, 0.16)"
_WORDS = {
    "converged": "Converged",
    "max_iterations": "Not converged",
    "stalled": "Stalled",
    "time_limit": "Out of time",
}


def milliseconds(seconds: float) -> str:
    """Return a duration [s] in milliseconds, with two significant digits below 10 ms."""
    ms = 1e3 * seconds
    return f"{ms:.2g} ms" if ms < 10 else f"{ms:.0f} ms"


def millimetres(metres: float | None) -> str:
    """Return an estimated error [m] in millimetres, or say that there is none."""
    if metres is None:
        return "not estimated"
    mm = 1e3 * metres
    return f"{mm:.2g} mm" if mm < 10 else f"{mm:.0f} mm"


def status_card(prediction: Prediction, *, preview: bool) -> str:
    """Return the state of the last solve: status, time and error large, the rest small."""
    accuracy = prediction.accuracy
    ground = _GOOD if prediction.status == "converged" else _DOUBT
    state = "Preview" if preview else _WORDS[prediction.status]
    numbers = [
        (state, "status"),
        (milliseconds(accuracy.wall_time), "solve time"),
        (millimetres(accuracy.error_estimate), "estimated error"),
    ]
    cells = "".join(
        f'<div><div style="font-size: 0.95rem; font-weight: 600;">{escape(value)}</div>'
        f'<div style="opacity: 0.65; font-size: 0.7rem;">{escape(name)}</div></div>'
        for value, name in numbers
    )
    steps = f"{len(prediction.iterations)} iterations" if len(prediction.iterations) != 1 else "1 iteration"
    detail = f"{accuracy.method}, {accuracy.n_u} × {accuracy.n_t} control points, {steps}, {accuracy.dimensions}D"
    advice = "" if prediction.status == "converged" else f"<div>{escape(prediction.message)}</div>"
    return (
        f'<div style="{_CARD} background: {ground};" data-status="{escape(prediction.status)}">'
        f'<div style="display: flex; justify-content: space-between; gap: 0.6rem;">{cells}</div>{advice}'
        f'<div style="opacity: 0.75; margin-top: 0.3rem;">{escape(detail)}</div></div>'
    )


def problem_card(problem: str, details: str) -> str:
    """Return why there is no prediction, in words."""
    headline = "This is not possible." if details else "No prediction."
    return (
        f'<div style="{_CARD} background: {_BAD};" data-status="impossible" role="alert"><b>{headline}</b> '
        f"{escape(problem)}.<div style='opacity: 0.75; margin-top: 0.3rem;'>{escape(details)} "
        "The picture shows the last good prediction.</div></div>"
    )


def waiting_card() -> str:
    """Return what to show before the first prediction."""
    return f'<div style="{_CARD} background: {_GOOD};" data-status="waiting">Solving the first scene …</div>'


def legend(scale: ColourScale) -> str:
    """Return the colour bar with its range."""
    quantity = scale.quantity
    low, high = (f"{value * quantity.scale:.3g}" for value in (scale.low, scale.high))
    return (
        f'<div style="margin: 0 0.75rem 0.6rem; font-size: 0.75rem;">'
        f'<div style="height: 0.5rem; border-radius: 0.25rem; background: {css_ramp()};"></div>'
        f'<div style="display: flex; justify-content: space-between; opacity: 0.8;"><span>{low}</span>'
        f"<span>{escape(quantity.name)} [{escape(quantity.unit)}]</span><span>{high}</span></div></div>"
    )


def effects_list(prediction: Prediction) -> str:
    """Return the effects, active ones first, each with the reason."""
    rows = []
    for effect in sorted(prediction.effects, key=lambda effect: not effect.active):
        size = "" if effect.magnitude is None else f" · {effect.magnitude:.2g} {escape(effect.unit)}"
        mark, opacity = ("●", 1.0) if effect.active else ("○", 0.6)
        rows.append(
            f'<div style="opacity: {opacity}; margin-bottom: 0.35rem;">{mark} <b>{escape(effect.name)}</b>{size}'
            f'<div style="opacity: 0.75; padding-left: 1rem;">{escape(effect.reason)}</div></div>'
        )
    return f'<div style="margin: 0.4rem 0.75rem; font-size: 0.78rem; line-height: 1.3;">{"".join(rows)}</div>'


def grippers_list(prediction: Prediction) -> str:
    """Return the largest force that each gripper has to give."""
    rows = []
    for grasp in prediction.grasps:
        size = np.linalg.norm(grasp.reaction, axis=1)
        k = int(np.argmax(size))
        rows.append(f"<div>u = {grasp.u:.2f} m: at most {size[k]:.2g} N, at {grasp.times[k]:.2f} s</div>")
    return f'<div style="margin: 0.4rem 0.75rem; font-size: 0.78rem; line-height: 1.5;">{"".join(rows)}</div>'


def convergence(prediction: Prediction) -> tuple[Floats, Floats, Floats]:
    """Return iteration numbers and the decimal logarithms of update and residual, where both are positive."""
    rows = [
        (float(i.number), np.log10(i.update), np.log10(i.residual))
        for i in prediction.iterations
        if np.isfinite([i.update, i.residual]).all() and i.update > 0 and i.residual > 0
    ]
    if not rows:
        rows = [(0.0, 0.0, 0.0)]
    numbers, updates, residuals = (np.array(column, dtype=float) for column in zip(*rows, strict=True))
    return numbers, updates, residuals


def json_block(document: dict[str, Any]) -> str:
    """Return a scene as a Markdown code block."""
    return f"```json\n{json.dumps(document, indent=1)}\n```"


def curl_block(address: str, document: dict[str, Any]) -> str:
    """Return the shell line that asks the service at `address` for the prediction, as a Markdown code block."""
    body = json.dumps(document, separators=(",", ":"))
    return f"```sh\ncurl -s {address}/v1/predictions -H 'Content-Type: application/json' -d '{body}'\n```"


def run_links(run_id: str) -> str:
    """Return the links to a stored run: its recording, its JSON and its scene."""
    path = f"/v1/predictions/{escape(run_id, quote=True)}"
    links = [
        (f"{path}/viewer", "recording"),
        (f"{path}/recording.rrd", ".rrd"),
        (path, "JSON"),
        (f"{path}/scene.json", "scene"),
    ]
    anchors = " · ".join(
        f'<a href="{href}" target="_blank" rel="noopener" style="color: inherit;">{name}</a>' for href, name in links
    )
    return f'<div style="{_CARD} background: {_GOOD};" data-run="{escape(run_id, quote=True)}">Kept: {anchors}</div>'
