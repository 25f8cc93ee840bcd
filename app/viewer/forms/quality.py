"""The form of the requested quality: accuracy, time or grid. Only the numbers of the chosen mode are shown."""

from typing import Any, Literal, get_args

from viser import GuiApi

from app.viewer.draft import Draft
from app.viewer.edits import Edits
from app.viewer.forms.base import Form, show_choice, show_if, show_value
from app.viewer.number_field import NumberField
from app.viewer.rounding import rounded

Mode = Literal["automatic", "target error", "time budget", "grid"]
QUALITY = ("quality",)
METHODS: dict[Mode, tuple[str, ...]] = {  # methods that each mode allows
    "automatic": ("auto", "march", "reference"),
    "target error": ("auto", "march", "reference"),
    "time budget": ("auto", "march"),
    "grid": ("auto", "march", "spacetime", "paper"),
}
NONE = "none"  # no threshold given: the method uses its own, and auto is not led to a method that has one
DELTAS = {"10⁻⁴ m": 1e-4, "10⁻⁵ m": 1e-5, "10⁻⁶ m": 1e-6, "10⁻⁷ m": 1e-7, "10⁻⁸ m": 1e-8}


class QualityForm(Form):
    """Edits the requested quality."""

    def __init__(self, gui: GuiApi, draft: Draft, edits: Edits) -> None:
        super().__init__(draft, edits)
        self._mode = gui.add_dropdown("Ask for", get_args(Mode))
        self._error = NumberField(gui, "Target error [mm]", 2.0, low=0.001, high=1e4)
        self._budget = NumberField(gui, "Time budget [ms]", 20.0, low=0.1, high=60_000.0)
        self._n_u = gui.add_slider("Points along n_u", min=5, max=65, step=1, initial_value=9)
        self._n_t = gui.add_slider("Points in time n_t", min=5, max=129, step=1, initial_value=13)
        self._delta = gui.add_dropdown("Threshold δ", (NONE, *DELTAS))
        self._method = gui.add_dropdown("Method", METHODS["grid"])
        self._keep = gui.add_checkbox(
            "Keep this grid", False, hint="Even if its error exceeds 1 % of the length, or it does not converge"
        )
        self._bind(self._mode, self._asked)
        for control in (self._error, self._budget, self._method, *self._of_grid):
            self._bind(control, self._asked)

    @property
    def _of_grid(self) -> tuple[Any, ...]:
        return self._n_u, self._n_t, self._delta, self._keep

    def _asked(self, draft: Draft) -> Draft:
        mode: Mode = self._mode.value
        given = _given(draft)
        wanted: dict[str, Any] = given if mode == _mode(given) else {}  # keep what has no control here
        if mode == "target error":
            wanted["target_error"] = rounded(1e-3 * self._error.value)
        elif mode == "time budget":
            wanted["time_budget"] = rounded(1e-3 * self._budget.value)
        elif mode == "grid":
            wanted["n_u"], wanted["n_t"] = int(self._n_u.value), int(self._n_t.value)
            words = self._delta.value
            wanted["delta"] = None if words == NONE else DELTAS.get(words) or float(words.removesuffix(" m"))
            wanted["keep_grid"] = self._keep.value or None
        method = self._method.value
        wanted["method"] = method if method in METHODS[mode] and method != "auto" else None
        return draft.put(QUALITY, {name: x for name, x in wanted.items() if x is not None} or "auto")

    def take(self, draft: Draft) -> None:
        """Show `draft`."""
        self._draft = draft
        given = _given(draft)
        mode = _mode(given)
        self._error.high = 1e3 * draft.length
        if mode == "target error":
            show_value(self._error, rounded(1e3 * given["target_error"], 7))
        elif mode == "time budget":
            show_value(self._budget, rounded(1e3 * given["time_budget"], 7))
        elif mode == "grid":
            self._take_grid(given)
        self._take_method(given.get("method", "auto"), METHODS[mode])
        show_value(self._mode, mode)
        show_if(self._error, mode == "target error")
        show_if(self._budget, mode == "time budget")
        for control in self._of_grid:
            show_if(control, mode == "grid")

    def _take_method(self, method: str, allowed: tuple[str, ...]) -> None:
        options = allowed if method in allowed else (*allowed, method)
        show_choice(self._method, options, method)

    def _take_grid(self, given: dict[str, Any]) -> None:
        for control, name in ((self._n_u, "n_u"), (self._n_t, "n_t")):
            if control.max < given[name]:
                control.max = given[name]
            show_value(control, given[name])
        delta = given.get("delta")
        words = NONE if delta is None else next((text for text, x in DELTAS.items() if x == delta), f"{delta:g} m")
        if words not in self._delta.options:
            self._delta.options = (NONE, *DELTAS, words)
        show_value(self._delta, words)
        show_value(self._keep, bool(given.get("keep_grid", False)))


def _given(draft: Draft) -> dict[str, Any]:
    asked = draft.get(QUALITY, "auto")
    return {} if isinstance(asked, str) else {name: x for name, x in asked.items() if x is not None}


def _mode(given: dict[str, Any]) -> Mode:
    if "target_error" in given:
        return "target error"
    if "time_budget" in given:
        return "time budget"
    return "grid" if "n_u" in given and "n_t" in given else "automatic"
