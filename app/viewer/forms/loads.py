"""The form of the known forces on the cable: where, how and when they act."""

from typing import Any

from viser import GuiApi, GuiEvent

from app.viewer import load_edits
from app.viewer.draft import Draft
from app.viewer.edits import Edits
from app.viewer.forms.base import Form, add_vector, show_choice, show_if, show_value
from app.viewer.number_field import NumberField
from dlocore.scene.cable import MAX_LENGTH

NONE = "no force"
LATEST = 1e4  # s


class LoadsForm(Form):
    """Edits the known forces."""

    def __init__(self, gui: GuiApi, draft: Draft, edits: Edits) -> None:
        super().__init__(draft, edits)
        self._chosen = 0
        with gui.add_folder("Known forces"):
            self._add = gui.add_button("Add a force", color="gray", hint="In addition to grippers and surroundings")
            self._which = gui.add_dropdown("Force", (NONE,))
            self._u = NumberField(gui, "Acts at u [m]", 0.0, low=0.0, high=MAX_LENGTH)
            self._force = add_vector(gui, "Force [N]", (0.0, 0.0, 0.0), step=0.001)
            self._start = NumberField(gui, "From [s]", 0.0, low=0.0, high=LATEST)
            self._end = NumberField(gui, "Until [s]", 0.0, low=0.0, high=LATEST, hint="0: to the end")
            self._over_time = gui.add_html(
                '<div style="margin: 0.2rem 0.75rem; font-size: 0.78rem;">It changes over time as in its file.</div>'
            )
            self._remove = gui.add_button("Remove force", color="gray")
        self._on_click(self._add, self._with_new)
        self._on_click(self._remove, lambda d: load_edits.removed(d, self._chosen))
        self._bind(self._u, lambda d: load_edits.placed(d, self._chosen, self._u.value))
        self._bind(self._force, self._with_force)
        self._bind(self._start, lambda d: load_edits.changed(d, self._chosen, start=self._start.value))
        self._bind(self._end, lambda d: load_edits.changed(d, self._chosen, end=self._end.value))

        @self._which.on_update
        async def _choose(event: GuiEvent[Any]) -> None:
            if event.client is not None and self._which.value in self._names(self._draft):
                chosen = self._names(self._draft).index(self._which.value)
                self._edits.finish()  # what was typed belongs to the previously chosen force
                self._chosen = chosen
                self.take(self._draft)

    def _with_new(self, draft: Draft) -> Draft:
        self._chosen = len(load_edits.loads(draft))
        return load_edits.added(draft)

    def _with_force(self, draft: Draft) -> Draft:
        return load_edits.changed(draft, self._chosen, force=tuple(float(x) for x in self._force.value))

    @staticmethod
    def _names(draft: Draft) -> tuple[str, ...]:
        return tuple(f"{k + 1}: at {load['u']:.3g} m" for k, load in enumerate(load_edits.loads(draft))) or (NONE,)

    def take(self, draft: Draft) -> None:
        """Show `draft`."""
        self._draft = draft
        loads, names = load_edits.loads(draft), self._names(draft)
        self._chosen = max(0, min(self._chosen, len(loads) - 1))
        show_choice(self._which, names, names[self._chosen])
        load = loads[self._chosen] if loads else None
        pull = None if load is None else load_edits.pull(load)
        for any_control in (self._which, self._u, self._remove):
            show_if(any_control, load is not None)
        for control in (self._force, self._start, self._end):
            show_if(control, pull is not None)
        show_if(self._over_time, load is not None and pull is None)
        if load is not None:
            self._u.high = draft.length
            show_value(self._u, load["u"])
        if pull is not None:
            show_value(self._force, pull.force)
            show_value(self._start, pull.start)
            show_value(self._end, pull.end)
