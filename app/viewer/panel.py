"""The control panel: the settings of the scene, and the results of the last solve."""

from collections.abc import Awaitable, Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import viser
from viser import ClientHandle, GuiEvent

from app.pages.gallery import examples
from app.store.cables import KeptCables
from app.viewer import report
from app.viewer.costs import Costs
from app.viewer.draft import Draft
from app.viewer.edits import Edits
from app.viewer.forms import CableForm, EffectsForm, GripperForm, LoadsForm, QualityForm, SurroundingsForm, show_value
from app.viewer.forms.recording import RecordingActions, RecordingForm
from app.viewer.palette import QUANTITIES, ColourScale
from app.viewer.picture import SURFACE_STYLES, Look
from app.viewer.playback import Playback
from app.viewer.shapes import with_settling
from app.viewer.solve_card import SolveCard
from app.viewer.step_buttons import StepButtons
from dlocore import Prediction, SplineSurface
from dlocore.calibration import Measured
from dlocore.shape.shape import StartCurve

SPEEDS = {"¼×": 0.25, "½×": 0.5, "1×": 1.0, "2×": 2.0}
SLIDER_STEPS = 160  # of the timeline
CHOOSE = "choose …"
TO_READ = 12.0  # s that a notification stays visible


@dataclass(frozen=True, kw_only=True)
class Actions:
    """What the panel can have the session do.

    Attributes:
        look: change how the picture is drawn.
        seek: draw the current time of the playback.
        keep: store the run.
        download: send the scene as a file.
        open_file: open a file of this name and content.
        open_example: open the ready scene of this name.
        save_playback: send the playback as a page.
        save_picture: send a picture.
        measure_costs: measure the costs of the effects.
        stop: stop the running solve.
        solve: solve at the requested quality.
        step_back: undo the last change.
        step_forward: redo it.
        edit_shape: show or hide the beads of the start shape.
        straighten: make the start shape straight.
        show_whole: move the camera so that the whole scene is visible.
    """

    look: Callable[[Look], None]
    seek: Callable[[], None]
    keep: Callable[[], Awaitable[None]]
    download: Callable[[], None]
    open_file: Callable[[str, bytes], Awaitable[None]]
    open_example: Callable[[str], None]
    save_playback: Callable[[], Awaitable[None]]
    save_picture: Callable[[], Awaitable[None]]
    measure_costs: Callable[[], None]
    stop: Callable[[], None]
    solve: Callable[[], None]
    step_back: Callable[[], None]
    step_forward: Callable[[], None]
    edit_shape: Callable[[bool], None]
    straighten: Callable[[], None]
    show_whole: Callable[[], None]


