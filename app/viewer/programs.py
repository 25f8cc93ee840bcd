"""Programs: paths of several moves, one after another, as waypoints at which the gripper stops.

The paths are those of a scene's document. Positions of a program are in the world, unlike the displacement of a move:
a program has to be `carried` along with what its gripper holds.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

Floats = NDArray[np.float64]
Path = dict[str, Any]
DIGITS = 6  # of numbers in the document
HALF_TURN = np.pi * (1.0 + 1e-9)  # rad: two orientations tell no longer way from one to the other
_STAYS = [1.0, 0.0, 0.0, 0.0]


def is_program(path: Path) -> bool:
    """Tell whether a path stops at its waypoints."""
    return path["kind"] == "waypoints" and path.get("profile", "spline") != "spline"


def can_go_on(path: Path) -> bool:
    """Tell whether a path can be followed by a move: a program, or a move that turns by half a turn at most."""
    turns = float(np.linalg.norm(path.get("rotation") or (0.0, 0.0, 0.0)))
    return is_program(path) or (path["kind"] == "move" and turns <= HALF_TURN)


def longer(path: Path, begin: Floats) -> Path:
    """Return a path with a move more, that takes as long as the one before and goes nowhere yet.

    `begin` (3,) [m] is where the path begins.
    """
    program = path if is_program(path) else _of_move(path, begin)
    more = {name: [*program[name], program[name][-1]] for name in ("positions", "orientations") if program.get(name)}
    return {**program, **more, "times": [*program["times"], program["times"][-1] + lasts(program)]}


def shorter(path: Path) -> Path:
    """Return a program without its last move; where one is left, that move."""
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
    """Return how long the last move of a program takes [s]."""
    return round(float(path["times"][-1] - path["times"][-2]), 9)


def lasting(path: Path, duration: float) -> Path:
    """Return a program whose last move takes `duration` [s]."""
    return {**path, "times": [*path["times"][:-1], round(path["times"][-2] + duration, 9)]}


def turned(path: Path) -> Floats:
    """Return the rotation vector (3,) [rad] by which a program has turned its gripper in the end."""
    if not path.get("orientations"):
        return np.zeros(3)
    w, x, y, z = path["orientations"][-1]
    return np.round(Rotation.from_quat([x, y, z, w]).as_rotvec(), DIGITS)


def turning(path: Path, turn: Floats) -> Path:
    """Return a program that has turned its gripper by a rotation vector (3,) [rad] in the end."""
    before = path.get("orientations") or [_STAYS] * len(path["times"])
    return {**path, "orientations": [*before[:-1], _quaternion(turn)]}


def carried(path: Path, by: Floats) -> Path:
    """Return a program that is moved by a way (3,) [m] as a whole."""
    return {**path, "positions": [listed(np.add(position, by)) for position in path["positions"]]}


def listed(vector: Sequence[float] | Floats) -> list[float]:
    """Return numbers for the document, to the micrometre or microradian: finer digits mean nothing to a reader."""
    return [round(float(x), DIGITS) + 0.0 for x in vector]


def _of_move(path: Path, begin: Floats) -> Path:
    """Return a move as a program of one."""
    program = {
        "kind": "waypoints",
        "times": [0.0, path["duration"]],
        "positions": [listed(begin), listed(begin + np.array(path["displacement"], dtype=float))],
        "profile": path.get("profile", "minimum_jerk"),
    }
    rotation = path.get("rotation")
    return {**program, "orientations": [_STAYS, _quaternion(np.array(rotation))]} if rotation else program


def _quaternion(turn: Floats) -> list[float]:
    x, y, z, w = Rotation.from_rotvec(turn).as_quat()
    return [round(float(value), 9) for value in (w, x, y, z)]
