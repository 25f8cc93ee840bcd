"""Edit the grippers of a draft: where and how they hold the cable, and where they go."""

import math
from dataclasses import replace
from typing import Any, Literal, cast, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from app.viewer import programs
from app.viewer.draft import Draft
from app.viewer.rounding import listed
from dlocore import SplineSurface
from dlocore.scene.paths import Profile
from dlocore.shape.shape import StartCurve

Floats = NDArray[np.float64]
Motion = Literal["moves", "stays", "follows waypoints"]
PROFILES: tuple[Profile, ...] = get_args(Profile)
DURATION = 1.5  # s, of a new motion
REACH_SHARE = 0.9  # of the cable between two grippers: their distance after a target was brought within reach
_KINDS: dict[str, Motion] = {"move": "moves", "still": "stays", "waypoints": "follows waypoints"}


def gripper(draft: Draft) -> dict[str, Any] | None:
    """Return the selected gripper, if there is one."""
    return draft.primitives[draft.selected] if draft.selected < len(draft.primitives) else None


def places(draft: Draft) -> list[float]:
    """Return where the grippers hold the cable [m]."""
    return [float(primitive["u"]) for primitive in draft.primitives]


def changed(draft: Draft, name: str, value: Any) -> Draft:
    """Set a field of the selected gripper; None removes it."""
    return draft if gripper(draft) is None else draft.put(("primitives", draft.selected, name), value)


def path_changed(draft: Draft, name: str, value: Any) -> Draft:
    """Set a field of the path of the selected gripper; None removes it."""
    return draft if gripper(draft) is None else draft.put(("primitives", draft.selected, "path", name), value)


def motion(draft: Draft) -> Motion:
    """Return what the selected gripper does."""
    held = gripper(draft)
    if held is None:
        return "stays"
    return "moves" if programs.is_program(held["path"]) else _KINDS[held["path"]["kind"]]


def with_motion(draft: Draft, wanted: Motion) -> Draft:
    """Let the selected gripper move (with no displacement yet) or stay; waypoints come only from files."""
    if gripper(draft) is None or wanted == motion(draft) or wanted == "follows waypoints":
        return draft
    path: dict[str, Any] = {"kind": "still"}
    if wanted == "moves":
        path = {"kind": "move", "displacement": [0.0, 0.0, 0.0], "duration": DURATION, "profile": "minimum_jerk"}
    edited = changed(draft, "path", path)
    return edited if wanted == "moves" else _with_horizon(edited)


def _with_horizon(draft: Draft) -> Draft:
    """Give the scene a horizon if none of its paths has a duration any more."""
    moves = any(primitive["path"]["kind"] != "still" for primitive in draft.primitives)
    return draft if moves or draft.get(("horizon",)) is not None else draft.put(("horizon",), DURATION)


def with_hold(draft: Draft, hold: str) -> Draft:
    """Set how the selected gripper holds the cable: `point`, `tangent` or `clamp`; a point has no rotation."""
    edited = changed(draft, "hold", hold)
    if hold != "point":
        return edited
    return path_changed(path_changed(edited, "rotation", None), "orientations", None)


def selected(draft: Draft, number: int) -> Draft:
    """Select another gripper."""
    return replace(draft, selected=number) if 0 <= number < len(draft.primitives) else draft


def added(draft: Draft, start: StartCurve) -> Draft:
    """Add a gripper that stays, as far from the others as possible, and select it.

    Targets of other grippers that the cable could no longer reach are brought within reach.
    """
    length, count = draft.length, len(draft.primitives)
    places = np.linspace(0.0, length, 21)
    others = np.array([primitive["u"] for primitive in draft.primitives])
    farthest = np.abs(places[:, None] - others[None]).min(axis=1) if count else places
    u = float(places[int(np.argmax(farthest))])
    new = {"u": u, "hold": "point", "path": {"kind": "still"}}
    edited = draft.put(("primitives",), [*draft.primitives, new])
    for k in range(count):
        edited = _in_reach(edited, k, u, start)
    return _with_horizon(replace(edited, selected=count))


def _in_reach(draft: Draft, k: int, u: float, start: StartCurve) -> Draft:
    """Bring the target of gripper `k` within reach of the cable, whose point at `u` is held still."""
    primitive = draft.primitives[k]
    if primitive["path"]["kind"] != "move":
        return draft
    begin, fixed = start(primitive["u"])[0], start(u)[0]
    target = begin + np.array(primitive["path"]["displacement"], dtype=float)
    reach = REACH_SHARE * abs(u - primitive["u"])
    distance = float(np.linalg.norm(target - fixed))
    if distance <= reach:
        return draft
    near = fixed + (target - fixed) * reach / distance
    return draft.put(("primitives", k, "path", "displacement"), listed(near - begin))


def removed(draft: Draft) -> Draft:
    """Remove the selected gripper."""
    rest = [primitive for k, primitive in enumerate(draft.primitives) if k != draft.selected]
    return _with_horizon(replace(draft.put(("primitives",), rest), selected=max(0, min(draft.selected, len(rest) - 1))))


def origin(draft: Draft, start: StartCurve, shown: SplineSurface | None) -> Floats:
    """Return where the path of the selected gripper begins, (3,) [m]: where the cable is when the gripper closes.

    Args:
        draft: the draft.
        start: start curve of the draft.
        shown: the last prediction, needed for grippers that close later.
    """
    held = gripper(draft)
    if held is None:
        return start(0.5 * draft.length)[0]
    closes = held.get("grasp_time") or 0.0
    if closes > 0.0 and shown is not None and held["u"] <= shown.length:
        return shown.positions([held["u"]], [min(closes, shown.horizon)])[0, 0]
    return start(held["u"])[0]


