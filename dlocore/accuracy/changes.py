"""Error estimates from the changes between one grid and a finer one."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from dlocore.levels.level import Level
from dlocore.solvers.march import STRONGLY_DAMPED
from dlocore.solvers.timefit import MISSED_COUNTS

_LEFT = 0.45  # of the change by doubled steps: the error that remains; 1/3 in theory: benchmarks.estimate
_LEFT_KINKED = 0.9  # the same for a `kinked` march; it would be 1 if its steps were of first order
_LEFT_ALONG = 0.75  # the same for half as many control points again
_MOST_LEFT = 1.5  # times the last change: the largest estimate that is made from changes that hardly shrink
_MOST_FALL = 20.0  # a change may be at most this many times smaller than the one before: more is chance
# ... if strong damping begins with it: its errors are about those of half as many steps without, as on the grid
# before, so the two may agree because they err alike. A third of the previous change is left in both.
_MOST_FALL_DAMPED = 3.0 * _LEFT_KINKED
_MOST_FALL_YIELDING = 4.0  # ... if the cable yields: it is bent for good within a span, which coarse grids can't show
_MOST_FALL_RISEN = 3.0  # ... for a refinement in both directions after one that had risen: they are in no order yet
MORE = 1.1  # times as many steps, or control points: fewer count as the same
_STALE = 2.0  # times the change by a refinement in one direction: once those in the other moved the surface more,
# the error left in the first is measured again
_RISES = 2.0  # times the last change in both directions: the first one in one direction is in no order yet
DIRECTIONS = "space", "time"


class Change(NamedTuple):
    """How far a refinement moved the surface.

    Attributes:
        moved: by this refinement, scaled to at least twice the steps [m].
        before: by the previous one in the same direction [m]; infinite if there is none.
        left: the share of it that is left as error in theory, or more.
        fall: how many times smaller than the previous change this one is believed to be, at most.
    """

    moved: float
    before: float
    left: float
    fall: float = _MOST_FALL

    @property
    def error(self) -> float:
        """The error [m] that the change indicates.

        If changes shrink less than expected from one refinement to the next, the sum of those to come is larger than
        the theoretical share: c/(1 - c), c = moved/before. If they shrink far more, two grids may agree by chance.
        """
        known = 0.0 < self.before < np.inf
        contraction = self.moved / self.before if known else 0.0
        to_come = contraction / (1.0 - contraction) if contraction < 1.0 else np.inf
        moved = max(self.moved, self.before / self.fall) if known else self.moved
        return moved * max(self.left, min(to_come, _MOST_LEFT))


def weighed(level: Level, before: Level, last: Change | None, first: bool = False) -> Change:
    """Return the change from one level to the next, which has more steps, more control points or both.

    Args:
        level: the finer one.
        before: the coarser one.
        last: the change of the previous refinement in the same direction.
        first: whether it is not yet known if changes shrink. Steps that may err by first order need not do so on coarse
            grids, and two of these agree by chance.
    """
    moved_before = np.inf if last is None else last.moved
    more = level.motion.steps / before.motion.steps
    yields = level.problem.choices["plasticity"].active
    falls = [_MOST_FALL]
    if yields:
        falls.append(_MOST_FALL_YIELDING)
    if last is not None and last.before < last.moved and refined(level, before) == "both":
        falls.append(_MOST_FALL_RISEN)
    if more <= MORE:
        return Change(level.change, moved_before, _LEFT_ALONG, min(falls))
    # the errors of the steps are of second order: doubling the steps removes three times what it leaves
    counts = max(1.0, 3.0 / (more**2 - 1.0))
    damped, was_damped = (x.motion.rho == STRONGLY_DAMPED for x in (level, before))
    if damped and not was_damped:
        falls.append(_MOST_FALL_DAMPED)
    left = _MOST_LEFT if first else _LEFT_KINKED
    return Change(counts * level.change, moved_before, left if level.motion.kinked else _LEFT, min(falls))


def refined(level: Level, before: Level) -> str:
    """Return in which direction a level is finer than the one before: "space", "time", or "both"."""
    if level.motion.grid.n_u <= MORE * before.motion.grid.n_u:
        return "time"
    return "both" if level.motion.steps > MORE * before.motion.steps else "space"


def untold(level: Level) -> dict[str, float]:
    """Return the errors of a level that other grids hardly show, by the direction that reduces them [m].

    In time they are the misfit of its time spline and the steps of trembling paths. In space it is how far ends whose
    direction is held keep a stretched cable from its true position.
    """
    return {"space": level.held_back, "time": max(MISSED_COUNTS * level.missed, level.unseen)}


def with_untold(parts: Mapping[str, float], level: Level) -> dict[str, float]:
    """Return parts of an error [m]; the last one is raised if their sum is less than what is `untold`."""
    parts = dict(parts)
    parts[list(parts)[-1]] += max(0.0, max(untold(level).values()) - sum(parts.values()))
    return parts


class Changes:
    """How far refinements moved the surface, by direction: "space", "time", or "both" at once.

    Attributes:
        last: the change of the last refinement in each direction.
        since: by direction, how far other refinements have moved the surface since then, at most [m].
    """

    def __init__(self, last: Mapping[str, Change] | None = None) -> None:
        self.last: dict[str, Change] = dict(last or {})
        self.since: dict[str, float] = {}

    def note(self, direction: str, level: Level, before: Level) -> None:
        """Record that a refinement in a direction led from one level to the next.

        The first one in a single direction is not yet converging if it moves the surface far more than the last one in
        both did.
        """
        last, both = self.last.get(direction), self.last.get("both")
        if last is None and both is not None and _RISES * both.moved < level.change:
            last = both
        self.last[direction] = weighed(level, before, last, not self.last)
        self.since = {d: max(self.since.get(d, 0.0), level.change) for d in self.last if d != direction}

    @property
    def error(self) -> float:
        """The error [m] they indicate: of the whole grid, or of both directions once both are known; else infinite."""
        if self._apart:
            return sum(self.last[direction].error for direction in DIRECTIONS)
        return self.last["both"].error if "both" in self.last else np.inf

    def estimate(self, level: Level) -> float:
        """Return the error [m] of the last level."""
        return max(self.error, *untold(level).values())

    def parts(self, level: Level) -> dict[str, float] | None:
        """Return the parts of that error [m], space and time separate as far as they are known; None if unknown."""
        if not np.isfinite(self.error):
            return None
        known = DIRECTIONS if self._apart else ("both",)
        parts = {"grid" if direction == "both" else direction: self.last[direction].error for direction in known}
        return with_untold(parts, level)

    def worst(self) -> str:
        """Return the direction to refine: time first, then space, then the one with the larger error."""
        unknown = [direction for direction in ("time", "space") if direction not in self.last]
        return unknown[0] if unknown else max(DIRECTIONS, key=lambda direction: self.last[direction].error)

    def stale(self, target: float) -> list[str]:
        """Return the directions whose last refinement says little about the current grid.

        Refinements in the other directions have since moved the surface by several times as much, and by more than the
        target [m].
        """
        known = [direction for direction in DIRECTIONS if direction in self.last]
        return [d for d in known if self.since.get(d, 0.0) > max(_STALE * self.last[d].moved, target)]

    @property
    def _apart(self) -> bool:
        return all(direction in self.last for direction in DIRECTIONS)
