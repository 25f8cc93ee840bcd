"""Measurements under way: calibrations and studies. They take long, run one at a time, and yield to predictions."""

import asyncio
import contextlib
import logging
import os
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import anyio

from app.http.problems import ProblemError, document_of, problem_of
from app.schemas.ids import created_of
from app.service.jobs import MAX_FINISHED, Job, State
from dlocore import Cancelled

_log = logging.getLogger("dlo")

Tell = Callable[[int, int, str], None]
Work = Callable[[Tell, Callable[[], bool]], bytes]  # (progress, cancelled) -> the answer
_NICE = 10  # niceness of a measurement's thread
_WAY = 5.0  # longest time that one part of a measurement waits for predictions [s], so that it does end
_LOOK = 0.02  # s between two checks whether predictions run


@dataclass(eq=False, kw_only=True)
class Measurement(Job):
    """A calibration or a study from the request to its end; `iterations` are the documents of its progress.

    Attributes:
        kind: its kind, the name of its collection in the address.
    """

    EVENT: ClassVar[str] = "progress"

    kind: str

    @property
    def address(self) -> str:
        """Where its answer is."""
        return "/v1/calibration" if self.kind == "calibration" else f"/v1/{self.kind}/{self.id}"

    @property
    def mark(self) -> str:
        """Prefix of the numbers of its events: its id, if later measurements have the same address."""
        return f"{self.id}-" if self.kind == "calibration" else ""

    def summary(self) -> dict[str, Any]:
        """Return its state as a document."""
        return {
            **self.item(),
            "progress": self.iterations[-1] if self.iterations else None,
            "problem": None if self.problem is None else document_of(self.problem),
        }

    def item(self) -> dict[str, Any]:
        """Return its entry in a list."""
        return item_of(self.address, self.id, self.state)


def item_of(address: str, id: str, state: State) -> dict[str, Any]:
    """Return the entry of a list for a measurement at an address."""
    links = {"self": address, "events": f"{address}/events"}
    return {"id": id, "created": created_of(id), "state": state, "links": links}


class Measurements:
    """The measurements under way, and the last ones that ended. Use it from the event loop."""

    def __init__(self) -> None:
        self._kept: dict[str, Measurement] = {}
        self._one_at_a_time = anyio.Lock()

    def add(self, kind: str, id: str) -> Measurement:
        """Return a new measurement; forget the oldest finished ones beyond the limit."""
        finished = [kept for kept in self._kept.values() if kept.finished.is_set()]
        for oldest in finished[: max(0, len(finished) - MAX_FINISHED)]:
            del self._kept[oldest.id]
        measurement = Measurement(store=True, id=id, kind=kind)
        self._kept[id] = measurement
        return measurement

    def get(self, kind: str, id: str) -> Measurement | None:
        """Return a measurement of a kind, or None."""
        found = self._kept.get(id)
        return found if found is not None and found.kind == kind else None

    def forget(self, id: str) -> bool:
        """Forget a measurement; return whether it was there."""
        return self._kept.pop(id, None) is not None

    def last(self, kind: str) -> Measurement | None:
        """Return the last measurement of a kind, or None."""
        return next(reversed(self.of(kind)), None)

    def of(self, kind: str) -> list[Measurement]:
        """Return those of a kind that are running or waiting, and the last that ended."""
        return [kept for kept in self._kept.values() if kept.kind == kind]

    def under_way(self, kind: str) -> list[Measurement]:
        """Return those of a kind that are running or waiting."""
        return [kept for kept in self.of(kind) if not kept.finished.is_set()]

    def give_up(self) -> None:
        """End what is under way as cancelled, without waiting for its thread to notice."""
        for measurement in self._kept.values():
            measurement.cancelled.set()
            measurement.scope.cancel()

    async def run(self, measurement: Measurement, work: Work, busy: Callable[[], bool]) -> None:
        """Run a measurement when it is its turn, and record its progress and its end.

        Args:
            measurement: the measurement, in which they are recorded.
            work: measures; called in a thread of its own.
            busy: returns whether predictions are running or waiting; called from that thread.
        """
        loop = asyncio.get_running_loop()
        cancelled = measurement.cancelled

        def tell(done: int, total: int, what: str) -> None:
            give_up = time.monotonic() + _WAY
            while busy() and time.monotonic() < give_up and not cancelled.wait(_LOOK):
                pass
            news = {"done": done, "total": total, "what": what}
            loop.call_soon_threadsafe(lambda: measurement.add({"number": len(measurement.iterations), **news}))

        try:
            with measurement.scope:
                async with self._one_at_a_time:
                    measurement.begin()
                    measurement.document = await _in_thread(lambda: work(tell, cancelled.is_set))
                    measurement.end("done")
        except Cancelled:
            measurement.end("cancelled", _cancelled())
        except Exception as error:
            problem = problem_of(error)
            if problem.status == 500:
                _log.error("the measurement failed", exc_info=error)
            measurement.end("failed", problem)
        if not measurement.finished.is_set():  # its scope was cancelled while it waited
            measurement.end("cancelled", _cancelled())


def _cancelled() -> ProblemError:
    return ProblemError(503, "cancelled", "The measurement was cancelled.")


async def _in_thread(call: Callable[[], bytes]) -> bytes:
    """Return what `call` returns in a thread of its own, which has a low priority where the system supports that."""
    loop = asyncio.get_running_loop()
    outcome: asyncio.Future[bytes] = loop.create_future()

    def settle(answer: bytes | None, error: BaseException | None) -> None:
        if outcome.cancelled():
            return
        if error is not None:
            outcome.set_exception(error)
        else:
            outcome.set_result(answer or b"")

    def run() -> None:
        if sys.platform == "linux":  # elsewhere this would lower the priority of the whole process
            os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), _NICE)
        answer, failure = None, None
        try:
            answer = call()
        except BaseException as error:
            failure = error
        with contextlib.suppress(RuntimeError):  # the service has stopped in the meantime
            loop.call_soon_threadsafe(settle, answer, failure)

    threading.Thread(target=run, name="measurement", daemon=True).start()
    return await outcome
