"""One browser tab: its draft, its solver thread, its picture and its panel."""

import asyncio
import contextlib
import json
import logging
from typing import Any, Protocol

import numpy as np
from viser import ClientHandle, TransformControlsEvent

from app.viewer.camera import FIELD_OF_VIEW, PHONE, start_pose
from app.viewer.draft import Draft, start_draft
from app.viewer.palette import BRAND
from app.viewer.panel import Panel
from app.viewer.picture import Look, Picture
from app.viewer.playback import Playback
from app.viewer.solving import Outcome, SolverThread
from dlocore import Prediction

FRAME = 1 / 40  # s
PANEL_FRAMES = 3  # pictures for one update of the timeline: redrawing the panel is what costs the browser most
QUIET = 0.2  # s without an edit, after which the hand counts as still
GIZMO_SIZE = 0.16  # of the cable's length
WARNING_HEIGHT = 0.06  # m above the target
_log = logging.getLogger(__name__)


class Runs(Protocol):
    """Where runs are stored."""

    def save(self, scene_json: dict[str, Any], prediction: Prediction) -> str:
        """Store a run; return its id."""


class Session:
    """The state of one client. Everything but the solve runs on the viewer's event loop, so nothing is locked.

    Args:
        client: the client.
        runs: where runs are stored.
        address: at which the client sees the service.
    """

    def __init__(self, client: ClientHandle, runs: Runs, address: str) -> None:
        self._client = client
        self._runs = runs
        self._loop = asyncio.get_running_loop()
        self._draft = start_draft()
        self._shown: tuple[Draft, Prediction] | None = None  # the last refined prediction
        self._dragging = False
        self._refine_timer: asyncio.TimerHandle | None = None
        self._playback = Playback(horizon=self._draft.duration)
        self._look_around()
        self._picture = Picture(client, self._draft)
        self._add_gizmo()
        self._panel = Panel(
            client,
            self._draft,
            self._playback,
            address,
            on_edit=self.edit,
            on_look=self._restyle,
            on_seek=self._draw_time,
            on_keep=self._keep,
            on_download=self._download,
        )
        self._solver = SolverThread(self._deliver, f"viewer-solver-{client.client_id}")
        self._solver.ask(self._draft, preview=False)
        self._animation = asyncio.create_task(self._animate())

    def close(self) -> None:
        """Free the solver thread and the animation."""
        self._solver.close()
        self._animation.cancel()
        if self._refine_timer is not None:
            self._refine_timer.cancel()

    def _look_around(self) -> None:
        client, length = self._client, self._draft.cable.length
        client.gui.configure_theme(show_logo=False, show_share_button=False, brand_color=BRAND, control_width="medium")
        client.gui.set_panel_label("Cable")
        client.scene.set_up_direction("+z")
        if client.camera.image_width > PHONE:
            client.gui.main_panel.dock_right()
        client.camera.fov = FIELD_OF_VIEW
        client.camera.position, client.camera.look_at = start_pose(
            length, client.camera.image_width, client.camera.image_height
        )
        client.camera.max_orbit_distance = 20.0

    def _add_gizmo(self) -> None:
        self._gizmo = self._client.scene.add_transform_controls(
            "/target",
            scale=GIZMO_SIZE * self._draft.cable.length,
            line_width=3.0,
            active_axes=(True, True, False),
            disable_rotations=True,
            depth_test=False,
            position=self._draft.target,
        )
        self._hint = self._client.scene.add_label(
            "/target_hint", "drag me", position=self._draft.target, anchor="top-left"
        )
        self._warning = self._client.scene.add_label("/warning", "", visible=False, anchor="bottom-center")

        @self._gizmo.on_update
        async def _dragged(event: TransformControlsEvent) -> None:
            if event.phase == "start":
                self._begin_drag()
            elif event.phase == "update":
                self.edit(self._draft.with_target(float(self._gizmo.position[0]), float(self._gizmo.position[1])))
            else:
                self._end_drag()

    def _begin_drag(self) -> None:
        """Show where the motion ends while the hand is on the target."""
        self._dragging = True
        self._playback.pause()
        self._playback.seek(self._playback.horizon)
        self._draw_time()

    def _end_drag(self) -> None:
        self._dragging = False
        self._refine()
        self._playback.play()

    def edit(self, draft: Draft) -> None:
        """Take over an edited draft: a preview at once, the asked quality as soon as the hand is still."""
        if draft == self._draft:
            return
        if draft.target != self._draft.target:
            self._hint.visible = False
        self._draft = draft
        with self._client.atomic():
            self._panel.take_draft(draft)
            self._panel.clear_kept()
            if not self._dragging:
                self._gizmo.position = np.array(draft.target)
        self._solver.ask(draft, preview=True)
        if self._refine_timer is not None:
            self._refine_timer.cancel()
        self._refine_timer = self._loop.call_later(QUIET, self._refine)

    def _refine(self) -> None:
        if self._refine_timer is not None:
            self._refine_timer.cancel()
            self._refine_timer = None
        self._solver.ask(self._draft, preview=False)

    def _deliver(self, outcome: Outcome) -> None:
        """Hand an outcome from the solver thread to the event loop."""
        with contextlib.suppress(RuntimeError):  # the loop is closed: the service stops
            self._loop.call_soon_threadsafe(self._take, outcome)

    def _take(self, outcome: Outcome) -> None:
        with self._client.atomic():
            if outcome.prediction is None:
                self._panel.take_problem(outcome.problem, outcome.details)
                self._warn(outcome.problem)
            else:
                draft, preview = outcome.job.draft, outcome.job.preview
                if self._dragging:
                    self._playback.set_horizon(outcome.prediction.surface.horizon)
                    self._playback.seek(self._playback.horizon)
                scale = self._picture.show(draft, outcome.prediction)
                self._picture.pose(self._playback.time)
                self._panel.take_prediction(draft, outcome.prediction, scale, preview=preview)
                self._warning.visible = False
                if not preview:
                    self._shown = (draft, outcome.prediction)
        self._client.flush()

    def _warn(self, problem: str) -> None:
        x, y, z = self._draft.target
        self._warning.text = f"Not possible. {problem}."
        self._warning.position = (x, y, z + WARNING_HEIGHT)
        self._warning.visible = True

    def _restyle(self, look: Look) -> None:
        with self._client.atomic():
            scale = self._picture.restyle(look)
            if scale is not None:
                self._panel.take_scale(scale)
        self._client.flush()

    def _draw_time(self, *, panel: bool = True) -> None:
        with self._client.atomic():
            self._picture.pose(self._playback.time)
            if panel:
                self._panel.show_time()
        self._client.flush()

    async def _animate(self) -> None:
        due = before = self._loop.time()
        frame = 0
        while True:
            due = max(due + FRAME, before)
            await asyncio.sleep(max(due - self._loop.time(), 0.0))
            now = self._loop.time()
            if self._playback.advance(now - before):
                frame += 1
                at_rest = not 0.0 < self._playback.time < self._playback.horizon
                self._draw_time(panel=at_rest or frame % PANEL_FRAMES == 0)
            before = now

    def _download(self) -> None:
        """Send the scene to the browser as the file that the API and the command line read."""
        content = json.dumps(self._draft.json(), indent=2).encode()
        self._client.send_file_download("scene.json", content, save_immediately=True)

    async def _keep(self) -> None:
        """Store the last refined prediction with its scene and link to it."""
        if self._shown is None or self._shown[0] != self._draft:
            return
        draft, prediction = self._shown
        try:
            run_id = await asyncio.to_thread(self._runs.save, draft.json(), prediction)
        except Exception:
            _log.exception("the run could not be stored")
            self._client.add_notification("Not kept", "The run could not be stored; the log says why.", color="red")
            return
        self._panel.show_kept(run_id)
