"""Predictions under way: their state, their progress for clients that follow it, and their end."""

from collections.abc import AsyncIterator
from dataclasses import dataclass, field
from threading import Event
from typing import Any, ClassVar, Literal

import anyio

from app.http.problems import ProblemError, document_of
from app.schemas.ids import created_of, new_id
from app.schemas.response import job_links
from dlocore import MaterialMotion

State = Literal["queued", "running", "done", "failed", "cancelled"]
MAX_FINISHED = 256  # jobs without a stored run that are remembered after their end
MAX_BYTES = 256_000_000  # of their answers
HEARTBEAT = 15.0  # s without events after which a follower is sent a sign that the connection is alive
CANCEL_TIME = 1.0  # s to wait for a cancelled job to stop; a solve notices within about 0.1 s


@dataclass(eq=False)
class Job:
    """One prediction from the request to its end. Use it from the event loop; only `cancelled` crosses threads.

    Attributes:
        store: whether the run is to be stored; at the end, whether it is stored.
        id: id of the run.
        state: its state.
        iterations: the documents of the iterations so far.
        document: the answer as JSON.
        material: what the sections of the cable remember.
        problem: why there is no answer.
        beyond_limit: whether the answer is the best iterate within the time limit of the service.
        cancelled: set by `cancel`.
        finished: set at the end.
    """

    EVENT: ClassVar[str] = "iteration"  # name of the events for items of `iterations`

    store: bool
    id: str = field(default_factory=new_id)
    state: State = "queued"
    iterations: list[dict[str, Any]] = field(default_factory=list)
    document: bytes | None = None
    material: MaterialMotion | None = None
    problem: ProblemError | None = None
    beyond_limit: bool = False
    cancelled: Event = field(default_factory=Event)
    finished: anyio.Event = field(default_factory=anyio.Event)
    scope: anyio.CancelScope = field(default_factory=anyio.CancelScope)
    _changed: anyio.Event = field(default_factory=anyio.Event)

    @property
    def created(self) -> str:
        """When it was requested, ISO 8601 in UTC."""
        return created_of(self.id)

    @property
    def mark(self) -> str:
        """Prefix of the numbers of its events: none, since no other job has its address."""
        return ""

    @property
    def size(self) -> int:
        """Bytes of its answer, as far as the job holds it."""
        arrays = () if self.material is None else vars(self.material).values()
        return len(self.document or b"") + sum(array.nbytes for array in arrays)

    def not_done(self, when: str, field: str = "") -> ProblemError:
        """Return the problem of a request for what it does not have (yet); `when` says which have it, or when."""
        detail = f"{field and f'{field}: '}The prediction is {self.state}; {when}."
        return ProblemError(409, "not-done", detail, headers={} if self.finished.is_set() else {"Retry-After": "1"})

    def cancel(self) -> None:
        """Stop it: at once if it is queued, at the solver's next check if it is running."""
        self.cancelled.set()
        if self.state == "queued":
            self.scope.cancel()

    async def stop(self) -> None:
        """Cancel it, and give it a moment to end; `finished` says whether it has ended."""
        self.cancel()
        with anyio.move_on_after(CANCEL_TIME):
            await self.finished.wait()

    def begin(self) -> None:
        """Record that a worker has started it."""
        self.state = "running"
        self._tell()

    def add(self, iteration: dict[str, Any]) -> None:
        """Record an iteration."""
        self.iterations.append(iteration)
        self._tell()

    def end(self, state: State, problem: ProblemError | None = None) -> None:
        """Record the end."""
        self.state = state
        self.problem = problem
        self.finished.set()
        self._tell()

    def _tell(self) -> None:
        changed, self._changed = self._changed, anyio.Event()
        changed.set()

    async def progress(self, seen: int = 0) -> AsyncIterator[State | dict[str, Any] | None]:
        """Yield each state, and each iteration after the first `seen`, past ones first, until the end.

        None means that nothing has happened for a while.
        """
        shown: State | None = None
        while True:
            changed = self._changed  # taken before the checks below, so that no change in between is missed
            if shown is None or (self.state == "running" and shown == "queued"):
                shown = self.state
                yield shown
            elif seen < len(self.iterations):
                seen += 1
                yield self.iterations[seen - 1]
            elif self.finished.is_set():
                return
            elif changed is self._changed:
                with anyio.move_on_after(HEARTBEAT) as waiting:
                    await changed.wait()
                if waiting.cancelled_caught:
                    yield None

    def summary(self) -> dict[str, Any]:
        """Return its state as a document."""
        return {
            **self.item(),
            "iterations": self.iterations,
            "problem": None if self.problem is None else document_of(self.problem),
        }

    def item(self) -> dict[str, Any]:
        """Return its entry in a list."""
        return {"id": self.id, "created": self.created, "state": self.state, "links": job_links(self.id)}


class Jobs:
    """The jobs without a stored run: under way, failed, cancelled, or not to be stored."""

    def __init__(self) -> None:
        self._jobs: dict[str, Job] = {}

    def add(self, job: Job) -> None:
        """Remember a job; forget the oldest finished ones beyond the limits."""
        self._jobs[job.id] = job
        finished = [kept for kept in self._jobs.values() if kept.finished.is_set()]
        total = sum(kept.size for kept in finished)
        while len(finished) > MAX_FINISHED or total > MAX_BYTES:
            oldest = finished.pop(0)
            total -= oldest.size
            del self._jobs[oldest.id]

    def get(self, id: str) -> Job | None:
        """Return a job, or None."""
        return self._jobs.get(id)

    def under_way(self) -> list[Job]:
        """Return those that are running or waiting, newest first."""
        return [job for job in reversed(self._jobs.values()) if not job.finished.is_set()]

    def forget(self, id: str) -> bool:
        """Forget a job; return whether it was there."""
        return self._jobs.pop(id, None) is not None

    def cancel_all(self) -> None:
        """Cancel what is under way."""
        for job in list(self._jobs.values()):
            if not job.finished.is_set():
                job.cancel()
