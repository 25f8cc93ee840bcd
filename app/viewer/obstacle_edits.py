"""Edit the obstacles of a draft."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.viewer.draft import Draft

Floats = NDArray[np.float64]
PATH = ("environment", "obstacles")
PLACE = (0.55, 0.2)  # x, y of a new obstacle, as shares of the cable's length
GAP = 0.02  # of the cable's length: smallest gap between a new obstacle and its neighbours


def obstacles(draft: Draft) -> list[dict[str, Any]]:
    """Return the obstacles of the document."""
    found: list[dict[str, Any]] = draft.get(PATH, [])
    return found


def added(draft: Draft, kind: str) -> Draft:
    """Add an obstacle of a size that suits the cable, on the table if there is one, clear of all others.

    Spheres and capsules are sunk to half their height, so that the cable meets them where they are widest. Few given
    grids resolve a contact, so a given grid is replaced by automatic quality.
    """
    size = draft.length
    x, y, z = PLACE[0] * size, PLACE[1] * size, float(draft.get(("environment", "table", "height"), 0.0))
    bodies: dict[str, dict[str, Any]] = {
        "cylinder": {"center": [x, y, z + 0.05 * size], "radius": 0.03 * size, "height": 0.12 * size},
        "box": {"center": [x, y, z + 0.03 * size], "size": [0.1 * size, 0.06 * size, 0.08 * size]},
        "sphere": {"center": [x, y, z], "radius": 0.04 * size},
        "capsule": {"start": [x - 0.08 * size, y, z], "end": [x + 0.08 * size, y, z], "radius": 0.025 * size},
    }
    body = {"kind": kind, **bodies[kind]}
    count = len(obstacles(draft))
    edited = draft.put(PATH, [*obstacles(draft), body])
    edited = moved(edited, count, _beside(obstacles(draft), body, GAP * size))
    return edited.put(("quality",), "auto") if "n_u" in (draft.get(("quality",)) or {}) else edited


def _beside(others: list[dict[str, Any]], body: dict[str, Any], gap: float) -> Floats:
    """Return the centre of `body` (3,) [m], moved along y until it leaves a gap [m] to all others."""
    place = centre(body)
    while True:
        ends = []
        for other in others:
            away = place - centre(other)
            apart = _reach(body) + _reach(other) + gap
            if float(np.linalg.norm(away)) < apart * (1.0 - 1e-9):
                ends.append(centre(other)[1] + np.sqrt(apart**2 - away[0] ** 2 - away[2] ** 2))
        if not ends:
            return place
        place[1] = np.ceil(1e3 * max(ends)) / 1e3  # a whole millimetre, for readers of the document


def _reach(body: dict[str, Any]) -> float:
    """Return the radius of the sphere about the centre of an obstacle that encloses it [m]."""
    if body["kind"] == "box":
        return 0.5 * float(np.linalg.norm(body["size"]))
    if body["kind"] == "sphere":
        return float(body["radius"])
    if body["kind"] == "capsule":
        return 0.5 * length(body) + float(body["radius"])
    return float(np.hypot(0.5 * length(body), body["radius"]))


def removed(draft: Draft, number: int) -> Draft:
    """Remove an obstacle."""
    return draft.put(PATH, [body for k, body in enumerate(obstacles(draft)) if k != number])


def changed(draft: Draft, number: int, name: str, value: Any) -> Draft:
    """Set a field of an obstacle."""
    return draft.put((*PATH, number, name), value) if number < len(obstacles(draft)) else draft


def centre(body: dict[str, Any]) -> Floats:
    """Return the centre of an obstacle (3,) [m]."""
    if body["kind"] == "capsule":
        return 0.5 * np.add(body["start"], body["end"])
    return np.array(body["center"], dtype=float)


def moved(draft: Draft, number: int, to: Floats) -> Draft:
    """Move the centre of an obstacle to a point (3,) [m]."""
    if number >= len(obstacles(draft)):
        return draft
    body = obstacles(draft)[number]
    if body["kind"] != "capsule":
        return changed(draft, number, "center", [float(x) for x in to])
    shift = np.asarray(to) - centre(body)
    for end in ("start", "end"):
        draft = changed(draft, number, end, np.add(body[end], shift).tolist())
    return draft


def length(body: dict[str, Any]) -> float:
    """Return the length of a cylinder, or of the segment of a capsule [m]."""
    if body["kind"] == "capsule":
        return float(np.linalg.norm(np.subtract(body["end"], body["start"])))
    return float(body["height"])


def lengthened(draft: Draft, number: int, wanted: float) -> Draft:
    """Change the length [m] of a cylinder, or of the segment of a capsule, about its centre.

    A length that is not positive changes nothing, since a capsule of no length would lose its direction.
    """
    if number >= len(obstacles(draft)) or wanted <= 0.0:
        return draft
    body = obstacles(draft)[number]
    if body["kind"] != "capsule":
        return changed(draft, number, "height", wanted)
    middle, before = centre(body), max(length(body), 1e-9)
    for end in ("start", "end"):
        draft = changed(draft, number, end, (middle + np.subtract(body[end], middle) * wanted / before).tolist())
    return draft
