"""The session of one browser tab: its draft, its solver thread, its picture and its panel."""

import asyncio
import contextlib
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import orjson
from viser import ClientHandle, SceneClickEvent
from viser._messages import GuiUpdateMessage

from app.pages.gallery import examples
from app.store.cables import KeptCables
from app.viewer import grips, report, uploads
from app.viewer.camera import FIELD_OF_VIEW, PHONE, extent, start_pose
from app.viewer.draft import Draft, start_draft
from app.viewer.edits import Edits
from app.viewer.forms.recording import RecordingActions
from app.viewer.gizmo import Gizmo
from app.viewer.history import History
from app.viewer.outbox import Outbox, Runs
from app.viewer.palette import BRAND
from app.viewer.panel import TO_READ, Actions, Panel
from app.viewer.picking import GripperClick
from app.viewer.picture import Look, Picture, light
from app.viewer.playback import Playback
from app.viewer.shape_editor import ShapeEditor
from app.viewer.shapes import straightened, with_points
from app.viewer.solving import Kind, Outcome, Solver, SolverThread
from app.viewer.step_buttons import REDO, UNDO
from app.viewer.tracking import Tracking, TrackingActions
from app.viewer.transfers import limit_uploads
from dlocore import Prediction, SceneError, SplineSurface

FRAME = 1 / 40  # s
PANEL_FRAMES = 3  # frames for one update of the timeline: redrawing the panel costs the browser most
PATIENCE = 0.8  # s without an answer after which the panel says that a solve is running
TICK = 1.0  # s between two updates of that message
AFTER_DRAG = 0.4  # s after a drag in which a click counts as its end
SEEN = 2.0  # the camera is placed anew when the cable becomes longer or shorter by this factor
QUIET = 0.2  # s without an edit after which the edited scene is solved at the requested quality


@dataclass(frozen=True)
class Shared:
    """What all tabs share.

    Attributes:
        runs: the store of the runs.
        solver: solves the scenes of all tabs.
        cables: cables that were kept as presets.
    """

    runs: Runs
    solver: Solver
    cables: KeptCables


@dataclass(frozen=True)
class Work:
    """The work of a tab: its scene, and the history of its edits."""

    draft: Draft
    history: History

    @staticmethod
    def begun(draft: Draft | None) -> "Work":
        """Return work that begins with a scene, or with the paper's case if there is none."""
        return Work(draft or start_draft(), History())


def of_example(name: str) -> Draft | None:
    """Return the ready scene of this name, or None if there is none."""
    found = examples().get(name)
    return None if found is None else Draft.of(orjson.loads(found.document))


def of_run(id: str, runs: Runs) -> Draft | None:
    """Return the scene of a stored run, or None if the run, or the run that it continues, is gone."""
    found = runs.request(id)
    if found is None:
        return None
    draft = Draft.of({name: part for name, part in orjson.loads(found).items() if name != "output"})
    try:
        draft.start(runs.motion)
    except SceneError:
        return None
    return draft


