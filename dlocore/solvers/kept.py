"""The states of a march that are kept: all of them, or one of every few if they would not all fit."""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from dlocore.kernels.predictor import ORDERS

Floats = NDArray[np.float64]

MOST_NUMBERS = 6.4e7  # of all states that are kept of a march: 0.5 GB
_BEHIND = ORDERS + 1  # states up to the one that was reached, from which the next is predicted


def rows_of(every: int, counts: list[int]) -> NDArray[np.int64]:
    """Return the steps that are kept: one in `every` in each stretch of `counts` steps, and its first and last."""
    ends = np.cumsum([0, *counts])
    inside = [np.arange(a, b, every) for a, b in pairwise(ends)]
    return np.concatenate([*inside, ends[-1:]])


class Kept:
    """The states of a march under way, and its log, of which every few rows are kept.

    Args:
        start: (n_u, nc) control points [m] at step 0.
        counts: steps of each stretch between two events.
        most_frames: control points times rows of the log, at most.
        columns: (points, columns) of a row of the log; (0, 0) for none.

    Attributes:
        steps: (rows,) whose states are kept.
        states: (rows, n_u, nc) control points [m] at them.
        log: (logged rows, points, columns) frames and memory at every few of them, and at the last.
    """

    def __init__(self, start: Floats, counts: list[int], most_frames: float, columns: tuple[int, int]) -> None:
        total = sum(counts) + 1
        self._every = max(1, int(-(-total * start.size // MOST_NUMBERS)))
        self.steps = rows_of(self._every, counts)
        rows = len(self.steps)
        self.states = np.empty((rows, *start.shape))
        self.states[0] = start
        self._every_log = max(1, int(-(-rows * len(start) // most_frames)))
        self.log = np.zeros((1 - -(rows - 1) // self._every_log if columns[1] else 0, *columns))
        self._behind = self.states[:1]  # the last states in consecutive steps, up to the one reached
        self._noted = self.log[:1]  # the last row of the log

    @property
    def thin(self) -> bool:
        """Whether not all states are kept."""
        return self._every > 1

    @property
    def now(self) -> Floats:
        """The state (n_u, nc) [m] at the step that was reached."""
        return self._behind[-1]

    def window(self, at: int, until: int, first: int) -> tuple[int, Floats, Floats]:
        """Return room for the states, and for the log, of the steps after `at`, the one reached, up to `until`.

        Returns:
            The step of its first row, not before `first`; states (k, n_u, nc) [m], with those up to `at` filled in; log
            (k, points, columns), or (0, 0, 0) if none is kept.
        """
        base = max(at - _BEHIND, first)
        rows = slice(base, until + 1)
        if self._every == 1:
            states = self.states[rows]
        else:
            states = np.empty((until - base + 1, *self.states.shape[1:]))
            known = at - base + 1
            states[:known] = self._behind[-known:]
        whole = len(self.log) in (0, len(self.states)) and self._every == 1
        log = self.log[rows] if whole else np.empty((len(states) if len(self.log) else 0, *self.log.shape[1:]))
        return base, states, log

    def keep(self, base: int, states: Floats, log: Floats, before: int, at: int) -> None:
        """Keep what is needed of the steps after `before` up to `at`, now the one reached, from a `window`."""
        self._behind = states[max(at - base - _BEHIND, 0) : at - base + 1]
        rows = np.arange(*np.searchsorted(self.steps, (before + 1, at + 1)))
        if self._every > 1:
            self.states[rows] = states[self.steps[rows] - base]
        if len(self.log) == 0:
            return
        self._noted = log[at - base : at - base + 1]
        if self._every_log > 1 or self._every > 1:
            logged = rows[(rows % self._every_log == 0) | (rows == len(self.steps) - 1)]
            self.log[-(-logged // self._every_log)] = log[self.steps[logged] - base]

    def knock(self, by: Floats, at: int) -> None:
        """Displace the state at the step `at` that was reached, the end of a stretch, by (n_u, nc) [m]."""
        self.now[:] += by
        self.states[np.searchsorted(self.steps, at)] = self.now

    def stand_still(self, reached: int) -> int:
        """Hold the last state from a step on; return the last row that is not after it."""
        last = int(np.searchsorted(self.steps, reached, side="right")) - 1
        self.states[last + 1 :] = self.now
        self.log[last // self._every_log + 1 :] = self._noted
        return last
