"""One solver thread for each browser tab. It solves the newest requested scene; requests do not queue up."""

import logging
import threading
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import Literal, Protocol

from app.http.problems import ProblemError
from app.viewer.costs import Costs, measure_costs
from app.viewer.draft import Draft
from dlocore import Cancelled, DloError, Prediction, Quality, Scene, SceneError
from dlocore.calibration import Measured
from dlocore.identify import Candidate, Identification, Progress
from dlocore.recordings import Recording

PREVIEW = Quality(time_budget=0.01)  # while the user is editing
Kind = Literal["preview", "refined", "costs"]
_log = logging.getLogger(__name__)


class Solver(Protocol):
    """Solves scenes for the threads of all tabs."""

    @property
    def ready(self) -> bool:
        """Whether the solver is compiled."""

    @property
    def longest(self) -> float:
        """How long a refined solve takes at most [s]."""

    def make(self, draft: Draft) -> Scene:
        """Return the scene of a draft, or raise SceneError."""

    def measured(self, dimensions: int) -> tuple[Measured, ...]:
        """Return the calibration of this machine, in the plane (2) or in space (3)."""

    def preview(self, scene: Scene, cancelled: Callable[[], bool]) -> Prediction:
        """Solve at once, for at most a few ms."""

    def refine(self, scene: Scene, cancelled: threading.Event) -> Prediction:
        """Solve like a request to the service, as soon as a worker is free."""

    def identify(
        self,
        windows: Sequence[Recording],
        start: Candidate,
        cancelled: Callable[[], bool],
        on_progress: Callable[[Progress], None],
    ) -> Identification:
        """Identify a cable like a request to the service, when it is its turn."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Job:
    """A draft to solve as a quick preview or at the requested quality, or to measure the costs of its effects.

    Setting `superseded` ends the solve; the service sets it too when the solve has ended. `stopped` says that the user
    stopped the solve, so that its outcome is dropped.
    """

    draft: Draft
    kind: Kind
    superseded: threading.Event = field(default_factory=threading.Event)
    stopped: threading.Event = field(default_factory=threading.Event)


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """The outcome of a job: a prediction, or why there is none.

    `problem` says why in words, and `details` gives the field, its value and the allowed range. `measured` is the
    calibration of this machine, for a refined prediction.
    """

    job: Job
    prediction: Prediction | None
    problem: str = ""
    details: str = ""
    costs: Costs | None = None
    measured: tuple[Measured, ...] = ()


class SolverThread:
    """Solves the newest job on its own thread, and delivers the outcome from there.

    Once begun, a preview is finished even if a newer job arrives, so that the picture follows even a fast drag. A
    refined solve gives way to a newer job at the solver's next check.

    Args:
        solver: solves the scenes.
        deliver: called on the solver thread with every outcome.
        name: name of the thread.
    """

    def __init__(self, solver: Solver, deliver: Callable[[Outcome], None], name: str) -> None:
        self._solver = solver
        self._deliver = deliver
        self._changed = threading.Condition()
        self._newest: Job | None = None
        self._running: Job | None = None
        self._closed = False
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    def ask(self, draft: Draft, kind: Kind) -> None:
        """Solve `draft` next; it replaces a job that is still waiting."""
        with self._changed:
            self._newest = Job(draft=draft, kind=kind)
            if self._running is not None:
                self._running.superseded.set()
            self._changed.notify()

    @property
    def waiting(self) -> bool:
        """Whether a job is waiting for the running one to end."""
        return self._newest is not None

    def stop(self) -> None:
        """End the running solve at the solver's next check, and drop the waiting job."""
        with self._changed:
            for job in (self._newest, self._running):
                if job is not None:
                    job.stopped.set()
                    job.superseded.set()
            self._newest = None

    def close(self) -> None:
        """Stop the thread at the solver's next check; the outcome of a running solve is dropped."""
        with self._changed:
            self._closed = True
            self._newest = None
            if self._running is not None:
                self._running.superseded.set()
            self._changed.notify()

    def _run(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._closed or self._newest is not None)
                if self._closed:
                    return
                assert self._newest is not None
                self._running, self._newest = self._newest, None
                job = self._running
            outcome = self._solve(job)
            if outcome is not None and not self._closed:
                self._deliver(outcome)

    def _measure(self, job: Job, prediction: Prediction) -> None:
        """Measure the costs of the effects, and deliver them as they become known."""

        def on_costs(costs: Costs) -> None:
            if not self._closed:
                self._deliver(Outcome(job=job, prediction=prediction, costs=costs))

        def ended() -> bool:  # `superseded` is no use here: the service has set it by now
            return self._closed or self._newest is not None or job.stopped.is_set()

        measure_costs(prediction, ended, on_costs)

    def _solve(self, job: Job) -> Outcome | None:
        try:
            scene = self._solver.make(job.draft)
            if job.kind == "preview":
                prediction = self._solver.preview(
                    replace(scene, quality=PREVIEW), lambda: self._closed or job.stopped.is_set()
                )
                return Outcome(job=job, prediction=prediction)
            prediction = self._solver.refine(scene, job.superseded)
            measured = self._solver.measured(prediction.accuracy.dimensions)
            refined = Outcome(job=job, prediction=prediction, measured=measured)
            if job.kind == "refined":
                return refined
            self._deliver(refined)
            self._measure(job, prediction)
            return None
        except Cancelled:
            return None
        except SceneError as error:
            details = f"{error.field}: got {error.given}, allowed: {error.allowed}."
            return Outcome(job=job, prediction=None, problem=error.reason or error.field, details=details)
        except ProblemError as error:
            return None if error.kind == "cancelled" else Outcome(job=job, prediction=None, problem=error.detail)
        except DloError as error:
            return Outcome(job=job, prediction=None, problem=str(error))
        except Exception:
            _log.exception("the solver failed on %s", job.draft)
            return Outcome(job=job, prediction=None, problem="The solver failed on this scene; the log says why")
