"""The service behind the routes: settings, stored runs, solves under way, and whether the solver is ready."""

import asyncio
import contextlib
import logging
from collections.abc import AsyncIterator, Callable, Collection
from dataclasses import dataclass, field, replace
from threading import Event
from typing import Annotated

import anyio
import anyio.to_thread
import orjson
from anyio.abc import TaskGroup
from fastapi import Depends, Request

from app.http.problems import ProblemError, no_such_run, problem_of
from app.logs import RUN
from app.schemas import Motion, PredictionRequest, from_prediction, to_scene
from app.schemas.response import OPTIONAL_FIELDS, iteration_document
from app.service.jobs import CANCEL_TIME, Job, Jobs
from app.service.measurements import Measurement, Measurements, Work
from app.service.metrics import Metrics
from app.service.searches import Searches
from app.service.stopping import when_stopped
from app.service.worker import Worker, nothing
from app.settings import Settings
from app.store.recent import Recent
from app.store.runs import RunStore
from dlocore import Cancelled, Iteration, MaterialMotion, Prediction, Scene, SceneError, warm_up
from dlocore.warming import is_compiled

_log = logging.getLogger("dlo")


@dataclass
class Service:
    """Predict and store.

    Attributes:
        settings: the settings.
        runs: the stored runs.
        worker: the worker threads.
        metrics: the counters.
        jobs: predictions without a stored run.
        recent: the latest predictions, for others that are `like` them.
        measurements: calibrations and studies under way.
        searches: identifications of cables.
        ready: whether the solver is compiled and loaded.
        compiled: whether the solver was already compiled at the start and only has to be loaded, which takes seconds.
    """

    settings: Settings
    runs: RunStore
    worker: Worker
    metrics: Metrics
    jobs: Jobs = field(default_factory=Jobs)
    recent: Recent = field(default_factory=Recent)
    measurements: Measurements = field(default_factory=Measurements)
    searches: Searches = field(init=False)
    ready: bool = False
    compiled: bool = field(default_factory=is_compiled)
    _tasks: TaskGroup | None = field(init=False, default=None)
    _closed: anyio.Event = field(init=False, default_factory=anyio.Event)

    def __post_init__(self) -> None:
        self.searches = Searches(self.worker)

    @staticmethod
    def of(settings: Settings) -> "Service":
        """Return the service that `settings` describe."""
        runs, worker = RunStore(settings), Worker.of(settings)
        return Service(settings, runs, worker, Metrics(worker, runs))

    @contextlib.asynccontextmanager
    async def running(self) -> AsyncIterator[None]:
        """Compile the solver and run jobs during the context, or until `stop`; then finish or cancel them."""
        async with anyio.create_task_group() as self._tasks:
            self._tasks.start_soon(self._warm_up)
            try:
                with when_stopped(self.stop):
                    yield
            finally:
                with anyio.CancelScope(shield=True):
                    self.stop()
                    await self._closed.wait()
                self._tasks.cancel_scope.cancel()

    async def _warm_up(self) -> None:
        def work() -> None:
            with contextlib.suppress(Cancelled):
                warm_up(cancelled=lambda: self.worker.closed)

        await anyio.to_thread.run_sync(work, abandon_on_cancel=True)
        if not self.worker.closed:
            self.ready = True
            _log.info("ready", extra={"workers": self.worker.workers})

    def stop(self) -> None:
        """Begin to close: refuse new requests, and cancel those under way that do not finish within the grace time."""
        if not self.worker.closed:
            assert self._tasks is not None
            self.worker.close()
            self._tasks.start_soon(self._close)

    async def _close(self) -> None:
        try:
            with anyio.CancelScope(shield=True):
                with anyio.move_on_after(self.settings.shutdown_grace):
                    await self.worker.idle()
                if self.worker.busy:
                    _log.warning("cancelling all that is still under way", extra={"requests": self.worker.admitted})
                self.jobs.cancel_all()
                self.measurements.give_up()
                self.worker.cancel_all()
                with anyio.move_on_after(CANCEL_TIME):
                    await self.worker.idle()
        finally:
            self._closed.set()

    def check_ready(self) -> None:
        """Raise a 503 problem if the service is stopping, or the solver is still being compiled or loaded."""
        if self.worker.closed:
            raise ProblemError(503, "shutting-down", "The service is shutting down.", headers={"Retry-After": "5"})
        if not self.ready and self.compiled:
            detail = "The solver is being loaded. Try again in a few seconds."
            raise ProblemError(503, "not-ready", detail, headers={"Retry-After": "2"})
        if not self.ready:
            detail = "The solver is being compiled. This takes some minutes, but only once."
            raise ProblemError(503, "not-ready", detail, headers={"Retry-After": "30"})

    async def submit(self, request: PredictionRequest, raw: bytes, *, store: bool, like: str | None = None) -> Job:
        """Queue a prediction and return its job.

        Args:
            request: the valid request.
            raw: the request as it was sent.
            store: whether to keep the run.
            like: id of a similar run whose grid and error estimate it reuses, if any.

        Raises:
            SceneError: the scene is impossible.
            ProblemError: 404 if there is no run `like`, 409 if it has no answer, 429 if the queue is full, 503 if not
                ready or stopping.
        """
        self.check_ready()
        await self.check_known(like)
        scene = await anyio.to_thread.run_sync(to_scene, request, self.motion)
        self.worker.admit()
        assert self._tasks is not None
        job = Job(store)
        RUN.set(job.id)
        self.jobs.add(job)
        self._tasks.start_soon(self._work, job, scene, request, raw, like)
        return job

    async def check_known(self, like: str | None) -> None:
        """Raise a problem if `like` is given and is not the id of a run (404) or of one without an answer (409)."""
        if like is None or self.recent.get(like) is not None:
            return
        job = self.jobs.get(like)
        if await anyio.to_thread.run_sync(self.document, like) is None:
            if job is not None:
                raise job.not_done("only one that is done can be reused", "like")
            raise no_such_run(like, "like")

    async def _work(self, job: Job, scene: Scene, request: PredictionRequest, raw: bytes, like: str | None) -> None:
        try:
            with job.scope:
                prediction = await self._solved(job, scene, like)
                limit = self.settings.time_limit
                job.beyond_limit = prediction.status == "time_limit" and prediction.accuracy.wall_time >= limit
                document, job.store = await anyio.to_thread.run_sync(
                    self.keep, prediction, request, raw, job.id, job.store
                )
                job.material = await anyio.to_thread.run_sync(lambda: prediction.material)
                job.document = document
                if job.store:
                    self.jobs.forget(job.id)  # the stored run takes its place
                job.end("done")
        except Exception as error:
            problem = problem_of(error)
            if problem.status == 500:
                _log.error("the solve failed", exc_info=error)
            job.end("cancelled" if job.cancelled.is_set() and problem.kind == "cancelled" else "failed", problem)
        finally:
            self.worker.release()
        if not job.finished.is_set():  # its scope was cancelled while it waited
            self.metrics.ended("cancelled", scene.quality.method)
            job.end("cancelled", ProblemError(503, "cancelled", "The solve was cancelled."))

    def measure(self, kind: str, id: str, work: Work) -> Measurement:
        """Queue a measurement, which yields to predictions, and return it.

        Args:
            kind: its kind, the name of its collection in the address.
            id: its id.
            work: measures in a thread and returns the answer as JSON.

        Raises:
            ProblemError: 503, the service is not ready or is stopping.
        """
        self.check_ready()
        assert self._tasks is not None
        measurement = self.measurements.add(kind, id)
        self._tasks.start_soon(self.measurements.run, measurement, work, lambda: self.worker.admitted > 0)
        return measurement

    async def _solved(self, job: Job, scene: Scene, like: str | None) -> Prediction:
        loop = asyncio.get_running_loop()

        def report(iteration: Iteration) -> None:
            loop.call_soon_threadsafe(job.add, iteration_document(iteration))

        return await self.solve(scene, job.cancelled, like=like, on_start=job.begin, on_iteration=report)

    async def solve(
        self,
        scene: Scene,
        cancelled: Event,
        *,
        like: str | None = None,
        on_start: Callable[[], None] = nothing,
        on_iteration: Callable[[Iteration], None] = nothing,
    ) -> Prediction:
        """Predict `scene` by `Worker.solve`, like the run `like` if it is given; count and log the solve."""
        method = scene.quality.method
        before = self.recent.get(like) if like else None
        try:
            prediction = await self.worker.solve(
                scene, cancelled, like=before, on_start=on_start, on_iteration=on_iteration
            )
        except SceneError:
            self.metrics.ended("refused", method)
            raise
        except ProblemError as problem:
            self.metrics.ended("cancelled" if problem.kind == "cancelled" else "time_limit", method)
            raise
        except Exception:
            self.metrics.ended("failed", method)
            raise
        if like and before is None:
            why = "Solved from the beginning: The previous prediction is no longer in memory."
            prediction = replace(prediction, said=f"{prediction.said} {why}")
        self.metrics.solved(prediction)
        accuracy = prediction.accuracy
        _log.info(
            "solved",
            extra={"status": prediction.status, "method": accuracy.method, "seconds": round(accuracy.wall_time, 6)},
        )
        return prediction

    def keep(
        self,
        prediction: Prediction,
        request: PredictionRequest,
        raw: bytes,
        id: str,
        store: bool,
        fields: Collection[str] = OPTIONAL_FIELDS,
    ) -> tuple[bytes, bool]:
        """Remember a prediction; return its answer as JSON and whether it is stored. Safe to call from any thread.

        A prediction that can't be stored is still answered; its message says why it is not stored.

        Args:
            prediction: what the solver returned.
            request: the valid request.
            raw: the request as it was sent.
            id: id of the run.
            store: whether to store it.
            fields: the members of `OPTIONAL_FIELDS` that the answer has; a stored run has all of them.
        """
        u, t = request.output.samples_u, request.output.samples_t
        told, stored = prediction, b""
        if store:
            try:
                _, stored = self.runs.save(raw, prediction, samples_u=u, samples_t=t, id=id, name=request.name)
            except OSError as error:
                _log.error("the run is not stored: %s", error)
                told = replace(prediction, said=f"{prediction.said} It is not stored: {error.strerror or error}.")
                store = False
        if store:
            answer = _with_fields(stored, fields)
        else:
            document = {**from_prediction(told, id, u, t, fields), "links": None}
            answer = orjson.dumps(document, option=orjson.OPT_SERIALIZE_NUMPY)
        self.recent.add(id, prediction)  # last, since parts computed for the answer count as its memory, too
        return answer, store

    def document(self, id: str) -> bytes | None:
        """Return the answer of the run `id`, stored or not, as JSON, or None if there is none; for any thread."""
        job = self.jobs.get(id)
        return job.document if job is not None and job.document is not None else self.runs.document(id)

    def motion(self, id: str) -> Motion | None:
        """Return the motion of the stored run `id`, or None if there is no such run; for any thread.

        Raises:
            SceneError: the run is known, but not done, or not stored.
        """
        job = self.jobs.get(id)
        motion = self.runs.motion(id)
        if motion is not None or job is None:
            return motion
        if job.state == "done" and job.store:  # it ended during the search
            return self.runs.motion(id)
        state = "not stored" if job.state == "done" else job.state
        raise SceneError("shape.id", id, "the id of a stored prediction", f"That prediction is {state}")

    def material(self, id: str) -> MaterialMotion | None:
        """Return what the sections of the cable remember in the run `id`, stored or not, or None; for any thread."""
        job = self.jobs.get(id)
        if job is not None and job.document is not None:
            return job.material
        motion = self.runs.motion(id)
        return None if motion is None else motion.material


def _with_fields(stored: bytes, fields: Collection[str]) -> bytes:
    """Return a stored answer without those of `OPTIONAL_FIELDS` that are not in `fields`."""
    left_out = set(OPTIONAL_FIELDS).difference(fields)
    if not left_out:
        return stored
    return orjson.dumps({name: part for name, part in orjson.loads(stored).items() if name not in left_out})


def service_of(request: Request) -> Service:
    """Return the service of the application that serves `request`."""
    service: Service = request.app.state.service
    return service


TheService = Annotated[Service, Depends(service_of)]
