"""A start that is moved out of the table or obstacles in which it was given."""

from dataclasses import replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from dlocore.effects.contact import DEEPEST
from dlocore.effects.distance import distances
from dlocore.problem.brought import finer
from dlocore.problem.standing import obstacle_rows
from dlocore.scene.paths import Waypoints
from dlocore.scene.scene import Scene
from dlocore.shape.shape import StartCurve, fit_to_knots
from dlocore.spline import greville

Floats = NDArray[np.float64]

REACH = 0.1  # of the length: the cable stays where it is beyond this distance from what is moved out
_PLACES = 401  # at which a start is evaluated: enough for a tenth of REACH
_HELD = 0.25  # of REACH: so near to a first waypoint, which stays, depth is left to contact
_NEAR = 1e-3  # of the diameter: distance over which the direction outwards is found
_TIMES = 8  # most iterations of the move


def cleared(scene: Scene, start: StartCurve, met: tuple[int, ...], with_table: bool) -> StartCurve:
    """Return a start whose centreline is a radius off the obstacles that it meets, and no lower than the table.

    A camera may see a cable that touches an obstacle some millimetres inside it (`checks.check_outside`). The deepest
    point is moved out by its depth, and with it the cable to either side, less and less up to REACH. Pushed out by
    contact alone, span by span, the cable would be bent by thousands of newtons. A start that continues a motion is
    pressed in a little, as that motion left it, and is not moved.
    """
    environment, diameter, length = scene.environment, scene.cable.diameter, scene.cable.length
    floor = environment.table.height if with_table and environment.table is not None else -np.inf
    low = start.heights[0] < floor - DEEPEST * diameter
    if start.material is not None or start.velocity is not None or not (met or low):
        return start
    rows = [row[None] for row in obstacle_rows(scene, [environment.obstacles[i] for i in met])]
    held = np.array([g.u for g in scene.grasps if g.start == 0.0 and isinstance(g.path, Waypoints)])
    u = np.linspace(0.0, length, _PLACES)
    moved = start
    for _ in range(_TIMES):
        ways = _ways_out(rows, floor, moved(u), 0.5 * diameter)
        depths = np.linalg.norm(ways, axis=1)
        inside = np.flatnonzero(depths > DEEPEST * diameter)
        if not len(inside):
            break
        if moved is start:
            knots = finer(start.knots)
            moved = replace(start, knots=knots, control_points=fit_to_knots(start, knots))
        places = greville(moved.knots)
        shares = depths[inside] * _fading(places[:, None] - u[inside], REACH * length)  # of each, at each place
        deepest = inside[shares.argmax(axis=1)]
        change = shares.max(axis=1)[:, None] * ways[deepest] / depths[deepest][:, None]
        change *= np.prod(1.0 - _fading(places[:, None] - held, _HELD * REACH * length), axis=1)[:, None]
        moved = replace(moved, control_points=moved.control_points + change)
    return moved


def _fading(away: Floats, reach: float) -> Floats:
    """Return a factor that falls smoothly from 1 at a distance `away` of 0 to 0 at `reach` [m] and beyond."""
    s = np.minimum(np.abs(away) / reach, 1.0)
    return cast(Floats, 1.0 - s**2 * (3.0 - 2.0 * s))


def _ways_out(rows: list[Floats], floor: float, points: Floats, radius: float) -> Floats:
    """Return for points (n, 3) [m] of a cable the ways (n, 3) [m] out of what each is deepest in, 0 if it is outside.

    `rows` are those of obstacles, (1, ROW) each, and `floor` is the table's height [m].
    """
    ways = np.zeros_like(points)
    ways[:, 2] = np.maximum(floor - points[:, 2], 0.0)
    deepest = ways[:, 2].copy()
    around = 2.0 * radius * _NEAR * np.concatenate([np.eye(3), -np.eye(3)])
    for row in rows:
        depths = radius - distances(row, np.ascontiguousarray(points))[:, 0]
        inside = np.flatnonzero(depths > deepest)
        gaps = distances(row, np.ascontiguousarray((points[inside, None] + around).reshape(-1, 3))).reshape(-1, 2, 3)
        up = gaps[:, 0] - gaps[:, 1]
        up /= np.maximum(np.linalg.norm(up, axis=1), 1e-300)[:, None]
        ways[inside] = depths[inside, None] * up
        deepest[inside] = depths[inside]
    return ways
