"""Edit the start shape of a draft: its points, its length."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.viewer.draft import Draft
from app.viewer.rounding import listed
from dlocore.scene.cable import MAX_LENGTH, MIN_LENGTH
from dlocore.shape.shape import StartCurve

Floats = NDArray[np.float64]
HANDLES = 13  # points that can be dragged
DIGITS = 5  # of points in the document: to 10⁻⁵ m


def handles(start: StartCurve, length: float) -> Floats:
    """Return the points for dragging the start shape, evenly spaced along it; (HANDLES, 3) [m]."""
    return start(np.linspace(0.0, length, HANDLES))


def dragged(points: Floats, number: int, to: Floats) -> Floats:
    """Move one point of a chain (n, 3) [m] and pull the others along, so that all chords keep their lengths.

    Each point follows its neighbour on the side of the dragged one, like the links of a chain.
    """
    moved = points.copy()
    chords = np.linalg.norm(np.diff(points, axis=0), axis=1)
    moved[number] = to
    for k in range(number + 1, len(points)):
        moved[k] = _at_distance(moved[k - 1], moved[k], chords[k - 1])
    for k in range(number - 1, -1, -1):
        moved[k] = _at_distance(moved[k + 1], moved[k], chords[k])
    return moved


def _at_distance(near: Floats, far: Floats, distance: float) -> Floats:
    step = far - near
    length = float(np.linalg.norm(step))
    direction = step / length if length > 1e-12 else np.array([1.0, 0.0, 0.0])
    return near + distance * direction


def with_points(draft: Draft, points: Floats) -> Draft:
    """Let the cable start along ordered points (n, 3) [m]; settling stays as it was."""
    shape: dict[str, Any] = {"kind": "points", "points": listed(points, DIGITS)}
    if draft.get(("shape", "settle")):
        shape["settle"] = True
    return draft.put(("shape",), shape)


def straightened(draft: Draft, start: StartCurve) -> Draft:
    """Let the cable start straight from its present first end, along the line to its other end."""
    begin, end = start([0.0, draft.length])
    along = end - begin
    if float(np.linalg.norm(along)) < 1e-6 * draft.length:
        along = np.array([1.0, 0.0, 0.0])
    return draft.put(("shape",), _line(begin, along))


def between(draft: Draft, begin: Floats, end: Floats) -> Draft:
    """Let the cable start straight from one point towards another, (3,) [m]; settling stays as it was."""
    settles = {"settle": True} if draft.get(("shape", "settle")) else {}
    return draft.put(("shape",), {**_line(begin, end - begin), **settles})


def _line(begin: Floats, along: Floats) -> dict[str, Any]:
    direction = along / np.linalg.norm(along)
    return {"kind": "straight", "start": listed(begin, DIGITS), "direction": listed(direction, DIGITS)}


def with_settling(draft: Draft, settle: bool) -> Draft:
    """Set whether the cable comes to rest in its grippers before the motion."""
    return draft.put(("shape", "settle"), True if settle else None)


def scaled(draft: Draft, length: float) -> Draft:
    """Change the length of the cable [m].

    A straight cable grows at its far end, and what is attached there moves along. Any other shape is scaled about its
    first point. A length that is not allowed changes nothing: a shape scaled to 0 could not be scaled back.
    """
    if not MIN_LENGTH <= length <= MAX_LENGTH:
        return draft
    before = draft.length
    share = length / before
    edited = draft.put(("cable", "length"), length)
    kind = draft.get(("shape", "kind"))

    def placed(u: float) -> float:
        at_the_end = abs(u - before) <= 1e-9 * before
        return length if at_the_end else u if kind == "straight" and u < length else u * share

    for k, primitive in enumerate(draft.primitives):
        edited = edited.put(("primitives", k, "u"), placed(primitive["u"]))
    for path in (("cable", "point_masses"), ("loads",)):
        for k, part in enumerate(draft.get(path, [])):
            edited = edited.put((*path, k, "u"), placed(part["u"]))
    name = {"points": "points", "control_points": "control_points"}.get(kind)
    if name is None:
        return edited
    rows = np.array(draft.get(("shape", name)), dtype=float)
    width = min(rows.shape[1], 3)
    rows[:, :width] = rows[0, :width] + share * (rows[:, :width] - rows[0, :width])
    edited = edited.put(("shape", name), rows.tolist())
    knots = draft.get(("shape", "knots"))
    if knots is not None:
        spaced = share * np.array(knots, dtype=float)
        spaced[-4:] = length
        edited = edited.put(("shape", "knots"), spaced.tolist())
    return edited
