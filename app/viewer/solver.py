"""How the scenes of the tabs are solved: by the service's workers, and counted with its other solves."""

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

LONGEST_PREVIEW = 20.0  # s; its time budget is far below, which a solver still to be compiled can't keep


class ServiceSolver:
    """Solves scenes for the threads of all tabs.

    A refined solve waits for a free worker as any request does. A preview does not: it takes about 10 ms, one a tab at
    a time, and a hand that drags can't wait behind somebody's long solve.

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
        """Return what this machine was calibrated to, in the plane (2) or in space (3); nothing where it was not."""
        found = calibration.load(self._service.settings.calibration_file)
        return () if found is None else found.of_dimensions(dimensions)

    def preview(self, scene: Scene, cancelled: Callable[[], bool]) -> Prediction:
        """Solve at once on the calling thread."""
        cost = calibration.stored_cost(self._service.settings.calibration_file)
        prediction = dlocore.predict(scene, deadline=LONGEST_PREVIEW, cancelled=cancelled, cost=cost)
        self._service.metrics.solved(prediction)
        return prediction

    def refine(self, scene: Scene, cancelled: threading.Event) -> Prediction:
        """Solve as one of the service's solves; the calling thread waits."""
        solve = self._service.solve(scene, cancelled)
        return asyncio.run_coroutine_threadsafe(solve, self._loop).result()

    def identify(
        self,
        windows: Sequence[Recording],
        start: Candidate,
        cancelled: Callable[[], bool],
        on_progress: Callable[[Progress], None],
    ) -> Identification:
        """Identify a cable as one of the service's searches; the calling thread waits."""
        search = self._service.searches.identify(windows, cancelled, start=start, on_progress=on_progress)
        return asyncio.run_coroutine_threadsafe(search, self._loop).result()
