"""Edit the known forces of a draft, which act all the time or from one time until another."""

from dataclasses import dataclass, replace
from typing import Any

from app.viewer.draft import Draft
from app.viewer.rounding import rounded
from dlocore import SceneError

PATH = ("loads",)
RAMP = 1e-3  # s in which a force rises and falls
SHARE = 0.1  # of the cable's weight: size of a new force
GRAVITY = 9.81  # m/s^2
Vector = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class Pull:
    """A force `force` [N] that acts from `start` [s] until `end` [s], or to the end of the motion if `end` is 0."""

    force: Vector
    start: float = 0.0
    end: float = 0.0


def loads(draft: Draft) -> list[dict[str, Any]]:
    """Return the known forces of the document."""
    found: list[dict[str, Any]] = draft.get(PATH, [])
    return found


def pull(load: dict[str, Any]) -> Pull | None:
    """Return a load of the document as a force that acts for a while; None if it changes in another way."""
    force = load["force"]
    if not isinstance(force, dict):
        return Pull(force=_vector(force))
    times, values = force["times"], [_vector(value) for value in force["values"]]
    for end in (0.0, times[-1]):
        if len(values) > 1:
            found = Pull(force=values[1], start=max(times[1], 0.0), end=end)
            if _force(found) == {"times": times, "values": [list(value) for value in values]}:
                return found
    return None


def _force(wanted: Pull) -> Any:
    """Return a force in the form of the document: a vector, or values over time."""
    if wanted.start <= 0.0 and wanted.end <= 0.0:
        return list(wanted.force)
    times, values = [wanted.start - RAMP, wanted.start], [[0.0, 0.0, 0.0], list(wanted.force)]
    if wanted.end > 0.0:
        times += [wanted.end - RAMP, wanted.end]
        values += [list(wanted.force), [0.0, 0.0, 0.0]]
    return {"times": [rounded(time) for time in times], "values": values}


def added(draft: Draft) -> Draft:
    """Add a sideways pull of a tenth of the cable's weight, at its middle or at an end, away from the grippers."""
    try:
        weight = GRAVITY * draft.cable().mass
    except SceneError:  # an impossible cable has to be corrected first
        return draft
    held = [primitive["u"] for primitive in draft.primitives]
    places = [draft.length, 0.5 * draft.length, 0.0]
    u = max(places, key=lambda place: min((abs(place - other) for other in held), default=0.0))
    load = {"u": rounded(u), "force": [0.0, rounded(SHARE * weight, 2), 0.0]}
    return draft.put(PATH, [*loads(draft), load])


def removed(draft: Draft, number: int) -> Draft:
    """Remove a force."""
    return draft.put(PATH, [load for k, load in enumerate(loads(draft)) if k != number] or None)


def placed(draft: Draft, number: int, u: float) -> Draft:
    """Let a force act at `u` [m]."""
    u = rounded(min(u, draft.length))
    return draft.put((*PATH, number, "u"), u) if number < len(loads(draft)) else draft


def changed(draft: Draft, number: int, **parts: Any) -> Draft:
    """Change `force`, `start` or `end` of a force that acts for a while; other loads stay as they are."""
    before = pull(loads(draft)[number]) if number < len(loads(draft)) else None
    return draft if before is None else draft.put((*PATH, number, "force"), _force(replace(before, **parts)))


def _vector(values: Any) -> Vector:
    x, y, z = (float(value) for value in values)
    return x, y, z
