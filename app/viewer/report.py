"""Describe a prediction in plain words, as small pieces of HTML for the panel. Every inserted text is escaped."""

import json
import re
import shlex
import textwrap
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

from app import svg
from app.viewer import plots
from app.viewer.client_page import FOLD
from app.viewer.costs import Costs
from app.viewer.loads import forces_over
from app.viewer.palette import ColourScale, css_ramp
from app.viewer.wording import in_labels, problem_in_labels
from dlocore import EffectReport, Prediction
from dlocore.accuracy.fallback import errs
from dlocore.calibration import Measured, front_of
from dlocore.words import counted, in_mm, in_ms, in_newtons

_CARD = (
    "margin: 0 0.75rem 0.6rem; padding: 0.55rem 0.7rem; border-radius: 0.5rem; font-size: 0.8rem; line-height: 1.35;"
)
_GOOD = "rgba(46, 107, 214, 0.10)"
_DOUBT = "rgba(235, 150, 30, 0.16)"
SMALLEST_ERROR = 1e-9  # m: a smaller error counts as this one, since zero has no place on a logarithmic axis
EARLIER = 30  # earlier solves that are shown with the present one
WAYPOINTS = 50  # most waypoints that are listed
UNFOLDED = 120  # characters: longer texts are folded; about what the visible lines of a folded text hold
LABEL_WIDTH, LABEL_LINES = 48, 6  # characters a line, and lines, of a label in the picture
OF_BEFORE = '<div style="margin: 0.2rem 0.75rem; font-size: 0.78rem;"><b>From the previous scene:</b></div>'
_BAD = "rgba(222, 72, 50, 0.16)"
_WORDS = {
    "converged": "Converged",
    "max_iterations": "Not converged",
    "stalled": "Stalled",
    "time_limit": "Out of time",
}


def millimetres(metres: float | None) -> str:
    """Return an estimated error [m] in millimetres, or "not estimated"."""
    return "not estimated" if metres is None else in_mm(metres)


def status_card(prediction: Prediction, *, preview: bool) -> str:
    """Return a card with the state of the last solve: status, time and error in large type, the rest small.

    The card also warns about the answer, where nobody overlooks it. If the answer has not converged or its error is
    large, the card shows the whole message, otherwise only the notes.
    """
    accuracy = prediction.accuracy
    if preview:
        told: tuple[str, ...] = ()
    elif prediction.status != "converged" or errs(prediction):
        told = (_in_labels(prediction.message, prediction),)
    else:
        told = tuple(f"Note: {_in_labels(note, prediction)}." for note in prediction.notes)
    ground = _DOUBT if told else _GOOD
    state = "Preview" if preview else _WORDS[prediction.status]
    numbers = [
        (state, "status"),
        (in_ms(accuracy.wall_time, 2), "solve time"),
        (millimetres(accuracy.error_estimate), "estimated error"),
    ]
    cells = "".join(
        f'<div><div style="font-size: 0.95rem; font-weight: 600;">{escape(value)}</div>'
        f'<div style="opacity: 0.65; font-size: 0.7rem;">{escape(name)}</div></div>'
        for value, name in numbers
    )
    steps = counted(len(prediction.iterations), "iteration")
    detail = f"{accuracy.method}, {accuracy.n_u} × {accuracy.n_t} control points, {steps}, {accuracy.dimensions}D"
    parts = {
        name: size for name, size in accuracy.error_parts.items() if size > 0.01 * (accuracy.error_estimate or 0.0)
    }
    if not preview and len(parts) > 1:
        detail += "; error by " + ", ".join(f"{name} {millimetres(size)}" for name, size in parts.items())
    return (
        f'<div style="{_CARD} background: {ground};" data-status="{escape(prediction.status)}">'
        f'<div style="display: flex; justify-content: space-between; gap: 0.6rem;">{cells}</div>{_folded(told)}'
        f'<div style="opacity: 0.75; margin-top: 0.3rem;">{escape(detail)}</div></div>'
    )


