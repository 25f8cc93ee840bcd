"""One solver thread a browser tab: the newest asked scene wins, nothing queues up."""

import logging
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass

import dlocore
from app.viewer.draft import Draft
from dlocore import Cancelled, DloError, Prediction, Quality, SceneError

LONGEST_SOLVE = 20.0  # s, of a refined solve
PREVIEW = Quality(time_budget=0.01)  # while the hand moves
_log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class Job:
    """A draft to solve, as a quick preview or at the asked quality; `asked_at` as of `time.perf_counter()` [s]."""

    draft: Draft
    preview: bool
    asked_at: float


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What became of a job: a prediction, or why there is none: in words, and with field, value and allowed range."""

    job: Job
    prediction: Prediction | None
    problem: str = ""
    details: str = ""


class SolverThread:
    """Solves the newest job on a thread of its own and delivers the outcome from there.

    A preview is finished once begun, so that a picture follows the hand however fast it moves; a refined solve gives
    way to a newer job at the solver's next check.

    Args:
        deliver: called on the solver thread with every outcome.
        name: of the thread.
    """

    def __init__(self, deliver: Callable[[Outcome], None], name: str) -> None:
        self._deliver = deliver
        self._changed = threading.Condition()
        self._newest: Job | None = None
        self._closed = False
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def ask(self, draft: Draft, *, preview: bool) -> None:
        """Solve `draft` next, instead of whatever was waiting."""
        with self._changed:
            self._newest = Job(draft=draft, preview=preview, asked_at=time.perf_counter())
            self._changed.notify()

    def close(self) -> None:
        """Stop the thread at the solver's next check; outcomes of a running solve are dropped."""
        with self._changed:
            self._closed = True
            self._newest = None
            self._changed.notify()

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._closed or self._newest is not None)
                if self._closed:
                    return
                job, self._newest = self._newest, None
            assert job is not None
            outcome = self._solve(job)
            if outcome is not None and not self._closed:
                self._deliver(outcome)

    def _solve(self, job: Job) -> Outcome | None:
        def cancelled() -> bool:
            return self._closed or (not job.preview and self._newest is not None)

        try:
            scene = job.draft.scene(PREVIEW if job.preview else None)
            prediction = dlocore.predict(scene, deadline=LONGEST_SOLVE, cancelled=cancelled)
        except Cancelled:
            return None
        except SceneError as error:
            details = f"{error.field}: got {error.given}, allowed: {error.allowed}."
            return Outcome(job=job, prediction=None, problem=error.reason or error.field, details=details)
        except DloError as error:
            return Outcome(job=job, prediction=None, problem=str(error))
        except Exception:
            _log.exception("the solver failed on %s", job.draft)
            return Outcome(job=job, prediction=None, problem="The solver failed on this scene; the log says why")
        return Outcome(job=job, prediction=prediction)
