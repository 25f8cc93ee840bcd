"""The form of the effects: whether each is on, off or automatic, whether and why it is simulated, and its cost."""

from collections.abc import Mapping
from functools import partial
from typing import Any, get_args

from viser import GuiApi

from app.viewer import report
from app.viewer.draft import Draft
from app.viewer.edits import Edits
from app.viewer.forms.base import Form, show_content, show_value
from dlocore import EffectReport
from dlocore.scene.scene import EFFECTS, NEEDED, Switch

SWITCHES: tuple[Switch, ...] = get_args(Switch)


class EffectsForm(Form):
    """Edits the switches of the effects, and shows which were simulated."""

    def __init__(self, gui: GuiApi, draft: Draft, edits: Edits) -> None:
        super().__init__(draft, edits)
        self._switches: dict[str, Any] = {}
        self._notes: dict[str, Any] = {}
        self._mark = gui.add_html("")
        for name in EFFECTS:
            options = tuple(option for option in SWITCHES if option != "off" or name not in NEEDED)
            self._switches[name] = gui.add_dropdown(name.replace("_", " "), options)
            self._notes[name] = gui.add_html("")
            self._bind(self._switches[name], partial(self._with, name))

    def _with(self, name: str, draft: Draft) -> Draft:
        given = draft.get(("effects",), "auto")
        switches = {} if isinstance(given, str) else {k: v for k, v in given.items() if v != "auto"}
        switches.pop(name, None)
        if self._switches[name].value != "auto":
            switches[name] = self._switches[name].value
        return draft.put(("effects",), switches or "auto")

    def take(self, draft: Draft) -> None:
        """Show `draft`."""
        self._draft = draft
        given = draft.get(("effects",), "auto")
        for name, switch in self._switches.items():
            show_value(switch, "auto" if isinstance(given, str) else given.get(name, "auto"))

    def show(self, effects: tuple[EffectReport, ...], costs: Mapping[str, float]) -> None:
        """Show what was simulated and why, and the known costs of effects in solve time [s]."""
        show_content(self._mark, "")
        for effect in effects:
            show_content(self._notes[effect.name], report.effect_note(effect, costs.get(effect.name)))

    def mark_stale(self) -> None:
        """Mark the notes as those of the previous scene."""
        if self._mark.content or not any(note.content for note in self._notes.values()):
            return
        self._mark.content = report.dimmed(report.OF_BEFORE)
        for note in self._notes.values():
            note.content = report.dimmed(note.content)
