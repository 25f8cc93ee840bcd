"""A recording in a session: markers over the prediction, the error over time, the identification of the cable."""

import asyncio
import contextlib
import logging
import threading
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from viser import SceneApi

from app.http.problems import ProblemError
from app.store.cables import KeptCables
from app.viewer import report
from app.viewer import tracking_report as say
from app.viewer.draft import Draft
from app.viewer.forms.recording import RecordingForm
from app.viewer.solving import Solver
from app.viewer.tracked import MOST_WINDOWS, Tracked, opened
from dlocore import Prediction, SceneError
from dlocore.identify import Identification, Progress

Floats = NDArray[np.float64]
MARKER = (213, 94, 0)  # colour of measured markers
SIZE = 0.012  # m, of a marker
_log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class TrackingActions:
    """What a recording can have the session do.

    Attributes:
        show: show a scene from its beginning.
        draft: return the scene being edited.
        flush: send changes to the client.
        kept: called when a preset was added.
    """

    show: Callable[[Draft], None]
    draft: Callable[[], Draft]
    flush: Callable[[], None]
    kept: Callable[[], None]


class Tracking:
    """The recording of one client; every method runs on the viewer's event loop.

    Args:
        scene: the scene that gets the markers.
        form: the controls on the panel.
        solver: identifies the cable.
        cables: the kept presets.
        actions: what the recording has the session do.
    """

    def __init__(
        self, scene: SceneApi, form: RecordingForm, solver: Solver, cables: KeptCables, actions: TrackingActions
    ) -> None:
        self._form, self._solver, self._cables, self._actions = form, solver, cables, actions
        self._loop = asyncio.get_running_loop()
        self._tracked: Tracked | None = None
        self._beside: dict[str, bytes] = {}
        self._distances: Floats | None = None
        self._cancelled: threading.Event | None = None
        self._showing: asyncio.Task[None] | None = None
        self._markers = scene.add_point_cloud(
            "/measured",
            np.zeros((1, 3)),
            MARKER,
            point_size=SIZE,
            point_shape="circle",
            precision="float32",
            visible=False,
        )

    async def open(self, name: str, content: bytes) -> None:
        """Show the recording in a file; a .json waits for the .csv of the same name, and vice versa."""
        stem, _, kind = name.lower().rpartition(".")
        if kind in ("csv", "json"):
            other = "json" if kind == "csv" else "csv"
            fitting = next((n for n in self._beside if n.lower() == f"{stem}.{other}"), None)
            if fitting is None:
                self._beside = {name: content}
                self._form.say(f"{name} is uploaded. Now open {stem}.{other}, which belongs to it.", good=True)
                return
            name, content, self._beside = (
                (name, content, {fitting: self._beside[fitting]})
                if kind == "csv"
                else (fitting, self._beside[fitting], {name: content})
            )
        try:
            tracked = await asyncio.to_thread(opened, name, content, self._beside)
            draft = await asyncio.to_thread(tracked.draft)
        except SceneError as error:
            self._form.say(f"{name} was not opened: {error}", good=False)
            return
        self.leave()
        self._beside = {}
        self._form.say(f"{name} was opened.", good=True)
        self._tracked = tracked
        self._form.take([_label(k, w.duration, len(tracked.windows)) for k, w in enumerate(tracked.windows)])
        self._actions.show(draft)

    def leave(self) -> None:
        """Drop the recording, since another scene is shown."""
        self.close()
        self._tracked = self._distances = None
        self._markers.visible = False
        self._form.take([])

    def close(self) -> None:
        """End a running search, and show no other window any more."""
        self._end_search()
        if self._showing is not None:
            self._showing.cancel()
            self._showing = None

    def _end_search(self) -> None:
        if self._cancelled is not None:
            self._cancelled.set()
            self._cancelled = None

    def window(self, number: int) -> None:
        """Show another window."""
        if self._tracked is not None and 0 <= number < len(self._tracked.windows):
            with contextlib.suppress(SceneError):  # an impossible cable is not taken over
                self._tracked = self._tracked.edited(self._actions.draft())
            self._show(replace(self._tracked, shown=number))

    def _show(self, tracked: Tracked) -> None:
        """Show a window as soon as its scene is made, which would take too long on the event loop."""
        if self._showing is not None:
            self._showing.cancel()
        self._showing = asyncio.create_task(self._make(tracked))

    async def _make(self, tracked: Tracked) -> None:
        draft = await asyncio.to_thread(tracked.draft)
        self._tracked, self._distances = tracked, None
        self._actions.show(draft)

    def take_prediction(self, prediction: Prediction) -> None:
        """Measure how far a prediction of the shown window is from the markers."""
        if self._tracked is not None:
            self._distances = self._tracked.distances(prediction)

    def pose(self, time: float) -> None:
        """Show the markers as they were at `time` [s]."""
        if self._tracked is None:
            return
        markers = self._tracked.markers_at(time)
        if len(markers):
            self._markers.points = markers.astype(np.float32)
        if self._markers.visible != bool(len(markers)):
            self._markers.visible = bool(len(markers))

    def card(self, time: float) -> str:
        """Return the error at `time` [s] as a number, and over time as a plot; "" if there is no recording."""
        if self._tracked is None or self._distances is None:
            return ""
        return say.error_card(self._tracked.times, self._distances, time)

    def search(self) -> None:
        """Start identifying the cable from the recording, beginning with the edited cable; or stop a running search."""
        if self._tracked is None:
            return
        if self._cancelled is not None:
            self._end_search()
            self._form.running(False)
            self._form.found("Stopped.", keep=False)
            return
        try:
            self._tracked = self._tracked.edited(self._actions.draft())
        except SceneError as error:
            self._form.found(report.note(str(error), good=False), keep=False)
            return
        self._cancelled = threading.Event()
        self._form.running(True)
        self._form.found(report.note("Waiting for another search to end, or compiling …", good=True), keep=False)
        threading.Thread(target=self._search, args=(self._tracked, self._cancelled), daemon=True).start()

    def _search(self, tracked: Tracked, cancelled: threading.Event) -> None:
        """Search on a thread of its own."""

        def deliver(work: Callable[[], None]) -> None:
            def unless_cancelled() -> None:
                if not cancelled.is_set():
                    work()
                    self._actions.flush()

            with contextlib.suppress(RuntimeError):  # the loop is closed because the service is stopping
                self._loop.call_soon_threadsafe(unless_cancelled)

        def on_progress(progress: Progress) -> None:
            deliver(lambda: self._form.found(say.progress(progress), keep=False))

        try:
            windows = tracked.windows[:MOST_WINDOWS]
            found = self._solver.identify(windows, tracked.candidate, cancelled.is_set, on_progress)
            deliver(lambda: self._take(found))
        except (SceneError, ProblemError) as error:
            words = str(error)
            deliver(lambda: self._fail(words))
        except Exception:
            _log.exception("a recording could not be identified")
            deliver(lambda: self._fail("The search failed; the log says why."))

    def _fail(self, words: str) -> None:
        self._cancelled = None
        self._form.running(False)
        self._form.found(report.note(words, good=False), keep=False)

    def _take(self, found: Identification) -> None:
        """Show the result of a search, and the recording with the identified cable."""
        assert self._tracked is not None
        self._cancelled = None
        self._form.running(False)
        self._form.found(say.result(found), keep=True)
        self._show(replace(self._tracked, candidate=found.candidate))

    def keep(self, name: str) -> None:
        """Keep the cable and the drag of the edited scene as a preset."""
        draft = self._actions.draft()
        drag = {key: draft.get(("environment", key), 0.0) for key in ("drag", "drag_quadratic")}
        try:
            self._cables.keep(name, draft.get(("cable",), {}), drag)
        except (SceneError, OSError) as error:
            self._form.say(f"Not kept: {error}", good=False)
            return
        self._form.say(f"{name.strip()} is now among the presets of the cable.", good=True)
        self._actions.kept()


def _label(number: int, seconds: float, count: int) -> str:
    return f"{number + 1} of {count}, {seconds:.1f} s"