def target(draft: Draft, begin: Floats) -> Floats:
    """Return where the path of the selected gripper ends, (3,) [m], if it begins at `begin`."""
    held = gripper(draft)
    path = {"kind": "still"} if held is None else held["path"]
    if path["kind"] == "move":
        return begin + np.array(path["displacement"], dtype=float)
    if path["kind"] == "waypoints":
        return np.array(path["positions"][-1], dtype=float)
    return begin


def with_target(draft: Draft, begin: Floats, point: Floats) -> Draft:
    """Let the path of the selected gripper end at `point` (3,) [m]; a gripper that stayed now moves."""
    held = gripper(draft)
    if held is None:
        return draft
    if held["path"]["kind"] == "waypoints":
        last = len(held["path"]["positions"]) - 1
        return draft.put(("primitives", draft.selected, "path", "positions", last), listed(point))
    return path_changed(with_motion(draft, "moves"), "displacement", listed(np.asarray(point) - begin))


def with_next_move(draft: Draft, begin: Floats) -> Draft:
    """Append a move, from its target on, to the path of the selected gripper, which begins at `begin` (3,) [m]."""
    held = gripper(draft)
    if held is None or not programs.can_go_on(held["path"]):
        return draft
    return changed(draft, "path", programs.longer(held["path"], begin))


def without_last_move(draft: Draft) -> Draft:
    """Remove the last of several moves of the selected gripper."""
    held = gripper(draft)
    if held is None or not programs.is_program(held["path"]):
        return draft
    return changed(draft, "path", programs.shorter(held["path"]))


def moves(draft: Draft) -> int:
    """Return the number of moves of the selected gripper."""
    held = gripper(draft)
    path = {"kind": "still"} if held is None else held["path"]
    return len(path["times"]) - 1 if programs.is_program(path) else int(path["kind"] == "move")


def duration(draft: Draft) -> float:
    """Return the duration of the last move of the selected gripper [s]."""
    held = gripper(draft)
    path = {} if held is None else held["path"]
    return programs.lasts(path) if moves(draft) > 1 else float(path.get("duration", DURATION))


def with_duration(draft: Draft, value: float) -> Draft:
    """Let the last move of the selected gripper take `value` [s]."""
    held = gripper(draft)
    if held is not None and programs.is_program(held["path"]):
        return changed(draft, "path", programs.lasting(held["path"], value))
    return path_changed(draft, "duration", value)


def have_programs(draft: Draft) -> bool:
    """Return whether any gripper makes several moves."""
    return any(programs.is_program(primitive["path"]) for primitive in draft.primitives)


def carried(draft: Draft, start: StartCurve, before: Draft, start_before: StartCurve) -> Draft:
    """Return an edited draft whose programs are shifted along with the points that their grippers hold.

    Args:
        draft: the draft after the edit.
        start: start curve of `draft`.
        before: the draft before the edit.
        start_before: start curve of `before`.
    """
    for k, (now, then) in enumerate(zip(draft.primitives, before.primitives, strict=False)):
        late = now.get("grasp_time") or then.get("grasp_time")
        if late or not programs.is_program(now["path"]) or now["path"] != then["path"]:
            continue
        way = start(now["u"])[0] - start_before(then["u"])[0]
        if np.any(way):
            draft = draft.put(("primitives", k, "path"), programs.carried(now["path"], way))
    return draft


def can_turn(draft: Draft) -> bool:
    """Return whether the selected gripper holds a direction that its path can rotate."""
    held = gripper(draft)
    return held is not None and held.get("hold", "point") != "point" and motion(draft) != "follows waypoints"


def turn(draft: Draft) -> Floats:
    """Return the rotation vector of the selected gripper (3,) [rad]."""
    held = gripper(draft)
    if held is not None and programs.is_program(held["path"]):
        return programs.turned(held["path"])
    return np.array(draft.get(("primitives", draft.selected, "path", "rotation"), (0.0, 0.0, 0.0)), dtype=float)


def with_turn(draft: Draft, rotation: Floats) -> Draft:
    """Set the rotation vector of the selected gripper (3,) [rad]."""
    if not can_turn(draft):
        return draft
    path = draft.primitives[draft.selected]["path"]
    if programs.is_program(path):
        return changed(draft, "path", programs.turning(path, rotation))
    value = None if float(np.linalg.norm(rotation)) < 1e-9 else listed(rotation)
    return path_changed(with_motion(draft, "moves"), "rotation", value)


def nearest_turn(wxyz: Floats, before: Floats) -> Floats:
    """Return the rotation vector (3,) [rad] of a quaternion that is nearest to the vector `before`.

    A quaternion gives a rotation only up to full turns, but a gripper may be rotated by several.
    """
    vector = Rotation.from_quat(np.roll(np.asarray(wxyz, dtype=float), -1)).as_rotvec()
    angle = float(np.linalg.norm(vector))
    if angle < 1e-9:
        length = float(np.linalg.norm(before))
        axis = before / length if length > math.pi else np.array([0.0, 0.0, 1.0])
        angle = 0.0
    else:
        axis = vector / angle
    full = 2.0 * math.pi * np.arange(-8, 9)[:, None]
    choices = (angle + full) * axis
    return cast(Floats, choices[int(np.argmin(np.linalg.norm(choices - before, axis=1)))])