class Session:
    """The state of one client. Everything but the solve runs on the viewer's event loop, so no locks are needed.

    Args:
        client: the client.
        shared: what all tabs share.
        address: address of the service as the client sees it.
        tab: name of the tab, by which a reloaded page finds its scene; "" for none.
        work: the work to begin with.
    """

    def __init__(self, client: ClientHandle, shared: Shared, address: str, tab: str, work: Work) -> None:
        self.tab = tab
        self._client = client
        self._shared = shared
        self._loop = asyncio.get_running_loop()
        self._draft = work.draft
        self._start = self._draft.start(shared.runs.motion)
        self._shown: tuple[Draft, Prediction] | None = None  # the last refined prediction
        self._latest: Prediction | None = None
        self._look = Look()
        self._dragging = False
        self._refine_timer: asyncio.TimerHandle | None = None
        self._busy_timer: asyncio.TimerHandle | None = None
        self._playback = Playback()
        self._history = work.history
        self._seen_length = 0.0  # m, length of the cable for which the camera was placed
        self._set_up()
        self._outbox = Outbox(client, shared.runs)
        self._picture = Picture(client.scene)
        self._released_at = self._asked_at = -np.inf

        # the declared type is a plain function, but viser would call one of those on another thread
        client.scene.on_click()(self._clicked)  # type: ignore[arg-type]
        self._gizmo = Gizmo(client.scene, self._begin_drag, self._drag, self._end_drag)
        self._shape = ShapeEditor(client, self._shape_dragged)
        self._tell = partial(client.add_notification, auto_close_seconds=TO_READ)
        self._edits = Edits(lambda: self._draft, self._edited, lambda: self._panel.take_draft(self._draft), self._tell)
        # viser calls no on_update for "0.0" after "0", on the way to 0.02: the value is the same
        client._websock_connection.register_handler(GuiUpdateMessage, lambda *_: self._edits.go_on())
        limit_uploads(client, self._refuse_file)
        self._panel = Panel(
            client,
            self._draft,
            self._start,
            self._playback,
            address,
            self._edits,
            self._actions(),
            ready=shared.solver.ready,
            recording=RecordingActions(
                open=self._open_recording,
                show=lambda number: self._tracking.window(number),
                identify=lambda: self._tracking.search(),
                keep=lambda name: self._tracking.keep(name),
            ),
            cables=shared.cables,
        )
        self._tracking = Tracking(
            client.scene,
            self._panel.recording,
            shared.solver,
            shared.cables,
            TrackingActions(
                show=self._show_recorded, draft=self._current, flush=client.flush, kept=self._panel.offer_cables
            ),
        )
        self._take_draft()
        self._solver = SolverThread(shared.solver, self._deliver, f"viewer-solver-{client.client_id}")
        self._ask("refined")
        self._animation = asyncio.create_task(self._animate())

    def _actions(self) -> Actions:
        return Actions(
            look=self._restyle,
            seek=self._draw_time,
            keep=self._keep,
            download=self._download,
            open_file=self._open_file,
            open_example=self._open_example,
            save_playback=self._save_playback,
            save_picture=self._save_picture,
            measure_costs=self._measure_costs,
            stop=self._stop,
            solve=self._solve_again,
            step_back=lambda: self._step(UNDO),
            step_forward=lambda: self._step(REDO),
            edit_shape=self._edit_shape,
            straighten=self._straighten,
            show_whole=self._show_whole,
        )

    def work(self) -> Work:
        """Return the present scene and a copy of its history, with which another session can continue."""
        return Work(self._draft, self._history.copy())

    def close(self) -> None:
        """Stop the solver thread, the animation and all timers."""
        self._solver.close()
        self._tracking.close()
        self._animation.cancel()
        self._edits.close()
        for timer in (self._refine_timer, self._busy_timer):
            if timer is not None:
                timer.cancel()

    def _set_up(self) -> None:
        client = self._client
        client.gui.configure_theme(show_logo=False, show_share_button=False, brand_color=BRAND, control_width="medium")
        client.gui.set_panel_label("Cable")
        client.scene.set_up_direction("+z")
        light(client.scene)
        if client.camera.image_width > PHONE:
            client.gui.main_panel.dock_right()
        client.camera.fov = FIELD_OF_VIEW
        self._reset_camera()

    def _reset_camera(self, shown: SplineSurface | None = None) -> None:
        """Place the camera so that it sees the scene, and the whole motion that is `shown`, if any."""
        camera = self._client.camera
        points = extent(self._draft, self._start, shown)
        on_table = self._draft.get(("environment", "table")) is not None
        position, middle = start_pose(points, camera.image_width, camera.image_height, on_table=on_table)
        camera.max_orbit_distance = max(20.0 * self._draft.length, 2.0 * float(np.linalg.norm(position - middle)))
        camera.position, camera.look_at = position, middle
        self._seen_length = self._draft.length

    def _show_whole(self) -> None:
        self._edits.finish()
        self._reset_camera(None if self._latest is None else self._latest.surface)
        self._client.flush()

    def _begin_drag(self) -> None:
        """Show the end of the motion while the target is being dragged."""
        self._edits.finish()
        self._dragging = True
        self._playback.hold(self._playback.horizon)
        self._draw_time()

    def _drag(self, position: np.ndarray, wxyz: np.ndarray) -> None:
        begin = self._origin()
        if not self._draft.in_space:  # viser sends the gizmo's height in single precision
            position[2] = grips.target(self._draft, begin)[2]
        draft = grips.with_target(self._draft, begin, position)
        if grips.can_turn(draft):
            draft = grips.with_turn(draft, grips.nearest_turn(wxyz, grips.turn(draft)))
        self.edit(draft)

    def _end_drag(self) -> None:
        self._dragging = False
        self._released_at = self._loop.time()
        self._refine()
        self._playback.resume()
        self._draw_time()

    def _origin(self) -> np.ndarray:
        return grips.origin(self._draft, self._start, None if self._latest is None else self._latest.surface)

    async def _clicked(self, event: SceneClickEvent) -> None:
        """Select the clicked gripper, or move the grasp of the selected one to the clicked place on the cable."""
        if self._dragging or self._shape.active or self._loop.time() - self._released_at < AFTER_DRAG:
            return
        found = self._picture.picked(np.array(event.ray_origin), np.array(event.ray_direction))
        draft = self._current()
        if isinstance(found, GripperClick):
            self.edit(grips.selected(draft, found.number))
        elif found is not None:
            if grips.gripper(draft) is None:
                draft = grips.added(draft, self._start)
            self._edited(grips.changed(draft, "u", round(found.u, 4)))

    def _edit_shape(self, wanted: bool) -> None:
        """Show or hide the beads of the start shape."""
        self._edits.finish()
        with self._client.atomic():
            if wanted:
                self._playback.hold(0.0)
                self._shape.show(self._start, self._draft.length)
            else:
                self._shape.hide()
                self._playback.resume()
            self._gizmo.show(visible=not wanted and grips.gripper(self._draft) is not None)
        self._draw_time()

    def _shape_dragged(self, points: np.ndarray, held: bool) -> None:
        self._dragging = held
        self._edited(with_points(self._current(), points))
        if not held:
            self._refine()

    def _straighten(self) -> None:
        draft = self._current()
        self._edited(straightened(draft, self._start))

    def _current(self) -> Draft:
        """Return the draft, including what has been typed so far."""
        self._edits.finish()
        return self._draft

    def edit(self, draft: Draft) -> None:
        """Take over an edited draft: solve a preview at once, and at the requested quality when the edits pause."""
        if draft == self._draft:
            return
        if draft.document != self._draft.document:
            self._history.changed(self._draft, self._loop.time())
        self._change(draft)

    def _edited(self, draft: Draft) -> None:
        """Take over a draft that the user edited; programs of moves shift with what their grippers hold."""
        if grips.have_programs(draft):
            with contextlib.suppress(SceneError):  # the start is impossible
                start = draft.start(self._shared.runs.motion)
                draft = grips.carried(draft, start, self._draft, self._start)
        self.edit(draft)

    def _step(self, name: str) -> None:
        """Undo or redo one step; notify the user if there is none."""
        self._edits.finish()
        back, forward = self._history.steps
        if not (back if name == UNDO else forward):
            self._tell(f"There is nothing to {name.lower()}", "")
            return
        draft = (self._history.back if name == UNDO else self._history.forward)(self._draft)
        if draft != self._draft:
            self._change(draft)

    def _change(self, draft: Draft) -> None:
        before = self._draft
        moved = draft.shape_key() != self._draft.shape_key()
        self._draft = draft
        if moved:
            self._take_start()
        self._take_draft()
        if draft.same_but_name(before):  # another selected gripper or another name: nothing to solve
            self._panel.show_scene(draft)
            self._client.flush()
            return
        self._ask("preview")
        if self._refine_timer is not None:
            self._refine_timer.cancel()
        self._refine_timer = self._loop.call_later(QUIET, self._refine)

    def _take_start(self) -> None:
        """Take over the start curve of the draft; if it is impossible, keep the last good one."""
        with contextlib.suppress(SceneError):
            self._start = self._draft.start(self._shared.runs.motion)
            self._shape.follow(self._start, self._draft.length)
            if not 1 / SEEN <= self._draft.length / self._seen_length <= SEEN:
                self._reset_camera()

    def _take_draft(self) -> None:
        draft = self._draft
        with self._client.atomic():
            self._panel.follow(self._start, None if self._latest is None else self._latest.surface)
            self._panel.take_draft(draft)
            self._panel.clear_kept()
            self._picture.select(draft.selected)
            self._shape.in_space = draft.in_space
            if not self._dragging:
                self._place_gizmo()

    def _place_gizmo(self) -> None:
        draft = self._draft
        self._gizmo.show(visible=not self._shape.active and grips.gripper(draft) is not None)
        self._gizmo.place(
            grips.target(draft, self._origin()),
            grips.turn(draft),
            size=draft.length,
            in_space=draft.in_space,
            turns=grips.can_turn(draft),
        )

    def _refine(self) -> None:
        if self._refine_timer is not None:
            self._refine_timer.cancel()
            self._refine_timer = None
        self._ask("refined")

    def _measure_costs(self) -> None:
        """Have the costs of the effects measured; an edit ends the measurement."""
        self._edits.finish()
        self._ask("costs")

    def _ask(self, kind: Kind) -> None:
        """Have the draft solved; if that takes longer than `PATIENCE`, say that it is running."""
        self._solver.ask(self._draft, kind)
        if kind != "preview":  # nobody reads it while editing
            self._panel.show_scene(self._draft)
        self._asked_at = self._loop.time()
        if self._busy_timer is None:
            self._busy_timer = self._loop.call_later(PATIENCE, self._say_busy)

    def _stop(self) -> None:
        """Stop the running solve; the picture stays as it is."""
        self._solver.stop()
        self._end_wait()
        with self._client.atomic():
            self._panel.take_stop()
        self._client.flush()

    def _solve_again(self) -> None:
        self._edits.finish()
        self._refine()
        self._end_wait()
        self._say_busy()

    def _end_wait(self) -> None:
        if self._busy_timer is not None:
            self._busy_timer.cancel()
            self._busy_timer = None

    def _say_busy(self) -> None:
        self._panel.take_wait(self._loop.time() - self._asked_at, self._shared.solver.longest)
        self._client.flush()
        self._busy_timer = self._loop.call_later(TICK, self._say_busy)

    def _deliver(self, outcome: Outcome) -> None:
        """Hand an outcome from the solver thread to the event loop."""
        with contextlib.suppress(RuntimeError):  # the loop is closed because the service is stopping
            self._loop.call_soon_threadsafe(self._take, outcome)

    def _take(self, outcome: Outcome) -> None:
        if outcome.job.stopped.is_set():  # stopped while the outcome was on its way here
            return
        self._end_wait()
        if self._solver.waiting:
            self._busy_timer = self._loop.call_later(PATIENCE, self._say_busy)
        with self._client.atomic():
            if outcome.prediction is None:
                told = outcome.problem, outcome.details, grips.places(outcome.job.draft)
                self._panel.take_problem(*told)
                self._gizmo.warn(report.problem_label(*told))
                self._picture.refuse(
                    outcome.job.draft.obstacles(), report.named_obstacles(outcome.problem, outcome.details)
                )
            else:
                self._take_prediction(outcome, outcome.prediction)
        self._client.flush()

    def _take_prediction(self, outcome: Outcome, prediction: Prediction) -> None:
        if outcome.costs is not None:
            self._panel.take_costs(prediction, outcome.costs)
            if outcome.costs.found_none:
                self._tell("No costs", "With its effects fixed as they are, this scene has no solve to compare with.")
            return
        preview = outcome.job.kind == "preview"
        self._latest = prediction
        self._playback.set_horizon(prediction.surface.horizon)
        if self._dragging and not self._shape.held:
            self._playback.seek(self._playback.horizon)
        scale = self._picture.show(prediction, self._playback.time, self._draft.selected)
        self._panel.take_prediction(prediction, scale, outcome.measured, preview=preview)
        self._gizmo.warn("" if preview else report.status_label(prediction))
        if not preview:
            self._tracking.take_prediction(prediction)
            self._panel.show_error(self._tracking.card(self._playback.time))
            self._shown = (outcome.job.draft, prediction)
            self._panel.follow(self._start, prediction.surface)
            if not self._dragging:
                self._place_gizmo()

    def _restyle(self, look: Look) -> None:
        self._look = look
        with self._client.atomic():
            scale = self._picture.restyle(look)
            if scale is not None:
                self._panel.take_scale(scale)
        self._client.flush()

    def _draw_time(self, *, panel: bool = True) -> None:
        with self._client.atomic():
            self._picture.pose(self._playback.time)
            self._tracking.pose(self._playback.time)
            if panel:
                self._panel.show_time()
                self._panel.show_error(self._tracking.card(self._playback.time))
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

    def _replace(self, draft: Draft) -> None:
        """Show another scene, and play it from the beginning."""
        self._edits.finish()  # what was typed would go into the other scene
        self._history.close_step()
        self._shape.hide()
        self._panel.end_editing()
        self.edit(draft)
        self._history.close_step()
        self._reset_camera()
        self._playback.seek(0.0)
        self._playback.play()

    async def _open_file(self, name: str, content: bytes) -> None:
        try:
            draft = await asyncio.to_thread(uploads.opened, self._current(), name, content)
        except SceneError as error:
            self._refuse_file(name, error)
            self._panel.say_file(f"{name} was not opened: {error}", good=False)
            return
        self._panel.say_file(f"{name} was opened.", good=True)
        self._tracking.leave()
        self._replace(draft)

    def _refuse_file(self, name: str, error: SceneError) -> None:
        self._client.add_notification(f"{name} was not opened", str(error), color="red", auto_close_seconds=12.0)

    def _show_recorded(self, draft: Draft) -> None:
        """Show a scene with its markers, without the surface and the ghosts that would hide them."""
        look = replace(self._look, surface="hidden", ghosts=False)
        self._panel.show_look(look)
        self._restyle(look)
        self._replace(draft)

    async def _open_recording(self, name: str, content: bytes) -> None:
        await self._tracking.open(name, content)

    def _open_example(self, name: str) -> None:
        draft = of_example(name)
        if draft is not None:
            self._tracking.leave()
            self._replace(draft)

    def _download(self) -> None:
        self._outbox.scene(self._current())

    async def _save_playback(self) -> None:
        draft = self._current()
        prediction = self._solved(draft, "No playback")
        if prediction is not None:
            await self._outbox.playback(draft, prediction, self._look, self._playback.speed)

    async def _save_picture(self) -> None:
        draft = self._current()
        if self._solved(draft, "No picture") is not None:
            await self._outbox.picture(draft)

    async def _keep(self) -> None:
        """Store the last refined prediction with its scene, and link to it; refuse if the scene was edited since."""
        draft = self._current()
        prediction = self._solved(draft, "Not kept")
        run_id = None if prediction is None else await self._outbox.keep(draft, prediction)
        if run_id is not None:
            self._panel.show_kept(run_id)

    def _solved(self, draft: Draft, refusal: str) -> Prediction | None:
        """Return the refined prediction of a scene; if there is none, notify the user, with the title `refusal`."""
        if self._shown is not None and self._shown[0].same_but_name(draft):
            return self._shown[1]
        self._client.add_notification(refusal, "This scene has not been solved.", auto_close_seconds=6.0)
        return None
