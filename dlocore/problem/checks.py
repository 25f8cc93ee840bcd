"""Checks before the solve for what no cable can follow: grasps too far apart, a start inside table or obstacle."""

import math
from collections.abc import Callable
from functools import partial
from typing import cast

import numpy as np
from numpy.typing import NDArray

from dlocore.effects.distance import distances
from dlocore.errors import SceneError
from dlocore.problem.plane import table_tolerance
from dlocore.problem.standing import obstacle_rows
from dlocore.problem.strands import nearest_strands
from dlocore.scene.paths import Move, Path, Still, Waypoints
from dlocore.scene.scene import MAX_PRESCRIBED_STRAIN, Scene
from dlocore.shape.shape import StartCurve

Floats = NDArray[np.float64]

CROSSING = 0.05  # of the diameter: strands of a start that are nearer pass through each other
TOO_DEEP = 0.25  # of the diameter: no cable is pressed so deep into the table, an obstacle or itself
_MIDDLE = 0.5  # of the diameter: a start may be seen this deep in an obstacle, and is then moved out
_PLACES = 101  # of a curve at which its depth in an obstacle is evaluated at first
_FINE = 0.1  # of the radius: shortest distance of two such places
_LONGER = 1.1  # largest length of a curve between two places, over their straight distance
_SWINGS = (
    ", where a smooth path swings out between its waypoints: a profile that stops at each, such as minimum_jerk, goes "
    "straight from one to the next; more waypoints there, or more even times, keep a smooth path closer to them"
)


def check_reach(scene: Scene, start: StartCurve) -> None:
    """Refuse two grasps that are farther apart at some time than the cable between them is long."""
    if len(scene.grasps) < 2:
        return
    moments = [np.linspace(0.0, cast(float, scene.horizon), 257)]
    moments += [g.start + cast(Floats, g.path.times) for g in scene.grasps if isinstance(g.path, Waypoints)]
    t = np.unique(np.concatenate(moments))
    t = t[t <= cast(float, scene.horizon)]
    begin = [start(g.u)[0] for g in scene.grasps]
    for j, b in enumerate(scene.grasps):
        for i, a in enumerate(scene.grasps[:j]):
            between = abs(b.u - a.u)
            if _farthest(a.path, begin[i], b.path, begin[j]) <= between:
                continue
            together = (t >= max(a.start, b.start)) & (t <= min(a.release_time or np.inf, b.release_time or np.inf))
            late = max(a.start, b.start) > 0 and not all(isinstance(g.path, Waypoints) for g in (a, b) if g.start > 0)
            if late or not together.any():
                continue  # a later grasp begins where the cable is then, which is known only after the solve
            most = between * (1.0 + MAX_PRESCRIBED_STRAIN) + 1e-6
            at = t[together]
            apart = np.linalg.norm(b.path.at(at - b.start, begin[j]) - a.path.at(at - a.start, begin[i]), axis=1)
            k = int(np.argmax(apart))
            if not apart[k] <= most:
                chords = _straight(b.path, at - b.start, begin[j]) - _straight(a.path, at - a.start, begin[i])
                swings = _SWINGS if np.linalg.norm(chords, axis=1).max() <= most else ""
                raise SceneError(
                    f"primitives[{j}].path",
                    f"{apart[k]:.4g} m from primitives[{i}] at {at[k]:.3g} s",
                    f"at most {between:.4g} m, and {MAX_PRESCRIBED_STRAIN:.1%} more",
                    f"No cable can follow: the two grasps are farther apart than the cable between them{swings}",
                )


def _farthest(a: Path, from_a: Floats, b: Path, from_b: Floats) -> float:
    """Return a bound on the distance [m] of two paths from given points: that of their ends, if both are straight."""
    if isinstance(a, Waypoints) or isinstance(b, Waypoints):
        return np.inf
    ends = [
        [begin] if isinstance(path, Still) else [begin, begin + cast(Floats, path.displacement)]
        for path, begin in ((a, from_a), (b, from_b))
    ]
    return max(math.dist(p, q) for p in ends[0] for q in ends[1])


def check_above(scene: Scene, start: StartCurve) -> None:
    """Refuse a start, a grasp or an obstacle that is inside the table."""
    table = scene.environment.table
    assert table is not None
    lowest = start.heights[0]
    if not lowest >= table.height - table_tolerance(scene):
        lowest = float(start(np.linspace(0.0, scene.cable.length, 101))[:, 2].min())
    if not lowest >= table.height - table_tolerance(scene):
        reason = f"The start is {table.height - lowest:.3g} m below a cable that lies on the table"
        raise SceneError("environment.table.height", table.height, f"at most {lowest:.6g} [m] with this start", reason)
    for i, grasp in enumerate(scene.grasps):
        late = grasp.start > 0.0 and not isinstance(grasp.path, Waypoints)  # begins where the cable is by then
        if late or isinstance(grasp.path, Still):
            continue
        if isinstance(grasp.path, Move) and cast(Floats, grasp.path.displacement)[2] >= 0:
            continue
        t, begin, borne = _moments(grasp.path), start(grasp.u)[0], _borne(scene)
        depths = table.height - grasp.path.at(t, begin)[:, 2]
        k = int(np.argmax(depths))
        below = float(depths[k])
        if not below <= borne:
            swings = _SWINGS if table.height - _straight(grasp.path, t, begin)[:, 2].min() <= borne else ""
            reason = f"It takes the cable {below:.3g} m into the table at {grasp.start + t[k]:.3g} s{swings}"
            raise SceneError(
                f"primitives[{i}].path", f"{below:.3g} m below", f"a path above {table.height:g} m", reason
            )


