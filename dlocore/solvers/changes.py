"""What error the change from one grid to a finer one points to."""

from typing import NamedTuple

import numpy as np

from dlocore.solvers.ladder import Level
from dlocore.solvers.march import STRONGLY_DAMPED

_LEFT = 0.45  # of what twice as many steps moved the surface by, is left; 1/3 in theory: benchmarks.estimate
_LEFT_KINKED = 0.9  # the same of a `kinked` march; 1 were its steps of first order
_LEFT_ALONG = 0.75  # the same of half as many control points again
_MOST_LEFT = 1.5  # times the last change: what is believed of changes that hardly shrink
_MOST_FALL = 20.0  # times less than the refinement before, at most, is believed of one: more is chance
# ... where strong damping begins with it, whose errors are about those of half as many steps without: 6 in theory
_MOST_FALL_DAMPED = 8.0
_MORE = 1.1  # times as many steps: fewer are as many


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
    if more <= _MORE:
        return Change(level.change, moved_before, _LEFT_ALONG)
    # the errors of the steps are of second order: what twice as many take away is three times what they leave
    counts = max(1.0, 3.0 / (more**2 - 1.0))
    damped, was_damped = (x.motion.rho == STRONGLY_DAMPED for x in (level, before))
    fall = _MOST_FALL_DAMPED if damped and not was_damped else _MOST_FALL
    left = _MOST_LEFT if first else _LEFT_KINKED
    return Change(counts * level.change, moved_before, left if level.motion.kinked else _LEFT, fall)
