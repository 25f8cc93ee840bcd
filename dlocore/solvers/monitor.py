"""Deadline, cancellation and progress of one solve, checked between its iterations."""

import time
from collections.abc import Callable

from dlocore.answer.parts import Iteration, OnIteration
from dlocore.compiling.interrupts import let_in
from dlocore.errors import Cancelled, number


class TimeIsUp(Exception):  # noqa: N818 - not an error: the solver answers with what it has
    """The deadline of a solve has passed; the solver answers with what it has.

    Its arguments name the effects that a motion was found to call for and that there was no time to march with.
    """


def time_allowed(deadline: float | None) -> float | None:
    """Return `deadline` [s]; raise SceneError unless it is None or a number of at least 0."""
    return None if deadline is None else number("deadline", deadline, at_least=0.0, unit="s")


class Monitor:
    """Clock and messages of one solve."""

    def __init__(
        self,
        on_iteration: OnIteration | None = None,
        deadline: float | None = None,
        cancelled: Callable[[], bool] | None = None,
    ) -> None:
        self.began = time.perf_counter()
        self.iterations: list[Iteration] = []
        self.phases: dict[str, float] = {}
        self._mark = self.began
        self._on_iteration = on_iteration
        self._end = None if deadline is None else self.began + deadline
        self._cancelled = cancelled

    def elapsed(self) -> float:
        """Time since the solve began [s]."""
        return time.perf_counter() - self.began

    def remaining(self) -> float:
        """Time to the deadline [s]."""
        return float("inf") if self._end is None else self._end - time.perf_counter()

    def within(self, time: float) -> "Monitor":
        """Return a monitor of a part of the solve, which has `time` [s] from now on, but no more than the whole."""
        return Monitor(deadline=min(time, self.remaining()), cancelled=self._cancelled)

    def end_within(self, time: float) -> None:
        """Set the deadline no later than `time` [s] after the solve began."""
        end = self.began + time
        if end < float("inf"):
            self._end = end if self._end is None else min(end, self._end)

    def check(self) -> None:
        """Raise Cancelled if the caller asked to stop, TimeIsUp if the deadline has passed; let interrupts in."""
        let_in()
        if self._cancelled is not None and self._cancelled():
            raise Cancelled("the solve was cancelled")
        if self._end is not None and time.perf_counter() > self._end:
            raise TimeIsUp

    def phase(self, name: str) -> None:
        """Book the time since the last call under `name`."""
        now = time.perf_counter()
        self.phases[name] = self.phases.get(name, 0.0) + now - self._mark
        self._mark = now

    def report(self, iteration: Iteration) -> None:
        """Record an iteration and pass it on."""
        self.iterations.append(iteration)
        if self._on_iteration is not None:
            self._on_iteration(iteration)
