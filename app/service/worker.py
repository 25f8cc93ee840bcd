"""The solves that run or wait: a bounded number of worker threads, one solve each."""

import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from threading import Event

import anyio
import anyio.to_thread

from app.http.problems import ProblemError
from app.settings import Settings
from dlocore import Cancelled, Iteration, Prediction, Scene, predict
from dlocore.accuracy.cost import Cost
from dlocore.calibration import stored_cost

GRACE = 5.0  # s that a solve may take beyond its deadline, which it checks between steps
_MEMORY = 0.8  # weight of the past in the running mean of solve times


def nothing(*_: object) -> None:
    """Do nothing: the callback if none is needed."""


@dataclass
class Worker:
    """A bounded number of worker threads for solves. Use it from one event loop.

    A client's request is first admitted or refused. Admitted requests wait in order for a free worker.

    Args:
        workers: solves that run at once.
        queue_size: requests that may wait.
        time_limit: longest solve [s].
        calibration_file: file with the cost of solves on this machine; None: there is none.

    Attributes:
        running: number of solves that are running.
        admitted: number of requests that are running or waiting.
        closed: whether new requests are refused.
    """

    workers: int
    queue_size: int
    time_limit: float
    calibration_file: Path | None = None
    running: int = field(init=False, default=0)
    admitted: int = field(init=False, default=0)
    closed: bool = field(init=False, default=False)
    _limiter: anyio.CapacityLimiter = field(init=False)
    _under_way: set[Event] = field(init=False, default_factory=set)
    _stopped: bool = field(init=False, default=False)
    _mean_time: float = field(init=False, default=0.1)

    def __post_init__(self) -> None:
        self._limiter = anyio.CapacityLimiter(self.workers)

    @staticmethod
    def of(settings: Settings) -> "Worker":
        """Return the worker that `settings` describe."""
        return Worker(settings.workers, settings.queue_size, settings.time_limit, settings.calibration_file)

    @property
    def waiting(self) -> int:
        """Number of solves that wait for a worker."""
        return self._limiter.statistics().tasks_waiting

    def admit(self) -> None:
        """Take a place among the requests that run or wait; give it back with `release`.

        Raises:
            ProblemError: 429 if the queue is full, 503 if the service is shutting down.
        """
        if self.closed:
            raise ProblemError(503, "shutting-down", "The service is shutting down.", headers={"Retry-After": "5"})
        if self.admitted >= self.workers + self.queue_size:
            wait = max(1, math.ceil(self._mean_time * self.admitted / self.workers))
            detail = f"{self.admitted} solves are running or waiting, as many as allowed. Try again in {wait} s."
            raise ProblemError(429, "queue-full", detail, headers={"Retry-After": str(wait)})
        self.admitted += 1

    def release(self) -> None:
        """Give the place back."""
        self.admitted -= 1

    async def solve(
        self,
        scene: Scene,
        cancelled: Event,
        *,
        like: Prediction | None = None,
        on_start: Callable[[], None] = nothing,
        on_iteration: Callable[[Iteration], None] = nothing,
    ) -> Prediction:
        """Predict `scene` in a worker thread; the caller has been admitted.

        Args:
            scene: the scene.
            cancelled: set it to stop the solve.
            like: a similar prediction whose grid and error estimate are reused.
            on_start: called when a worker is free.
            on_iteration: called in the worker thread after every iteration.

        Raises:
            SceneError: the scene can't be solved as it was given.
            ProblemError: 503 if cancelled, 504 if the solve passed the time limit without an answer.
        """
        with self.stoppable(cancelled):
            async with self._limiter:
                on_start()
                self.running += 1
                try:
                    return await self._run(
                        lambda: predict(
                            scene,
                            like=like,
                            on_iteration=on_iteration,
                            deadline=self.time_limit,
                            cancelled=cancelled.is_set,
                            cost=self._cost(scene),
                        )
                    )
                finally:
                    self.running -= 1

    @contextmanager
    def stoppable(self, cancelled: Event) -> Iterator[None]:
        """Let `cancel_all` set the event during the context. Set it at the end, so that an abandoned thread stops.

        Raises:
            ProblemError: 503, everything has been cancelled.
        """
        if self._stopped:
            raise ProblemError(503, "cancelled", "The service is shutting down.")
        self._under_way.add(cancelled)
        try:
            yield
        finally:
            cancelled.set()
            self._under_way.discard(cancelled)

    def _cost(self, scene: Scene) -> Cost | None:
        if self.calibration_file is None or scene.quality.time_budget is None:
            return None
        return stored_cost(self.calibration_file)

    async def _run(self, solve: Callable[[], Prediction]) -> Prediction:
        began = time.perf_counter()
        try:
            with anyio.fail_after(self.time_limit + GRACE):
                return await anyio.to_thread.run_sync(solve, abandon_on_cancel=True, limiter=anyio.CapacityLimiter(1))
        except TimeoutError:
            detail = f"The solve took longer than the limit of {self.time_limit:g} s and gave no result."
            raise ProblemError(504, "time-limit", detail) from None
        except Cancelled:
            raise ProblemError(503, "cancelled", "The solve was cancelled.") from None
        finally:
            self._mean_time = _MEMORY * self._mean_time + (1 - _MEMORY) * (time.perf_counter() - began)

    def close(self) -> None:
        """Refuse new requests."""
        self.closed = True

    def cancel_all(self) -> None:
        """Stop everything that runs or waits, and everything that follows."""
        self._stopped = True
        for event in self._under_way:
            event.set()

    @property
    def busy(self) -> bool:
        """Whether anything runs or waits."""
        return self.admitted > 0 or bool(self._under_way)

    async def idle(self) -> None:
        """Wait until nothing runs or waits."""
        while self.busy:
            await anyio.sleep(0.02)