def _folded(texts: Sequence[str]) -> str:
    """Return paragraphs; the page shows only a few lines of long ones until they are clicked."""
    words = "<br/>".join(escape(text) for text in texts)
    if sum(map(len, texts)) <= UNFOLDED:
        return f'<div style="margin-top: 0.3rem;">{words}</div>' if words else ""
    return f'<details class="{FOLD}" style="margin-top: 0.3rem;"><summary><div>{words}</div></summary></details>'


def problem_card(problem: str, details: str, places: Sequence[float]) -> str:
    """Return a card that says why there is no prediction; the scene's grippers hold the cable at `places` [m]."""
    problem, details = problem_in_labels(problem, details, places)
    headline = "This is not possible." if details else "No prediction."
    why, more = (details, "") if _name_the_field(problem, details) else (f"{problem}.", f"{details} ")
    return (
        f'<div style="{_CARD} background: {_BAD};" data-status="impossible" role="alert"><b>{headline}</b> '
        f"{escape(why)}<div style='opacity: 0.75; margin-top: 0.3rem;'>{escape(more)}"
        "The picture shows the last good prediction.</div></div>"
    )


def problem_label(problem: str, details: str, places: Sequence[float]) -> str:
    """Return why there is no prediction, with the value and what is allowed, in a few short lines for the picture."""
    problem, details = problem_in_labels(problem, details, places)
    words = details if _name_the_field(problem, details) else f"{problem}. {details}"
    return textwrap.fill(f"Not possible. {words}", LABEL_WIDTH, max_lines=LABEL_LINES, placeholder=" …")


def named_obstacles(problem: str, details: str) -> frozenset[int]:
    """Return the indices of the obstacles that a problem is about."""
    return frozenset(int(number) for number in re.findall(r"\bobstacles\[(\d+)\]", f"{problem} {details}"))


def _name_the_field(problem: str, details: str) -> bool:
    """Return whether a problem is merely the field name with which its details begin."""
    return details.startswith(f"{problem}:")


def status_label(prediction: Prediction) -> str:
    """Return a short line that says that an answer has not converged; "" if it has."""
    return "" if prediction.status == "converged" else f"{_WORDS[prediction.status]}: see the panel."


def waiting_card(*, ready: bool) -> str:
    """Return the card to show before the first prediction; the solver is `ready` or still being compiled."""
    return _waiting("Solving …" if ready else "The solver is being compiled, only this once …", "")


def solving_card(elapsed: float, longest: float) -> str:
    """Return the card to show while a solve has been running for `elapsed` [s]; it takes at most `longest` [s]."""
    return _waiting(f"Solving, {elapsed:.0f} s …", f"A solve takes at most {longest:g} s. ")


def _waiting(words: str, limit: str) -> str:
    return _plain_card(
        "waiting", words, f"{limit}The first scene with a new combination of effects takes a few seconds longer."
    )


def measuring_card(costs: Costs) -> str:
    """Return the card to show while the costs of the effects are being measured."""
    words = f"Measuring {costs.number} of {costs.count}: {escape(costs.effect.replace('_', ' '))} …"
    return _plain_card("measuring", words, "The scene is solved again several times without each effect.")


def stopped_card() -> str:
    """Return the card to show after the user has stopped a solve."""
    return _plain_card("stopped", "Stopped.", "This scene is not solved. The picture shows the previous prediction.")


def stale(html: str) -> str:
    """Mark results as those of the previous scene, so that nobody takes them for those of the present one."""
    return dimmed(f"{OF_BEFORE}{html}") if html else ""


def dimmed(html: str) -> str:
    """Return HTML of the previous scene, dimmed."""
    return f'<div data-stale="" style="opacity: 0.45;">{html}</div>'


def _plain_card(status: str, words: str, more: str) -> str:
    return (
        f'<div style="{_CARD} background: {_GOOD};" data-status="{status}"><b>{words}</b>'
        f'<div style="opacity: 0.75; margin-top: 0.3rem;">{more}</div></div>'
    )


