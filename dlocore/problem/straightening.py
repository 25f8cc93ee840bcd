"""Starts that come to rest on a straight line, because nothing keeps them bent."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dlocore.effects.distance import distances
from dlocore.problem.plane import lies_on, off_line
from dlocore.problem.standing import obstacle_rows
from dlocore.scene.scene import Scene
from dlocore.shape.shape import StartCurve
from dlocore.spline import greville

Floats = NDArray[np.float64]

_EXACT = 1e-6  # of the length, or the sine of an angle: a grasp this close to a line lies on it
_LOOKS = 65  # places along the cable at which it is evaluated


def straightened(scene: Scene, start: StartCurve, gravity: Floats) -> StartCurve | None:
    """Return the straight line on which a start that settles could rest, or None if there is none.

    It passes through the grasped points, along the held directions, or hangs from a single grasp at one end. Between
    grasps it is strained evenly, beyond them not at all. Whether that is an equilibrium, and a stable one, is not
    checked.

    Args:
        scene: the scene.
        start: start curve.
        gravity: the part of gravity that a table under the cable does not carry (3,) [m/s^2].
    """
    held = sorted((g for g in scene.grasps if g.start == 0.0), key=lambda g: g.u)
    rest = scene.cable.rest_shape
    if not held or (isinstance(rest, str) and rest == "initial"):
        return None
    length, u = scene.cable.length, np.array([g.u for g in held])
    at = np.array([g.path.at(np.zeros(1), start(g.u)[0])[0] for g in held])
    tangents = [start(g.u, 1)[0] for g in held if g.hold != "point"]
    along = _direction(at, u, length, tangents, gravity)
    if along is None or off_line(at - at[0], along) > _EXACT * length or np.any(np.diff(at @ along) <= 0.0):
        return None
    if any(t @ along < (1.0 - 0.5 * _EXACT**2) * math.sqrt(t @ t) for t in tangents):
        return None
    # straightening a curve in space between two clamps would turn the sections at its ends against each other
    if sum(g.hold == "clamp" for g in held) > 1 and _off_plane(start) > _EXACT * length:
        return None
    knots = np.concatenate([np.zeros(4), np.repeat(u[(u > 0.0) & (u < length)], 3), np.full(4, length)])
    straight = replace(start, knots=knots, control_points=_places(greville(knots), u, at, along))
    return straight if _is_free(scene, start, straight, at, u) else None


def _direction(at: Floats, u: Floats, length: float, tangents: list[Floats], gravity: Floats) -> Floats | None:
    """Return the direction (3,) of the line through the grasped points, None if nothing determines it.

    Args:
        at: the grasped points (k, 3) [m].
        u: their material coordinates (k,) [m].
        length: of the cable [m].
        tangents: the held directions, (3,) each.
        gravity: (3,) [m/s^2].
    """
    if len(at) > 1:
        along = at[-1] - at[0]
    elif tangents:
        along = tangents[0]
    elif u[0] in (0.0, length):
        along = gravity if u[0] == 0.0 else -gravity
    else:
        return None
    size = math.sqrt(along @ along)
    return along / size if size > 0.0 else None


def _places(x: Floats, u: Floats, at: Floats, along: Floats) -> Floats:
    """Return the points (n, 3) [m] at coordinates x (n,) of a line that is held `at` (k, 3) [m] at u (k,) [m]."""
    beyond = np.minimum(x - u[0], 0.0) + np.maximum(x - u[-1], 0.0)
    return np.column_stack([np.interp(x, u, at[:, d]) for d in range(3)]) + np.outer(beyond, along)


def _off_plane(start: StartCurve) -> float:
    """Return approximately how far a curve leads out of the plane nearest to it [m]."""
    control = start.control_points
    return float(np.linalg.svd(control - control.mean(axis=0), compute_uv=False)[2])


def _is_free(scene: Scene, start: StartCurve, straight: StartCurve, at: Floats, held: Floats) -> bool:
    """Return whether nothing is in the way from a start to a straight line, and no friction holds the cable.

    On the way no place of the cable is taken to move farther than the one with the longest way between the two, nor
    lower than it can hang from the points `at` (k, 3) [m] held at the coordinates `held` (k,) [m].
    """
    environment, switch = scene.environment, scene.effects.get
    u = np.linspace(0.0, scene.cable.length, _LOOKS)
    places = np.array([start(u), straight(u)])
    radius = 0.5 * scene.cable.diameter
    goes = float(np.linalg.norm(places[1] - places[0], axis=1).max())
    table = environment.table
    if table is not None and switch("table", "auto") != "off":
        hangs = float((at[:, 2, None] - np.abs(held[:, None] - u)).max(axis=0).min())
        if lies_on(table, scene, start):
            if table.friction > 0.0 and switch("friction", "auto") != "off":
                return False
        elif not max(hangs, float(places[..., 2].min()) - goes) > table.height + radius:
            return False
    if not environment.obstacles or switch("obstacles", "auto") == "off":
        return True
    rows = obstacle_rows(scene, environment.obstacles)
    return bool(distances(rows, places.reshape(-1, 3)).min() > radius + goes)
