"""The only mutable state of the service: how many solves run and wait."""

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from threading import Event

import anyio
import anyio.to_thread

from app.problems import ProblemError
from app.settings import Settings
from dlocore import Cancelled, Prediction, Scene, predict

GRACE = 5.0  # s that a solve may take beyond its deadline, which it looks at between steps
_MEMORY = 0.8  # weight of the past in the running mean of solve times


@dataclass
class Worker:
    """Bounded worker threads for solves. Use it from one event loop.

    Args:
        workers: solves that run at once.
        queue_size: solves that may wait.
        time_limit: longest solve [s].
    """

    workers: int
    queue_size: int
    time_limit: float
    _limiter: anyio.CapacityLimiter = field(init=False)
    _running: set[Event] = field(init=False, default_factory=set)
    _pending: int = field(init=False, default=0)
    _mean_time: float = field(init=False, default=0.1)
    _closed: bool = field(init=False, default=False)

    def __post_init__(self) -> None:
        self._limiter = anyio.CapacityLimiter(self.workers)

    @staticmethod
    def of(settings: Settings) -> "Worker":
        """Return the worker that `settings` describe."""
        return Worker(settings.workers, settings.queue_size, settings.time_limit)

    async def solve(self, scene: Scene, cancelled: Event) -> Prediction:
        """Predict `scene` in a worker thread.

        Args:
            scene: the scene.
            cancelled: set it to stop the solve.

        Raises:
            ProblemError: 429 where the queue is full, 503 when cancelled or shutting down, 504 where the solve went
                on past the time limit without an answer.
        """
        if self._closed:
            raise ProblemError(503, "shutting-down", "The service is shutting down.", headers={"Retry-After": "5"})
        if self._pending >= self.workers + self.queue_size:
            wait = max(1, math.ceil(self._mean_time * self._pending / self.workers))
            detail = f"{self._pending} solves are under way or waiting, as many as allowed. Try again in {wait} s."
            raise ProblemError(429, "queue-full", detail, headers={"Retry-After": str(wait)})
        with self._counted(cancelled):
            async with self._limiter:
                return await self._run(lambda: predict(scene, deadline=self.time_limit, cancelled=cancelled.is_set))

    async def _run(self, solve: Callable[[], Prediction]) -> Prediction:
        began = time.perf_counter()
        try:
            with anyio.fail_after(self.time_limit + GRACE):
                return await anyio.to_thread.run_sync(solve, abandon_on_cancel=True, limiter=anyio.CapacityLimiter(1))
        except TimeoutError:
            detail = f"The solve took longer than the limit of {self.time_limit:g} s and gave nothing to offer."
            raise ProblemError(504, "time-limit", detail) from None
        except Cancelled:
            raise ProblemError(503, "cancelled", "The solve was cancelled.") from None
        finally:
            self._mean_time = _MEMORY * self._mean_time + (1 - _MEMORY) * (time.perf_counter() - began)

    @contextmanager
    def _counted(self, cancelled: Event) -> Iterator[None]:
        self._pending += 1
        self._running.add(cancelled)
        try:
            yield
        finally:
            cancelled.set()  # a thread left behind stops at its next step
            self._running.discard(cancelled)
            self._pending -= 1

    def close(self) -> None:
        """Cancel every solve and refuse new ones."""
        self._closed = True
        for event in self._running:
            event.set()