def legend(scale: ColourScale) -> str:
    """Return the colour bar with its range."""
    quantity = scale.quantity
    low, high = (f"{value * quantity.scale:.3g}" for value in (scale.low, scale.high))
    return (
        f'<div style="margin: 0 0.75rem 0.6rem; font-size: 0.75rem;">'
        f'<div style="height: 0.5rem; border-radius: 0.25rem; background: {css_ramp(signed=quantity.signed)};"></div>'
        f'<div style="display: flex; justify-content: space-between; opacity: 0.8;"><span>{low}</span>'
        f"<span>{escape(quantity.name)} [{escape(quantity.unit)}]</span><span>{high}</span></div></div>"
    )


def effect_note(effect: EffectReport, cost: float | None) -> str:
    """Return a note on an effect: whether it is simulated, why, how large it is, and its `cost` in solve time [s]."""
    size = "" if effect.magnitude is None else f" · {effect.magnitude:.2g} {escape(effect.unit)}"
    mark, opacity = ("●", 1.0) if effect.active else ("○", 0.6)
    price = ""
    if cost is not None:
        verb = "costs" if cost >= 0 else "saves"
        price = f" <b>It {verb} {escape(in_ms(abs(cost), 2))}.</b>"
    state, reason = "active" if effect.active else "not active", escape(in_labels(effect.reason, ()))
    return (
        f'<div style="opacity: {opacity}; margin: -0.35rem 0.75rem 0.5rem; font-size: 0.75rem; line-height: 1.3;" '
        f'data-effect="{escape(effect.name, quote=True)}">{mark} {state}{size}: {reason}.{price}</div>'
    )


def forces_list(prediction: Prediction) -> str:
    """Return the largest forces on the cable, with estimated errors: of grippers, table, obstacles and known forces."""
    given = [(f"u = {g.u:.2f} m", g.times, g.reaction, g.reaction_error) for g in prediction.grasps]
    for c in prediction.contacts:
        name = _in_labels(c.name, prediction)
        given += [(name, c.times, c.force, c.force_error)] if c.force.any() else []
        given += [(f"{name}, friction", c.times, c.friction, c.friction_error)] if c.friction.any() else []
    for load in prediction.scene.loads:
        given.append((f"known force, u = {load.u:.2f} m", *forces_over(load, prediction.surface.horizon), None))
    rows = []
    for name, times, force, error in given:
        size = np.linalg.norm(force, axis=1)
        k = int(np.argmax(size))
        known = f" ± {in_newtons(error[k], 1)}" if error is not None and error[k] > 0.0 else ""
        rows.append(f"<div>{name}: at most {in_newtons(size[k])}{known}, at {times[k]:.2f} s</div>")
    return f'<div style="margin: 0.4rem 0.75rem; font-size: 0.78rem; line-height: 1.5;">{"".join(rows)}</div>'


def convergence(prediction: Prediction) -> str:
    """Return the plot of update and residual over the iterations (the paper's Fig. 2); only positive values show."""
    names = (("update [m]", "update", svg.BLUE), ("residual [m]", "residual", svg.ORANGE))
    if prediction.accuracy.method == "paper":
        names = (names[0], ("residual [N]", "residual", svg.ORANGE))
    series = []
    for name, field, colour in names:
        values = [(float(i.number), float(getattr(i, field))) for i in prediction.iterations]
        points = [(number, value) for number, value in values if np.isfinite(value) and value > 0]
        series.append(plots.Series(name=name, points=points, colour=colour))
    return plots.plot("iteration", "update, residual", series, log_x=False, mark="convergence")