class Panel:
    """The panel of one client; every method runs on the viewer's event loop.

    Args:
        client: whose panel it is.
        draft: the scene to start with.
        start: its start curve.
        playback: the clock of the animation.
        address: address of the service, for the shell command.
        edits: makes the changes of the draft.
        actions: what the controls do other than edit the draft.
        ready: whether the solver is compiled.
        recording: what the controls of recordings do.
        cables: cables that were kept as presets.
    """

    def __init__(
        self,
        client: ClientHandle,
        draft: Draft,
        start: StartCurve,
        playback: Playback,
        address: str,
        edits: Edits,
        actions: Actions,
        *,
        ready: bool,
        recording: RecordingActions,
        cables: KeptCables,
    ) -> None:
        self._gui = client.gui
        self._playback = playback
        self._edits = edits
        self._actions = actions
        self._address = address
        self._earlier: list[tuple[float, float]] = []
        self._measured: Prediction | None = None  # the prediction whose effects are being measured
        self._stale = False  # whether the results are those of the previous scene
        self._solve = SolveCard(self._gui, report.waiting_card(ready=ready), actions.stop, actions.solve)
        self._add_timeline()
        StepButtons(self._gui, actions.step_back, actions.step_forward)
        self._legend = self._gui.add_html("")
        tabs = self._gui.add_tab_group()
        with tabs.add_tab("Scene"):
            self._gripper = GripperForm(
                self._gui, draft, start, edits, partial(client.add_notification, auto_close_seconds=TO_READ)
            )
            self._add_start()
            self._cable = CableForm(self._gui, draft, edits, cables)
            self._surroundings = SurroundingsForm(self._gui, draft, edits)
            self._loads = LoadsForm(self._gui, draft, edits)
        with tabs.add_tab("Effects"):
            self._add_effects(draft)
        with tabs.add_tab("Quality"):
            self._quality = QualityForm(self._gui, draft, edits)
            self._add_result()
        with tabs.add_tab("View"):
            self._add_view()
        with tabs.add_tab("Files"):
            self._add_share()
            with self._gui.add_folder("Tracked cable"):
                self.recording = RecordingForm(self._gui, recording)
        self._forms = (self._gripper, self._cable, self._surroundings, self._loads, self._effects, self._quality)

    def _add_timeline(self) -> None:
        self._slider = self._gui.add_slider(
            "Time [s]", min=0.0, max=self._playback.horizon, step=0.01, initial_value=0.0
        )
        self._play = self._gui.add_button("Pause", icon=viser.Icon.PLAYER_PAUSE)
        whole = self._gui.add_button("Show the whole scene", icon=viser.Icon.MAXIMIZE, color="gray")
        self._speed = self._gui.add_dropdown("Speed", tuple(SPEEDS), initial_value="1×")
        self._error = self._gui.add_html("")

        @self._slider.on_update
        async def _seek(event: GuiEvent[Any]) -> None:
            if event.client is not None:  # set by the user, not by the animation
                self._playback.pause()
                self._playback.seek(self._slider.value)
                self._label_button()
                self._actions.seek()

        @self._play.on_click
        async def _toggle(_event: GuiEvent[Any]) -> None:
            self.toggle()

        @whole.on_click
        async def _show_whole(_event: GuiEvent[Any]) -> None:
            self._actions.show_whole()

        @self._speed.on_update
        async def _speed(_event: GuiEvent[Any]) -> None:
            self._playback.speed = SPEEDS.get(self._speed.value, 1.0)

        command = self._gui.add_command("Play or pause", hotkey="P")

        @command.on_trigger
        async def _hotkey(_event: Any) -> None:
            self.toggle()

    def toggle(self) -> None:
        """Play if paused, pause if playing."""
        if self._playback.playing:
            self._playback.pause()
        else:
            self._playback.play()
        self._label_button()
        self._actions.seek()

    def _label_button(self) -> None:
        playing = self._playback.playing
        self._play.label = "Pause" if playing else "Play"
        self._play.icon = viser.Icon.PLAYER_PAUSE if playing else viser.Icon.PLAYER_PLAY

    def show_time(self) -> None:
        """Let slider and button show the state of the playback."""
        show_value(self._slider, min(self._playback.time, float(self._slider.max)))
        if (self._play.label == "Pause") != self._playback.playing:
            self._label_button()

    def show_error(self, html: str) -> None:
        """Show the distance of the prediction from a recording; "" if there is none."""
        if self._error.content != html:
            self._error.content = html

    def show_look(self, look: Look) -> None:
        """Show how the motion is drawn."""
        show_value(self._surface, look.surface)
        show_value(self._ghosts, look.ghosts)

    def offer_cables(self) -> None:
        """Offer the kept cables among the presets."""
        self._cable.offer()

    def _add_start(self) -> None:
        with self._gui.add_folder("Start shape", expand_by_default=False):
            self._editing = self._gui.add_checkbox("Drag its points", initial_value=False)
            self._settle = self._gui.add_checkbox(
                "Let it settle first", initial_value=False, hint="The cable comes to rest before its grippers move"
            )
            straighten = self._gui.add_button("Make it straight", color="gray")
            self._add_file_button("Open points …", "Points [m], ordered or unordered: .csv, .txt, .json, .npz or .npy")

        @self._editing.on_update
        async def _edit(event: GuiEvent[Any]) -> None:
            if event.client is not None:
                self._actions.edit_shape(self._editing.value)

        @self._settle.on_update
        async def _settled(event: GuiEvent[Any]) -> None:
            if event.client is not None:
                self._edits.by(self._settle, lambda d: with_settling(d, self._settle.value))

        @straighten.on_click
        async def _straight(_event: GuiEvent[Any]) -> None:
            self._actions.straighten()

    def _add_file_button(self, label: str, hint: str) -> None:
        button = self._gui.add_upload_button(label, hint=hint, icon=viser.Icon.FOLDER_OPEN, color="gray")

        @button.on_upload
        async def _uploaded(_event: GuiEvent[Any]) -> None:
            await self._actions.open_file(button.value.name, button.value.content)

    def _add_effects(self, draft: Draft) -> None:
        measure = self._gui.add_button(
            "Measure what each costs", icon=viser.Icon.CLOCK, hint="Solves again without each effect in turn"
        )
        self._effects = EffectsForm(self._gui, draft, self._edits)

        @measure.on_click
        async def _measure(_event: GuiEvent[Any]) -> None:
            self._actions.measure_costs()

    def _add_view(self) -> None:
        colour = self._gui.add_dropdown("Colour", tuple(QUANTITIES), initial_value="time")
        surface = self._surface = self._gui.add_dropdown("Surface", SURFACE_STYLES)
        ghosts = self._ghosts = self._gui.add_checkbox("Shapes at intervals", initial_value=True)
        forces = self._gui.add_checkbox("Forces", initial_value=True, hint="Forces of the grippers, and known forces")
        contacts = self._gui.add_checkbox("Contacts", initial_value=True)
        looping = self._gui.add_checkbox("Repeat", initial_value=self._playback.looping)

        async def restyle(_event: GuiEvent[Any]) -> None:
            self._actions.look(
                Look(
                    quantity=QUANTITIES[colour.value],
                    surface=surface.value,
                    ghosts=ghosts.value,
                    forces=forces.value,
                    contacts=contacts.value,
                )
            )

        for control in (colour, surface, ghosts, forces, contacts):
            control.on_update(restyle)

        @looping.on_update
        async def _looping(_event: GuiEvent[Any]) -> None:
            self._playback.looping = looping.value

    def _add_result(self) -> None:
        with self._gui.add_folder("Accuracy and time"):
            self._accuracy = self._gui.add_html("")
        with self._gui.add_folder("Convergence of this solve"):
            self._convergence = self._gui.add_html("")
            self._message = self._gui.add_html("")
        with self._gui.add_folder("Largest forces on the cable"):
            self._forces = self._gui.add_html("")

    def _add_share(self) -> None:
        actions = self._actions
        self._name = self._gui.add_text("Name", "", hint="Name of the run in lists")
        self._keep = self._gui.add_button("Keep this run", icon=viser.Icon.BOOKMARK, disabled=True)
        self._links = self._gui.add_html("")
        with self._gui.add_folder("Scene"):
            download = self._gui.add_button("Download scene.json", icon=viser.Icon.DOWNLOAD, color="gray")
            self._add_file_button("Open a file …", "A scene as JSON, or points: JSON, CSV, .npz or .npy")
            self._file = self._gui.add_html("")
            self._add_examples()
        with self._gui.add_folder("Take it away"):
            playback = self._gui.add_button("Save playback.html", icon=viser.Icon.MOVIE, color="gray")
            picture = self._gui.add_button("Save picture.png", icon=viser.Icon.PHOTO, color="gray")
        with self._gui.add_folder("The same from a shell"):
            self._curl = self._gui.add_markdown("")
        with self._gui.add_folder("Scene as JSON", expand_by_default=False):
            self._json = self._gui.add_markdown("")

        @self._name.on_update
        async def _named(event: GuiEvent[Any]) -> None:
            if event.client is not None:
                self._edits.by(self._name, lambda d: d.put(("name",), self._name.value[:200] or None))

        @self._keep.on_click
        async def _kept(_event: GuiEvent[Any]) -> None:
            await actions.keep()

        @download.on_click
        async def _download(_event: GuiEvent[Any]) -> None:
            actions.download()

        @playback.on_click
        async def _playback(_event: GuiEvent[Any]) -> None:
            await actions.save_playback()

        @picture.on_click
        async def _picture(_event: GuiEvent[Any]) -> None:
            await actions.save_picture()

    def _add_examples(self) -> None:
        chosen = self._gui.add_dropdown("Example", (CHOOSE, *examples()))

        @chosen.on_update
        async def _chosen(event: GuiEvent[Any]) -> None:
            if event.client is not None and chosen.value != CHOOSE:
                self._actions.open_example(chosen.value)

    def follow(self, start: StartCurve, shown: SplineSurface | None) -> None:
        """Measure targets from a new start curve and prediction."""
        self._gripper.follow(start, shown)

    def take_draft(self, draft: Draft) -> None:
        """Show the numbers of an edited draft in all controls."""
        for form in self._forms:
            form.take(draft)
        show_value(self._settle, bool(draft.get(("shape", "settle"))))
        show_value(self._name, draft.get(("name",), ""))

    def show_scene(self, draft: Draft) -> None:
        """Show the scene as JSON, and the shell command that posts it."""
        self._json.content = report.json_block(draft.document)
        self._curl.content = report.curl_block(self._address, draft.document)

    def end_editing(self) -> None:
        """Show that the start shape is no longer being dragged."""
        show_value(self._editing, False)

    def take_prediction(
        self,
        prediction: Prediction,
        scale: ColourScale,
        measured: tuple[Measured, ...],
        *,
        preview: bool,
    ) -> None:
        """Show a new prediction; a preview updates only the status card and the timeline.

        Args:
            prediction: the prediction.
            scale: scale of the colours.
            measured: the calibration of this machine.
            preview: whether the prediction is a preview.
        """
        self._measured = None
        self._solve.show(report.status_card(prediction, preview=preview))
        if self._slider.max != self._playback.horizon:
            self._slider.max = self._playback.horizon
            self._slider.step = self._playback.horizon / SLIDER_STEPS
        self.show_time()
        if preview:
            return
        self._stale = False
        self.take_scale(scale)
        self._effects.show(prediction.effects, {})
        self._forces.content = report.forces_list(prediction)
        self._accuracy.content = report.accuracy_plot(prediction, self._earlier, measured)
        self._convergence.content = report.convergence(prediction)
        self._message.content = report.message(prediction)
        self._keep.disabled = False

    def take_wait(self, elapsed: float, longest: float) -> None:
        """Show that a solve has been running for `elapsed` [s], and that it takes at most `longest` [s]."""
        self._measured = None
        self._solve.show(report.solving_card(elapsed, longest), offer="stop")
        self._mark_stale()

    def take_stop(self) -> None:
        """Show that the user stopped the solve; if costs were being measured, show the state of the answer instead."""
        if self._measured is None:
            self._solve.show(report.stopped_card(), offer="solve")
        else:
            self._solve.show(report.status_card(self._measured, preview=False))

    def _mark_stale(self) -> None:
        """Mark the results as those of the previous scene."""
        if not self._stale:
            self._stale = True
            for part in (self._accuracy, self._convergence, self._message, self._forces):
                part.content = report.stale(part.content)
            self._effects.mark_stale()

    def take_costs(self, prediction: Prediction, costs: Costs) -> None:
        """Show the costs of the effects measured so far."""
        self._effects.show(prediction.effects, costs.seconds)
        if costs.effect:
            self._measured = prediction
            self._solve.show(report.measuring_card(costs), offer="stop")
        else:
            self._solve.show(report.status_card(prediction, preview=False))

    def take_problem(self, problem: str, details: str, places: Sequence[float]) -> None:
        """Show why the edited scene has no prediction; its grippers hold the cable at `places` [m]."""
        self._solve.show(report.problem_card(problem, details, places))
        self._mark_stale()
        self._keep.disabled = True

    def take_scale(self, scale: ColourScale) -> None:
        """Show the legend of the colours."""
        self._legend.content = report.legend(scale)

    def say_file(self, text: str, *, good: bool) -> None:
        """Show whether a file was opened."""
        self._file.content = report.note(text, good=good)

    def show_kept(self, run_id: str) -> None:
        """Link to the stored run."""
        self._links.content = report.run_links(run_id)

    def clear_kept(self) -> None:
        """Remove the links, since the shown run is no longer the stored one."""
        if self._links.content:
            self._links.content = ""
