"""What the routes work with: the settings, the stored runs, the worker, and whether the solver is ready."""

from dataclasses import dataclass, field
from threading import Event
from typing import Annotated

import anyio.to_thread
from fastapi import Depends, Request

from app.problems import ProblemError
from app.runs import RunStore
from app.schemas import PredictionRequest, to_scene
from app.settings import Settings
from app.worker import Worker
from dlocore import warm_up


@dataclass
class Service:
    """Predict and store.

    Attributes:
        settings: the settings.
        runs: the stored runs.
        worker: the worker threads.
        ready: whether the solver is compiled.
    """

    settings: Settings
    runs: RunStore
    worker: Worker
    ready: bool = field(default=False)

    @staticmethod
    def of(settings: Settings) -> "Service":
        """Return the service that `settings` describe."""
        return Service(settings, RunStore(settings), Worker.of(settings))

    async def warm_up(self) -> None:
        """Compile the solver."""
        await anyio.to_thread.run_sync(warm_up, abandon_on_cancel=True)
        self.ready = True

    def check_ready(self) -> None:
        """Raise a 503 problem while the solver is being compiled."""
        if not self.ready:
            detail = "The solver is being compiled. Try again in a few seconds."
            raise ProblemError(503, "not-ready", detail, headers={"Retry-After": "2"})

    async def predict(self, request: PredictionRequest, raw: bytes, cancelled: Event) -> str:
        """Predict, store and return the id of the run.

        Args:
            request: the valid request.
            raw: the same as it was sent.
            cancelled: set it to stop the solve.

        Raises:
            SceneError: the scene is impossible.
            ProblemError: 429, 503 or 504; 504 names the stored run with the best iterate.
        """
        self.check_ready()
        scene = await anyio.to_thread.run_sync(to_scene, request, self.runs.surface)
        prediction = await self.worker.solve(scene, cancelled)

        def save() -> str:
            output = request.output
            return self.runs.save(raw, prediction, samples_u=output.samples_u, samples_t=output.samples_t)

        id = await anyio.to_thread.run_sync(save)
        limit = self.settings.time_limit
        if prediction.status == "time_limit" and prediction.accuracy.wall_time >= limit:
            detail = (
                f"The solve reached the limit of {limit:g} s; the best iterate so far is kept. {prediction.message}"
            )
            raise ProblemError(504, "time-limit", detail, prediction=f"/v1/predictions/{id}")
        return id


def service_of(request: Request) -> Service:
    """Return the service of the application that serves `request`."""
    service: Service = request.app.state.service
    return service


TheService = Annotated[Service, Depends(service_of)]
