"""The control panel: what a person sets, and what the last solve was worth."""

from collections.abc import Awaitable, Callable
from typing import Any

import numpy as np
import viser
from viser import ClientHandle, GuiEvent, uplot

from app.viewer import report
from app.viewer.draft import Draft
from app.viewer.forms import CableForm, GraspForm, QualityForm, SurroundingsForm, show_value
from app.viewer.palette import QUANTITIES, ColourScale
from app.viewer.picture import SURFACE_STYLES, Look
from app.viewer.playback import Playback
from dlocore import Prediction

SPEEDS = {"¼×": 0.25, "½×": 0.5, "1×": 1.0, "2×": 2.0}
SLIDER_STEP = 0.01  # s
PLOT_HEIGHT = 190  # px


class Panel:
    """The panel of one client; every method runs on the viewer's event loop.

    Args:
        client: whose panel it is.
        draft: the scene to start with.
        playback: the clock of the animation.
        address: of the service, for the shell line.
        on_edit: called with the edited draft.
        on_look: called when the picture's options change.
        on_seek: called when the timeline was moved or play was pressed.
        on_keep: called when the run is to be kept.
        on_download: called when the scene is wanted as a file.
    """

    def __init__(
        self,
        client: ClientHandle,
        draft: Draft,
        playback: Playback,
        address: str,
        *,
        on_edit: Callable[[Draft], None],
        on_look: Callable[[Look], None],
        on_seek: Callable[[], None],
        on_keep: Callable[[], Awaitable[None]],
        on_download: Callable[[], None],
    ) -> None:
        self._gui = client.gui
        self._playback = playback
        self._on_seek = on_seek
        self._on_look = on_look
        self._address = address
        self._status = self._gui.add_html(report.waiting_card())
        self._add_timeline()
        self._legend = self._gui.add_html("")
        tabs = self._gui.add_tab_group()
        with tabs.add_tab("Scene", viser.Icon.ADJUSTMENTS_HORIZONTAL):
            self._grasp = GraspForm(self._gui, draft, on_edit)
            self._cable = CableForm(self._gui, draft, on_edit)
            self._surroundings = SurroundingsForm(self._gui, draft, on_edit)
            self._quality = QualityForm(self._gui, draft, on_edit)
        with tabs.add_tab("View", viser.Icon.EYE):
            self._add_view()
        with tabs.add_tab("Result", viser.Icon.CHART_LINE):
            self._add_result()
        with tabs.add_tab("Share", viser.Icon.SHARE):
            self._add_share(on_keep, on_download)
        self._forms = (self._grasp, self._cable, self._surroundings, self._quality)
        self.take_draft(draft)

    def _add_timeline(self) -> None:
        self._slider = self._gui.add_slider(
            "Time [s]", min=0.0, max=self._playback.horizon, step=SLIDER_STEP, initial_value=0.0
        )
        self._play = self._gui.add_button("Pause", icon=viser.Icon.PLAYER_PAUSE)
        self._speed = self._gui.add_dropdown("Speed", tuple(SPEEDS), initial_value="1×")

        @self._slider.on_update
        async def _seek(event: GuiEvent[Any]) -> None:
            if event.client is not None:  # set by the person, not by the animation
                self._playback.pause()
                self._playback.seek(self._slider.value)
                self._label_button()
                self._on_seek()

        @self._play.on_click
        async def _toggle(_event: GuiEvent[Any]) -> None:
            self.toggle()

        @self._speed.on_update
        async def _speed(_event: GuiEvent[Any]) -> None:
            self._playback.speed = SPEEDS.get(self._speed.value, 1.0)

        command = self._gui.add_command("Play or pause", hotkey="P")

        @command.on_trigger
        async def _hotkey(_event: Any) -> None:
            self.toggle()

    def toggle(self) -> None:
        """Play where it stands still, pause where it plays."""
        if self._playback.playing:
            self._playback.pause()
        else:
            self._playback.play()
        self._label_button()
        self._on_seek()

    def _label_button(self) -> None:
        playing = self._playback.playing
        self._play.label = "Pause" if playing else "Play"
        self._play.icon = viser.Icon.PLAYER_PAUSE if playing else viser.Icon.PLAYER_PLAY

    def show_time(self) -> None:
        """Let slider and button follow the playback."""
        show_value(self._slider, min(self._playback.time, float(self._slider.max)))
        if (self._play.label == "Pause") != self._playback.playing:
            self._label_button()

    def _add_view(self) -> None:
        colour = self._gui.add_dropdown("Colour", tuple(QUANTITIES), initial_value="time")
        surface = self._gui.add_dropdown("Surface", SURFACE_STYLES, initial_value="on the table")
        ghosts = self._gui.add_checkbox("Shapes at intervals", initial_value=True)
        looping = self._gui.add_checkbox("Repeat", initial_value=self._playback.looping)

        async def restyle(_event: GuiEvent[Any]) -> None:
            self._on_look(Look(quantity=QUANTITIES[colour.value], surface=surface.value, ghosts=ghosts.value))

        for control in (colour, surface, ghosts):
            control.on_update(restyle)

        @looping.on_update
        async def _looping(_event: GuiEvent[Any]) -> None:
            self._playback.looping = looping.value

    def _add_result(self) -> None:
        self._plot = self._gui.add_uplot(
            (np.zeros(2), np.zeros(2), np.zeros(2)),
            (
                uplot.Series(label="iteration"),
                uplot.Series(label="log10 update [m]", stroke="#2e6bd6", width=2, points={"show": True, "size": 6}),
                uplot.Series(label="log10 residual [m]", stroke="#d55e00", width=2, points={"show": True, "size": 6}),
            ),
            title="Convergence",
            scales={"x": uplot.Scale(time=False), "y": uplot.Scale(auto=True)},
            height=PLOT_HEIGHT,
        )
        with self._gui.add_folder("Force of the grippers"):
            self._grippers = self._gui.add_html("")
        with self._gui.add_folder("Effects"):
            self._effects = self._gui.add_html("")

    def _add_share(self, on_keep: Callable[[], Awaitable[None]], on_download: Callable[[], None]) -> None:
        self._keep = self._gui.add_button("Keep this run", icon=viser.Icon.BOOKMARK, disabled=True)
        self._links = self._gui.add_html("")
        download = self._gui.add_button("Download scene.json", icon=viser.Icon.DOWNLOAD, color="gray")
        with self._gui.add_folder("The same from a shell"):
            self._curl = self._gui.add_markdown("")
        with self._gui.add_folder("Scene as JSON", expand_by_default=False):
            self._json = self._gui.add_markdown("")

        @self._keep.on_click
        async def _kept(_event: GuiEvent[Any]) -> None:
            await on_keep()

        @download.on_click
        async def _download(_event: GuiEvent[Any]) -> None:
            on_download()

    def take_draft(self, draft: Draft) -> None:
        """Show the numbers of an edited draft in all controls."""
        for form in self._forms:
            form.take(draft)
        self._playback.set_horizon(draft.duration)

    def take_prediction(self, draft: Draft, prediction: Prediction, scale: ColourScale, *, preview: bool) -> None:
        """Show a new prediction; a preview leaves out what nobody reads while dragging."""
        self._status.content = report.status_card(prediction, preview=preview)
        self._playback.set_horizon(prediction.surface.horizon)
        if self._slider.max != self._playback.horizon:
            self._slider.max = self._playback.horizon
        self.show_time()
        if preview:
            return
        self.take_scale(scale)
        self._effects.content = report.effects_list(prediction)
        self._grippers.content = report.grippers_list(prediction)
        self._plot.data = report.convergence(prediction)
        document = draft.json()
        self._json.content = report.json_block(document)
        self._curl.content = report.curl_block(self._address, document)
        self._keep.disabled = False

    def take_problem(self, problem: str, details: str) -> None:
        """Say why there is no prediction of the edited scene."""
        self._status.content = report.problem_card(problem, details)
        self._keep.disabled = True

    def take_scale(self, scale: ColourScale) -> None:
        """Show the legend of the colours."""
        self._legend.content = report.legend(scale)

    def show_kept(self, run_id: str) -> None:
        """Link to the stored run."""
        self._links.content = report.run_links(run_id)

    def clear_kept(self) -> None:
        """Take the link away, since the shown run is no longer the stored one."""
        self._links.content = ""
