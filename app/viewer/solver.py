"""Solve the scenes of the tabs: by the service's workers, counted with its other solves."""

import asyncio
import threading
from collections.abc import Callable, Sequence

import dlocore
from app.service.service import Service
from app.viewer.draft import Draft
from dlocore import Prediction, Scene, calibration
from dlocore.calibration import Measured
from dlocore.identify import Candidate, Identification, Progress
from dlocore.recordings import Recording

LONGEST_PREVIEW = 20.0  # s; far above its time budget, which can't be met while the solver is not yet compiled


class ServiceSolver:
    """Solves scenes for the threads of all tabs.

    A refined solve waits for a free worker like any request. A preview does not, because a drag can't wait behind
    somebody else's long solve; it takes about 10 ms, and each tab solves only one at a time.

    Args:
        service: the service.
        loop: its event loop.
    """

    def __init__(self, service: Service, loop: asyncio.AbstractEventLoop) -> None:
        self._service = service
        self._loop = loop

    @property
    def ready(self) -> bool:
        """Whether the solver is compiled."""
        return self._service.ready

    @property
    def longest(self) -> float:
        """How long a refined solve takes at most [s]."""
        return self._service.settings.time_limit

    def make(self, draft: Draft) -> Scene:
        """Return the scene of a draft, or raise SceneError."""
        return draft.scene(self._service.runs.motion)

    def measured(self, dimensions: int) -> tuple[Measured, ...]:
        """Return the calibration of this machine, in the plane (2) or in space (3); empty if it has none."""
        found = calibration.load(self._service.settings.calibration_file)
        return () if found is None else found.of_dimensions(dimensions)

    def preview(self, scene: Scene, cancelled: Callable[[], bool]) -> Prediction:
        """Solve at once on the calling thread."""
        cost = calibration.stored_cost(self._service.settings.calibration_file)
        prediction = dlocore.predict(scene, deadline=LONGEST_PREVIEW, cancelled=cancelled, cost=cost)
        self._service.metrics.solved(prediction)
        return prediction

    def refine(self, scene: Scene, cancelled: threading.Event) -> Prediction:
        """Solve like a request to the service; the calling thread waits."""
        solve = self._service.solve(scene, cancelled)
        return asyncio.run_coroutine_threadsafe(solve, self._loop).result()

    def identify(
        self,
        windows: Sequence[Recording],
        start: Candidate,
        cancelled: Callable[[], bool],
        on_progress: Callable[[Progress], None],
    ) -> Identification:
        """Identify a cable like a request to the service; the calling thread waits."""
        search = self._service.searches.identify(windows, cancelled, start=start, on_progress=on_progress)
        return asyncio.run_coroutine_threadsafe(search, self._loop).result()
