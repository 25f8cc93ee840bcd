"""Identifications of cables: one runs at a time, a few may wait, and each has the time limit of a solve."""

import math
import time
from collections.abc import Callable, Sequence
from threading import Event
from typing import Any

import anyio
import anyio.to_thread

from app.http.problems import ProblemError
from app.service.worker import Worker
from dlocore import Cancelled
from dlocore.errors import calculable
from dlocore.identify import Identification, identify
from dlocore.recordings import Recording

WAITING = 8  # searches that may wait for the one that runs


class Searches:
    """The searches of the API and of all tabs of the 3D scene. Use it from one event loop.

    Args:
        worker: gives their time limit, and stops them when it is stopped.
    """

    def __init__(self, worker: Worker) -> None:
        self._worker = worker
        self._one_at_a_time = anyio.CapacityLimiter(1)

    def check_room(self) -> None:
        """Raise a 429 problem if no further search may wait."""
        if self._one_at_a_time.statistics().tasks_waiting >= WAITING:
            raise ProblemError(
                429, "queue-full", "Too many identifications are waiting.", headers={"Retry-After": "30"}
            )

    async def identify(
        self, recordings: Sequence[Recording], cancelled: Callable[[], bool], **options: Any
    ) -> Identification:
        """Identify a cable in a thread when it is its turn.

        Args:
            recordings: the recordings of the cable.
            cancelled: returns whether to stop; called from the thread.
            options: further arguments of `dlocore.identify.identify`.

        Raises:
            SceneError: the recordings or the options can't be used.
            ProblemError: 429 if too many wait, 503 if cancelled, 504 at the time limit.
        """
        self.check_room()
        stopped, ends = Event(), math.inf

        def stop() -> bool:
            return stopped.is_set() or cancelled() or time.monotonic() > ends

        def search() -> Identification:
            nonlocal ends
            ends = time.monotonic() + self._worker.time_limit
            allowed = "a cable of usual size, moved by what holds it"
            with calculable("recordings", "markers", allowed, "They can't be replayed"):
                return identify(recordings, cancelled=stop, **options)

        try:
            with self._worker.stoppable(stopped):
                return await anyio.to_thread.run_sync(search, abandon_on_cancel=True, limiter=self._one_at_a_time)
        except Cancelled:
            if time.monotonic() < ends:
                raise ProblemError(503, "cancelled", "The identification was cancelled.") from None
            limit = f"the limit of {self._worker.time_limit:g} s"
            detail = f"The identification took longer than {limit}. Give it a shorter recording."
            raise ProblemError(504, "time-limit", detail) from None