def accuracy_plot(prediction: Prediction, earlier: list[tuple[float, float]], measured: tuple[Measured, ...]) -> str:
    """Return the plot of error against time, with the present solve as a dot, and append that solve to `earlier`.

    Args:
        prediction: the present solve.
        earlier: (time [ms], estimated error [mm]) of earlier solves. The newest `EARLIER` are kept.
        measured: the calibration of this machine.
    """
    grey = "rgba(128, 138, 154, 0.55)"
    places = [(1e3 * p.wall_time, 1e3 * max(p.error, SMALLEST_ERROR)) for p in measured]
    titles = [f"{p.method}, {p.n_u} x {p.n_t}" for p in measured]
    front = sorted(places[k] for k in front_of(measured))
    series = [
        plots.Series(name="measured here", points=places, colour=grey, line=False, size=2.0, titles=titles),
        plots.Series(name="the best of them", points=front, colour=svg.BLUE),
        plots.Series(name="your solves", points=tuple(earlier), colour=svg.GREEN, line=False),
    ]
    accuracy = prediction.accuracy
    if accuracy.error_estimate and accuracy.wall_time > 0:
        here = (1e3 * accuracy.wall_time, 1e3 * accuracy.error_estimate)
        series.append(plots.Series(name="this solve", points=[here], colour=svg.ORANGE, size=5.0))
        earlier[:] = [*earlier, here][-EARLIER:]
    hint = "" if measured else note("To see what accuracy costs on this machine, run dlo calibrate.", good=True)
    return plots.plot("time [ms]", "error [mm]", series, log_x=True, mark="accuracy") + hint


def waypoints(path: Mapping[str, Any]) -> str:
    """Return the number of waypoints of a path and its duration; unfolded, their times and positions.

    Paths of other kinds give "".
    """
    if path.get("kind") != "waypoints":
        return ""
    times, positions = path["times"], path["positions"]
    rows = "".join(
        f"<div>{time:.4g} s: {', '.join(f'{x:.4g}' for x in position)}</div>"
        for time, position in zip(times[:WAYPOINTS], positions, strict=False)
    )
    rest = f"<div>and {len(times) - WAYPOINTS} more</div>" if len(times) > WAYPOINTS else ""
    return (
        '<details style="margin: 0.2rem 0.75rem; font-size: 0.78rem; line-height: 1.35;">'
        f'<summary style="cursor: pointer;">{len(times)} waypoints in {times[-1] - times[0]:.4g} s</summary>'
        f"<div>time: x, y, z [m]</div>{rows}{rest}</details>"
    )


def message(prediction: Prediction) -> str:
    """Return the solver's message about its answer."""
    return note(_in_labels(prediction.message, prediction), good=True)


def _in_labels(text: str, prediction: Prediction) -> str:
    return in_labels(text, [grasp.u for grasp in prediction.scene.grasps])


def note(text: str, *, good: bool) -> str:
    """Return a small paragraph; one that is not `good` is highlighted."""
    ground = "" if good else f" background: {_BAD}; border-radius: 0.4rem; padding: 0.4rem 0.6rem;"
    return f'<div style="margin: 0.2rem 0.75rem; font-size: 0.78rem; line-height: 1.35;{ground}">{escape(text)}</div>'


def json_block(document: dict[str, Any]) -> str:
    """Return a scene as a Markdown code block."""
    return f"```json\n{json.dumps(document, indent=1)}\n```"


def curl_block(address: str, document: dict[str, Any]) -> str:
    """Return the shell command that requests the prediction from the service at `address`, as a Markdown code block."""
    body = json.dumps(document, separators=(",", ":"))
    return f"```sh\ncurl -s {address}/v1/predictions -H 'Content-Type: application/json' -d {shlex.quote(body)}\n```"


def run_links(run_id: str) -> str:
    """Return the links to a stored run: its 3D scene, its recording, its JSON and its request."""
    path = f"/v1/predictions/{escape(run_id, quote=True)}"
    links = [
        (f"/scene/?run={escape(run_id, quote=True)}", "open in the scene"),
        (f"{path}/viewer", "recording"),
        (f"{path}/recording.rrd", ".rrd"),
        (path, "JSON"),
        (f"{path}/scene.json", "scene"),
    ]
    anchors = " · ".join(
        f'<a href="{href}" target="_blank" rel="noopener" style="color: inherit;">{name}</a>' for href, name in links
    )
    return f'<div style="{_CARD} background: {_GOOD};" data-run="{escape(run_id, quote=True)}">Kept: {anchors}</div>'
