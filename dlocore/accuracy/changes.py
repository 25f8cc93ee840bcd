"""What error the changes from one grid to a finer one point to."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from dlocore.levels.level import Level
from dlocore.solvers.march import STRONGLY_DAMPED
from dlocore.solvers.timefit import MISSED_COUNTS

_LEFT = 0.45  # of what twice as many steps moved the surface by, is left; 1/3 in theory: benchmarks.estimate
_LEFT_KINKED = 0.9  # the same of a `kinked` march; 1 were its steps of first order
_LEFT_ALONG = 0.75  # the same of half as many control points again
_MOST_LEFT = 1.5  # times the last change: what is believed of changes that hardly shrink
_MOST_FALL = 20.0  # times less than the refinement before, at most, is believed of one: more is chance
# ... where strong damping begins with it: its errors are about those of half as many steps without, which the grid
# before has, so that these two may agree as they err alike. A third of what that was moved by is left in both.
_MOST_FALL_DAMPED = 3.0 * _LEFT_KINKED
_MOST_FALL_YIELDING = 4.0  # ... where the cable yields: it is bent for good within a span, which coarse grids lack
_MOST_FALL_RISEN = 3.0  # ... of one in both directions where that before it had risen: they are in no order yet
MORE = 1.1  # times as many steps, or control points: fewer are as many
_STALE = 2.0  # times what a refinement in one direction moved the surface by: once those in the other moved it by more,
# what the first has left is measured again
_RISES = 2.0  # times as far as the last refinement in both directions: the first one in one of them is in no order
DIRECTIONS = "space", "time"


class Change(NamedTuple):
    """How far a refinement moved the surface.

    Attributes:
        moved: by this one, as if it had twice the steps at least [m].
        before: by the one before it in the same direction [m], infinite where there is none.
        left: share of it that is left in theory, or more.
        fall: times less than the one before it that this one is believed to be, at most.
    """

    moved: float
    before: float
    left: float
    fall: float = _MOST_FALL

    @property
    def error(self) -> float:
        """The error [m] that it points to.

        Where changes shrink by less than expected from one refinement to the next, the sum of those to come is larger
        than the share that is left in theory: c/(1 - c), c = moved/before. Where they shrink by far more, two grids
        may agree by chance.
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
        last: the change of the refinement before in the same direction.
        first: nothing is known yet of whether changes shrink. Where steps may err by first order they may not on coarse
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
    # the errors of the steps are of second order: what twice as many take away is three times what they leave
    counts = max(1.0, 3.0 / (more**2 - 1.0))
    damped, was_damped = (x.motion.rho == STRONGLY_DAMPED for x in (level, before))
    if damped and not was_damped:
        falls.append(_MOST_FALL_DAMPED)
    left = _MOST_LEFT if first else _LEFT_KINKED
    return Change(counts * level.change, moved_before, left if level.motion.kinked else _LEFT, min(falls))


def refined(level: Level, before: Level) -> str:
    """Return in which direction a level has more than the one before: "space", "time", or "both"."""
    if level.motion.grid.n_u <= MORE * before.motion.grid.n_u:
        return "time"
    return "both" if level.motion.steps > MORE * before.motion.steps else "space"


def untold(level: Level) -> dict[str, float]:
    """Return what no other grid tells of a level, or too little, by the direction in which a finer one mends it [m].

    In time that is what its time spline misses, and its steps of trembling paths; in space how far ends whose direction
    is held keep a stretched cable from where it would be.
    """
    return {"space": level.held_back, "time": max(MISSED_COUNTS * level.missed, level.unseen)}


def with_untold(parts: Mapping[str, float], level: Level) -> dict[str, float]:
    """Return parts of an error [m], the last one larger where their sum is less than what is `untold`."""
    parts = dict(parts)
    parts[list(parts)[-1]] += max(0.0, max(untold(level).values()) - sum(parts.values()))
    return parts


class Changes:
    """How far refinements moved the surface, by direction: "space", "time", or "both" at once.

    Attributes:
        last: what the last refinement in each direction did.
        since: by direction, how far others have moved the surface at most since then [m].
    """

    def __init__(self, last: Mapping[str, Change] | None = None) -> None:
        self.last: dict[str, Change] = dict(last or {})
        self.since: dict[str, float] = {}

    def note(self, direction: str, level: Level, before: Level) -> None:
        """Note that a refinement in a direction took one level to the next.

        The first one in a direction alone is not yet on the way to a limit if it moves the surface by far more than the
        last one in both did.
        """
        last, both = self.last.get(direction), self.last.get("both")
        if last is None and both is not None and _RISES * both.moved < level.change:
            last = both
        self.last[direction] = weighed(level, before, last, not self.last)
        self.since = {d: max(self.since.get(d, 0.0), level.change) for d in self.last if d != direction}

    @property
    def error(self) -> float:
        """The error [m] they point to: of the whole grid, or of both directions once both are known; else infinite."""
        if self._apart:
            return sum(self.last[direction].error for direction in DIRECTIONS)
        return self.last["both"].error if "both" in self.last else np.inf

    def estimate(self, level: Level) -> float:
        """Return the error [m] of the last level."""
        return max(self.error, *untold(level).values())

    def parts(self, level: Level) -> dict[str, float] | None:
        """Return the parts of that error [m], space and time as far as they are known apart, or None."""
        if not np.isfinite(self.error):
            return None
        known = DIRECTIONS if self._apart else ("both",)
        parts = {"grid" if direction == "both" else direction: self.last[direction].error for direction in known}
        return with_untold(parts, level)

    def worst(self) -> str:
        """Return the direction to refine: time, then space, then that which erred more."""
        unknown = [direction for direction in ("time", "space") if direction not in self.last]
        return unknown[0] if unknown else max(DIRECTIONS, key=lambda direction: self.last[direction].error)

    def stale(self, target: float) -> list[str]:
        """Return the directions whose last refinement tells little of the grid at hand.

        The others have since moved the surface by several times as much, and by more than the target [m].
        """
        known = [direction for direction in DIRECTIONS if direction in self.last]
        return [d for d in known if self.since.get(d, 0.0) > max(_STALE * self.last[d].moved, target)]

    @property
    def _apart(self) -> bool:
        return all(direction in self.last for direction in DIRECTIONS)
