"""Programs: paths of several moves in sequence, as waypoints at which the gripper stops.

Paths have the form of a scene's document. The positions of a program are world coordinates, unlike the displacement of
a move. So a program has to be `carried` along when what its gripper holds is moved.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from app.viewer.rounding import listed

Floats = NDArray[np.float64]
Path = dict[str, Any]
HALF_TURN = np.pi * (1.0 + 1e-9)  # rad: two orientations can't express a larger rotation from one to the other
_STAYS = [1.0, 0.0, 0.0, 0.0]


def is_program(path: Path) -> bool:
    """Return whether a path is a program: it stops at its waypoints."""
    return path["kind"] == "waypoints" and path.get("profile", "spline") != "spline"


def can_go_on(path: Path) -> bool:
    """Return whether a path can be followed by a move: it is a program, or a move with at most half a turn."""
    turns = float(np.linalg.norm(path.get("rotation") or (0.0, 0.0, 0.0)))
    return is_program(path) or (path["kind"] == "move" and turns <= HALF_TURN)


def longer(path: Path, begin: Floats) -> Path:
    """Return a path with one more move, which takes as long as the last one and goes nowhere yet.

    `begin` (3,) [m] is the point where the path begins.
    """
    program = path if is_program(path) else _of_move(path, begin)
    more = {name: [*program[name], program[name][-1]] for name in ("positions", "orientations") if program.get(name)}
    return {**program, **more, "times": [*program["times"], program["times"][-1] + lasts(program)]}


def shorter(path: Path) -> Path:
    """Return a program without its last move; if only one move is left, return it as a plain move."""
    fewer = {name: path[name][:-1] for name in ("times", "positions", "orientations") if path.get(name)}
    if len(fewer["times"]) > 2:
        return {**path, **fewer}
    way = np.subtract(fewer["positions"][1], fewer["positions"][0])
    move = {
        "kind": "move",
        "displacement": listed(way),
        "duration": lasts({**path, **fewer}),
        "profile": path["profile"],
    }
    turn = turned({**path, **fewer})
    return {**move, "rotation": listed(turn)} if np.any(turn) else move


def lasts(path: Path) -> float:
    """Return the duration of the last move of a program [s]."""
    return round(float(path["times"][-1] - path["times"][-2]), 9)


def lasting(path: Path, duration: float) -> Path:
    """Return a program whose last move takes `duration` [s]."""
    return {**path, "times": [*path["times"][:-1], round(path["times"][-2] + duration, 9)]}


def turned(path: Path) -> Floats:
    """Return the rotation vector (3,) [rad] by which a program has rotated its gripper at its end."""
    if not path.get("orientations"):
        return np.zeros(3)
    w, x, y, z = path["orientations"][-1]
    return np.array(listed(Rotation.from_quat([x, y, z, w]).as_rotvec()))


def turning(path: Path, turn: Floats) -> Path:
    """Return a program that has rotated its gripper by a rotation vector (3,) [rad] at its end."""
    before = path.get("orientations") or [_STAYS] * len(path["times"])
    return {**path, "orientations": [*before[:-1], _quaternion(turn)]}


def carried(path: Path, by: Floats) -> Path:
    """Return a program shifted as a whole by `by` (3,) [m]."""
    return {**path, "positions": listed(np.add(path["positions"], by))}


def _of_move(path: Path, begin: Floats) -> Path:
    """Return a move as a program of one move."""
    program = {
        "kind": "waypoints",
        "times": [0.0, path["duration"]],
        "positions": listed([begin, np.add(begin, path["displacement"])]),
        "profile": path.get("profile", "minimum_jerk"),
    }
    rotation = path.get("rotation")
    return {**program, "orientations": [_STAYS, _quaternion(np.array(rotation))]} if rotation else program


def _quaternion(turn: Floats) -> list[float]:
    return listed(np.roll(Rotation.from_rotvec(turn).as_quat(), 1), 9)