def _borne(scene: Scene) -> float:
    """Return how deep a path may lead into the table or an obstacle [m], for errors of vision and soft contact."""
    return min(table_tolerance(scene), TOO_DEEP * scene.cable.diameter)


def check_apart(scene: Scene, start: StartCurve) -> None:
    """Refuse a start in which a strand lies inside another: contact could not know to which side it belongs.

    The ends of a ring may lie in one place.
    """
    diameter, control = scene.cable.diameter, np.ascontiguousarray(start.control_points)
    if len(control) <= 4 or np.linalg.norm(control[-1] - control[0]) < diameter:
        return
    apart = nearest_strands(start.knots, control[None], 3, diameter, diameter)
    if not apart >= CROSSING * diameter:
        allowed = f"strands at least {CROSSING * diameter:.2g} m apart, or effects.self_contact off"
        raise SceneError("shape", f"two strands {apart:.2g} m apart", allowed, "The start passes through itself")


def check_outside(scene: Scene, start: StartCurve, met: tuple[int, ...]) -> None:
    """Refuse a start or a grasp's path inside an obstacle."""
    if not met:
        return
    rows = obstacle_rows(scene, [scene.environment.obstacles[i] for i in met])
    diameter = scene.cable.diameter
    seen = min(table_tolerance(scene), _MIDDLE * diameter)
    inside, i, u = _deepest(rows, 0.5 * diameter, start, np.linspace(0.0, scene.cable.length, _PLACES), seen)
    allowed = "the cable outside all obstacles, or effects.obstacles off"
    if inside > seen:
        reason = f"The cable starts up to {inside:.3g} m inside it, at u = {u:.4g} m"
        raise SceneError(f"environment.obstacles[{met[i]}]", f"{inside:.3g} m inside", allowed, reason)
    for k, grasp in enumerate(scene.grasps):
        if grasp.start > 0.0:
            continue  # begins where the cable is by then
        begin, borne = start(grasp.u)[0], _borne(scene)
        deepest = partial(_deepest, rows, 0.5 * diameter, s=_moments(grasp.path), borne=borne)
        inside, i, t = deepest(partial(grasp.path.at, start=begin))
        if inside > borne:
            swings = _SWINGS if deepest(partial(_straight, grasp.path, start=begin))[0] <= borne else ""
            reason = f"It takes the cable {inside:.3g} m into obstacles[{met[i]}] at {t:.3g} s{swings}"
            raise SceneError(f"primitives[{k}].path", f"{inside:.3g} m inside", allowed, reason)


def _deepest(
    rows: Floats, radius: float, curve: Callable[[Floats], Floats], s: Floats, borne: float
) -> tuple[float, int, float]:
    """Return the largest depth [m] of a cable of a radius inside obstacles on a curve r(s), the obstacle, and its s.

    The curve is evaluated at s (k,). Where two neighbours leave room between them for a depth of more than `borne`,
    it is evaluated half-way between them, again and again, so that even thin obstacles are found. The bound is that
    the distance from an obstacle changes by no more than the way along the curve. It stops at the first depth above
    `borne`.

    Args:
        rows: of the obstacles (m, ROW).
        radius: of the cable [m].
        curve: r(s).
        s: (k,), rising.
        borne: allowed depth [m].
    """

    def looked(at: Floats) -> tuple[Floats, Floats]:
        points = np.ascontiguousarray(curve(at))
        gaps = distances(rows, points) - radius
        where, which = np.unravel_index(gaps.argmin(), gaps.shape)
        found.append((-float(gaps[where, which]), int(which), float(at[where])))
        return points, gaps.min(axis=1)

    found: list[tuple[float, int, float]] = []
    points, gaps = looked(s)
    ends, at, gap = (np.stack([x[:-1], x[1:]]) for x in (s, points, gaps))
    while True:
        way = np.linalg.norm(at[1] - at[0], axis=1)
        room = (0.5 * (gap.sum(axis=0) - _LONGER * way) < -borne) & (way > _FINE * radius)
        if found[-1][0] > borne or not room.any():
            return max(found)
        ends, at, gap = ends[:, room], at[:, room], gap[:, room]
        middle = ends.mean(axis=0)
        points, gaps = looked(middle)
        ends, at, gap = (
            np.concatenate([[x[0], m], [m, x[1]]], axis=1) for x, m in ((ends, middle), (at, points), (gap, gaps))
        )


def _moments(path: Path) -> Floats:
    """Return times (k,) [s] along a path, including all of its waypoints."""
    times = np.linspace(0.0, path.duration, _PLACES)
    return np.union1d(times, cast(Floats, path.times)) if isinstance(path, Waypoints) else times


def _straight(path: Path, t: Floats, start: Floats) -> Floats:
    """Return positions (k, 3) [m] of a path at times t (k,) [s], with a spline replaced by straight lines."""
    if not isinstance(path, Waypoints) or path.profile != "spline":
        return path.at(t, start)
    return np.column_stack([np.interp(t, cast(Floats, path.times), x) for x in cast(Floats, path.positions).T])
