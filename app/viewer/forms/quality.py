"""What accuracy, time or grid is asked for; only the numbers of the chosen way are shown."""

from typing import Any, Literal, get_args

from viser import GuiApi

from app.viewer.draft import Draft
from app.viewer.edits import Edits
from app.viewer.forms.base import Form, show_if, show_value

Mode = Literal["automatic", "target error", "time budget", "grid"]
QUALITY = ("quality",)
METHODS = ("auto", "march", "spacetime", "paper")
NONE = "none"  # that of the method, and no reason to take one that has a threshold
DELTAS = {"10⁻⁴ m": 1e-4, "10⁻⁵ m": 1e-5, "10⁻⁶ m": 1e-6, "10⁻⁷ m": 1e-7, "10⁻⁸ m": 1e-8}


class QualityForm(Form):
    """Edits the asked quality."""

    def __init__(self, gui: GuiApi, draft: Draft, edits: Edits) -> None:
        super().__init__(draft, edits)
        self._mode = gui.add_dropdown("Ask for", get_args(Mode))
        self._error = gui.add_number("Target error [mm]", 2.0, min=0.001, max=1e4, step=0.1)
        self._budget = gui.add_number("Time budget [ms]", 20.0, min=0.1, max=60_000.0, step=1.0)
        self._n_u = gui.add_slider("Points along n_u", min=5, max=65, step=1, initial_value=9)
        self._n_t = gui.add_slider("Points in time n_t", min=5, max=129, step=1, initial_value=13)
        self._delta = gui.add_dropdown("Threshold δ", (NONE, *DELTAS))
        self._method = gui.add_dropdown("Method", METHODS)
        self._keep = gui.add_checkbox(
            "Keep this grid", False, hint="Also where it errs by more than 1 % of the length, or does not converge"
        )
        self._bind(self._mode, self._asked)
        for control in (self._error, self._budget, *self._of_grid):
            self._bind(control, self._asked)

    @property
    def _of_grid(self) -> tuple[Any, ...]:
        return self._n_u, self._n_t, self._delta, self._method, self._keep

    def _asked(self, draft: Draft) -> Draft:
        mode: Mode = self._mode.value
        wanted: Any = "auto"
        if mode == "target error":
            wanted = {"target_error": float(f"{1e-3 * self._error.value:.9g}")}
        elif mode == "time budget":
            wanted = {"time_budget": float(f"{1e-3 * self._budget.value:.9g}")}
        elif mode == "grid":
            wanted = {"n_u": int(self._n_u.value), "n_t": int(self._n_t.value)}
            words = self._delta.value
            if words != NONE:
                wanted["delta"] = DELTAS.get(words) or float(words.removesuffix(" m"))
            if self._method.value != "auto":
                wanted["method"] = self._method.value
            if self._keep.value:
                wanted["keep_grid"] = True
        return draft.put(QUALITY, wanted)

    def take(self, draft: Draft) -> None:
        """Show `draft`."""
        self._draft = draft
        asked = draft.get(QUALITY, "auto")
        given = {} if isinstance(asked, str) else {name: x for name, x in asked.items() if x is not None}
        mode: Mode = "automatic"
        if "target_error" in given:
            mode = "target error"
            show_value(self._error, float(f"{1e3 * given['target_error']:.7g}"))
        elif "time_budget" in given:
            mode = "time budget"
            show_value(self._budget, float(f"{1e3 * given['time_budget']:.7g}"))
        elif "n_u" in given and "n_t" in given:
            mode = "grid"
            self._take_grid(given)
        show_value(self._mode, mode)
        show_if(self._error, mode == "target error")
        show_if(self._budget, mode == "time budget")
        for control in self._of_grid:
            show_if(control, mode == "grid")

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
        show_value(self._method, given.get("method", "auto"))
        show_value(self._keep, bool(given.get("keep_grid", False)))
