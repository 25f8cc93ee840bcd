"""The form of the grippers: which one is selected, where and how it holds the cable, and where it goes."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, get_args

import numpy as np
from viser import GuiApi

from app.viewer import grips, report
from app.viewer.draft import Draft
from app.viewer.edits import Edits
from app.viewer.forms.base import Form, add_vector, show_choice, show_content, show_if, show_value
from app.viewer.number_field import NumberField
from app.viewer.wording import gripper_name
from dlocore import SplineSurface
from dlocore.scene.scene import MAX_GRASPS
from dlocore.shape.shape import StartCurve

NONE = "no gripper"
HOLDS = {"its place": "point", "place and direction": "tangent", "place, direction and twist": "clamp"}
Notify = Callable[[str, str], object]
ANOTHER, LAST = "Add", "Remove last"
FARTHEST = 1000.0  # m, limit of a target's coordinates


class GripperForm(Form):
    """Edits the selected gripper.

    Args:
        gui: the GUI that gets the controls.
        draft: the scene to start with.
        start: its start curve.
        edits: makes the changes of the draft.
        notify: shows a notification with this title and text.
    """

    def __init__(self, gui: GuiApi, draft: Draft, start: StartCurve, edits: Edits, notify: Notify) -> None:
        super().__init__(draft, edits)
        self._notify = notify
        self._start = start
        self._shown: SplineSurface | None = None
        self._which = gui.add_dropdown("Gripper", self._names(draft), hint="Or click on a gripper in the picture")
        self._buttons = gui.add_button_group("Grippers", ("Add", "Remove"), hint=f"A cable can have up to {MAX_GRASPS}")
        self._u = gui.add_slider(
            "Grasp u [m]", min=0.0, max=1.0, step=0.005, initial_value=0.0, hint="Or click on the cable"
        )
        self._hold = gui.add_dropdown("Holds", tuple(HOLDS))
        self._motion = gui.add_dropdown("Motion", get_args(grips.Motion))
        self._target = add_vector(
            gui, "Target [m]", (0.0, 0.0, 0.0), min=(-FARTHEST,) * 3, max=(FARTHEST,) * 3, step=0.01
        )
        self._turn = add_vector(gui, "Turn [°]", (0.0, 0.0, 0.0), step=5.0, hint="Rotation vector, in the world's axes")
        self._in_space = gui.add_checkbox("Drag in height too", initial_value=False)
        self._duration = NumberField(gui, "Duration [s]", 1.0, low=0.001, high=1e4)
        self._moves = gui.add_button_group(
            "Moves",
            (ANOTHER, LAST),
            hint="Target and duration belong to the last move. A move that goes nowhere is a pause",
        )
        self._waypoints = gui.add_html("")
        with gui.add_folder("Timing", expand_by_default=False) as self._timing:
            self._profile = gui.add_dropdown("Speed profile", grips.PROFILES)
            self._closes = NumberField(gui, "Closes at [s]", 0.0, low=0.0, high=1e4)
            self._opens = NumberField(gui, "Opens at [s]", 0.0, low=0.0, high=1e4, hint="0: it stays closed")
            self._horizon = NumberField(
                gui, "Predict until [s]", 0.0, low=0.0, high=1e4, hint="0: until all paths, grasps and loads have ended"
            )
        self._bind_controls()

    def _bind_controls(self) -> None:
        self._on_click(self._buttons, lambda d: self._with_new(d) if self._buttons.value == "Add" else grips.removed(d))
        self._bind(self._which, lambda d: grips.selected(d, self._which.options.index(self._which.value)))
        self._bind(self._u, lambda d: grips.changed(d, "u", float(self._u.value)))
        self._bind(self._hold, lambda d: grips.with_hold(d, HOLDS[self._hold.value]))
        self._bind(self._motion, lambda d: grips.with_motion(d, self._motion.value))
        self._bind(self._target, lambda d: grips.with_target(d, self._begin(d), np.array(self._target.value)))
        self._bind(self._turn, lambda d: grips.with_turn(d, np.radians(self._turn.value)))
        self._bind(self._in_space, lambda d: replace(d, in_space=self._in_space.value))
        self._bind(self._duration, lambda d: grips.with_duration(d, self._duration.value))
        self._on_click(self._moves, self._with_moves)
        self._bind(self._profile, lambda d: grips.path_changed(d, "profile", self._profile.value))
        self._bind(self._closes, lambda d: grips.changed(d, "grasp_time", self._closes.value or None))
        self._bind(self._opens, lambda d: grips.changed(d, "release_time", self._opens.value or None))
        self._bind(self._horizon, lambda d: d.put(("horizon",), self._horizon.value or None))

    def _with_new(self, draft: Draft) -> Draft:
        """Add a gripper, and notify the user of the targets that this changed."""
        edited = grips.added(draft, self._start)
        pairs = zip(draft.primitives, edited.primitives, strict=False)  # the new one is the last
        for number, (before, after) in enumerate(pairs, 1):
            if before != after:
                words = "The cable would be too short between it and the new gripper."
                self._notify(f"Target of gripper {number} brought within reach", words)
        return edited

    def _with_moves(self, draft: Draft) -> Draft:
        """Add a move after the last one, or remove the last; notify the user if that is not possible."""
        if self._moves.value == LAST:
            if grips.moves(draft) < 2:
                self._notify("One move is left", "To have no move, set Motion to “stays”.")
            return grips.without_last_move(draft)
        longer = grips.with_next_move(draft, self._begin(draft))
        if longer == draft:
            self._notify("No move is added", "The last one rotates by more than half a turn. Make it two moves.")
        return longer

    @staticmethod
    def _names(draft: Draft) -> tuple[str, ...]:
        return tuple(gripper_name(k, u) for k, u in enumerate(grips.places(draft))) or (NONE,)

    def _begin(self, draft: Draft) -> Any:
        return grips.origin(draft, self._start, self._shown)

    def follow(self, start: StartCurve, shown: SplineSurface | None) -> None:
        """Measure targets from a new start curve and, for grippers that close later, from a new prediction."""
        self._start, self._shown = start, shown

    def take(self, draft: Draft) -> None:
        """Show `draft`."""
        self._draft = draft
        names = self._names(draft)
        show_choice(self._which, names, names[min(draft.selected, len(names) - 1)])
        held = grips.gripper(draft)
        path = {} if held is None else held["path"]
        moves = grips.moves(draft)
        for control in (self._u, self._hold, self._motion, self._closes, self._opens):
            show_if(control, held is not None)
        show_if(self._duration, moves > 0)
        show_if(self._profile, moves > 0)
        show_if(self._moves, moves > 0)
        self._moves.label = f"Moves: {moves}"
        show_if(self._target, path.get("kind") in ("move", "waypoints"))
        show_if(self._in_space, held is not None)
        show_if(self._turn, grips.can_turn(draft))
        show_content(self._waypoints, report.waypoints(path))
        show_value(self._horizon, float(draft.get(("horizon",), 0.0)))
        if held is not None:
            self._take_gripper(draft, held)

    def _take_gripper(self, draft: Draft, held: dict[str, Any]) -> None:
        if self._u.max != draft.length:
            self._u.max = draft.length
            self._u.step = 0.005 * draft.length
        show_value(self._u, held["u"])
        hold = held.get("hold", "point")
        show_value(self._hold, next(words for words, name in HOLDS.items() if name == hold))
        motion = grips.motion(draft)
        options = ("moves", "stays", *(["follows waypoints"] if motion == "follows waypoints" else []))
        show_choice(self._motion, options, motion)
        show_value(self._target, tuple(round(float(x), 4) for x in grips.target(draft, self._begin(draft))))
        show_value(self._turn, tuple(round(float(x), 2) for x in np.degrees(grips.turn(draft))))
        show_value(self._in_space, draft.in_space)
        show_value(self._duration, grips.duration(draft))
        show_value(self._profile, held["path"].get("profile", "minimum_jerk"))
        show_value(self._closes, float(held.get("grasp_time") or 0.0))
        show_value(self._opens, float(held.get("release_time") or 0.0))
