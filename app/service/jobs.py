"""Predictions under way: their state, their progress for whoever follows it, and their end."""

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
MAX_FINISHED = 256  # jobs remembered after their end, where no stored run stands for them
MAX_BYTES = 256_000_000  # of their answers
HEARTBEAT = 15.0  # s without news after which a follower hears that the connection is alive
CANCEL_TIME = 1.0  # s to wait for a cancelled job to stop, which takes a solve about 0.1 s to notice


@dataclass(eq=False)
class Job:
    """One prediction from the request to its end. Use it from the event loop; only `cancelled` crosses threads.

    Attributes:
        store: whether the run is to be stored; at the end, whether it is.
        id: that of the run.
        state: how far it is.
        iterations: the documents of the iterations so far.
        document: the answer as JSON.
        material: what the sections of the cable remember.
        problem: why there is none.
        beyond_limit: whether the answer is the best iterate within the time limit of the service.
        cancelled: set by `cancel`.
        finished: set at the end.
    """

    EVENT: ClassVar[str] = "iteration"  # the name of an item of `iterations` among the events

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
        """When it was asked for, ISO 8601 in UTC."""
        return created_of(self.id)

    @property
    def mark(self) -> str:
        """What stands before the numbers of its events: nothing, as its address is its own."""
        return ""

    @property
    def size(self) -> int:
        """Bytes of its answer, as far as it is kept here."""
        arrays = () if self.material is None else vars(self.material).values()
        return len(self.document or b"") + sum(array.nbytes for array in arrays)

    def cancel(self) -> None:
        """Stop it: at once while it waits, at the solver's next check while it runs."""
        self.cancelled.set()
        if self.state == "queued":
            self.scope.cancel()

    async def stop(self) -> None:
        """Cancel it, and give it a moment to end: `finished` tells whether it has."""
        self.cancel()
        with anyio.move_on_after(CANCEL_TIME):
            await self.finished.wait()

    def begin(self) -> None:
        """Note that a worker has taken it up."""
        self.state = "running"
        self._tell()

    def add(self, iteration: dict[str, Any]) -> None:
        """Note an iteration."""
        self.iterations.append(iteration)
        self._tell()

    def end(self, state: State, problem: ProblemError | None = None) -> None:
        """Note the end."""
        self.state = state
        self.problem = problem
        self.finished.set()
        self._tell()

    def _tell(self) -> None:
        changed, self._changed = self._changed, anyio.Event()
        changed.set()

    async def progress(self, seen: int = 0) -> AsyncIterator[State | dict[str, Any] | None]:
        """Give each state and each iteration after the first `seen`, the past ones first, until the end.

        None stands for a time without news.
        """
        shown: State | None = None
        while True:
            changed = self._changed  # before what is looked at, so that nothing comes unseen between
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
        """Return what a list tells of it."""
        return {"id": self.id, "created": self.created, "state": self.state, "links": job_links(self.id)}


class Jobs:
    """The jobs that no stored run stands for: under way, failed, cancelled, or not to be stored."""

    def __init__(self) -> None:
        self._jobs: dict[str, Job] = {}

    def add(self, job: Job) -> None:
        """Remember a job; forget the oldest finished ones beyond the caps."""
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
        """Return those that run or wait, newest first."""
        return [job for job in reversed(self._jobs.values()) if not job.finished.is_set()]

    def forget(self, id: str) -> bool:
        """Forget a job; return whether it was there."""
        return self._jobs.pop(id, None) is not None

    def cancel_all(self) -> None:
        """Cancel what is under way."""
        for job in list(self._jobs.values()):
            if not job.finished.is_set():
                job.cancel()
