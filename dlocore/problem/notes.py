"""Notes on a scene as it was given, whatever its motion."""

import math
from collections.abc import Iterator
from typing import cast

import numpy as np
from numpy.typing import NDArray

from dlocore.scene.obstacles import Box, Cylinder, Obstacle
from dlocore.scene.paths import Move, Waypoints
from dlocore.scene.scene import AUTO_TARGET, ControlPoints, Grasp, Scene, Straight
from dlocore.shape.shape import StartCurve, start_curve
from dlocore.spline import through_others
from dlocore.words import in_m_per_s2, in_mm

Floats = NDArray[np.float64]

LIGHTEST, HEAVIEST = 0.1, 2.5e4  # [kg/m^3] of a cable: a tenth of air, more than any metal
SAME_LENGTH = 5e-3  # of the cable's length: a smaller difference of the points' length gets no note, ...
SAME_ENDS = 1e-3  # ... nor does one that moves the ends by less than this part of the length
SAME_START = 1e-3  # of the length: a start that is moved by less gets no note
ABOUT_ITSELF = 0.9  # of the turn of a gripper: a note if more of it is about the cable that it holds
MANY_TURNS = 3.0  # of a gripper in one move: with more, a note asks whether degrees were meant, if the numbers are ...
_DEGREES = 5.0  # ... multiples of this
NO_TURN = 1e-4  # a quaternion whose last number is nearer to 1 than this is no turn if that number is w
_SAME_TIME = 1e-9  # relative
WAITS = 5.0  # of the duration of a path: a longer wait before it gets a note, if nothing else moves the cable meanwhile
OVERSHOOTS = 0.5  # of the extent of waypoints: farthest that a path may swing out of their box without a note, ...
OUT = 1e-2  # ... or this part of the length, if that is more
CLOSE = 0.1  # of the median time between waypoints: in less time noise may throw a smooth path off. A note if ...
THROWN = 1e-3  # ... it does so by more than this part of the length, ...
_MORE = 5.0  # ... and by more than this times the distance of the close waypoints from a path without them, ...
_NEAR = 1e-2  # ... which is less than THROWN, or than this part of the extent of the waypoints: a late time stamp
SCATTERED = 1 / 3  # of how far waypoints are from a cubic through neighbours twice as far: more is noise. A note if ...
SHAKEN = 20.0  # [m/s^2] ... the path is accelerated by more (r.m.s.), or waypoints scatter by more than THROWN
_EXACT = 1e-6  # of the length: waypoints that scatter by less are exact
_FEW = 12  # waypoints in motion: fewer show no noise
_MOVES = 0.1  # of the mean way between waypoints: less is no motion
_BETWEEN = 8  # places between each two waypoints at which a path is evaluated
_PLACES = 65  # of a start at which it is evaluated


def scene_notes(scene: Scene) -> list[str]:
    """Return notes on a scene as it was given."""
    return [
        *cable_notes(scene),
        *_of_times(scene),
        *_of_waiting(scene),
        *_of_turns(scene),
        *_of_overshoots(scene),
        *_of_close_times(scene),
        *_of_scatter(scene),
        *_of_conventions(scene),
    ]


def cable_notes(scene: Scene) -> list[str]:
    """Return notes on a scene's cable and start shape."""
    return [*_of_units(scene), *_of_curve(scene)]


def start_notes(scene: Scene, start: StartCurve) -> list[str]:
    """Return a note on a start that is not where it was given, apart from a bow, of which `side_notes` tell."""
    length = scene.cable.length
    u = np.linspace(0.0, length, _PLACES)
    moved = float(np.linalg.norm(start(u) - start_curve(scene.shape, length)(u), axis=1).max())
    if moved <= SAME_START * length + abs(start.bow) + start.aside:
        return []
    why = "to meet the first waypoints of its grippers, to lie on the table, or to be outside obstacles"
    return [f"the start is moved by up to {in_mm(moved)} from where it was given, {why}"]


def edge_notes(scene: Scene, obstacles: tuple[Obstacle, ...]) -> list[str]:
    """Return notes on those `obstacles` of a scene under whose walls a cable on the table can slip.

    These are the ones whose walls begin above the centreline of the cable and below its top.
    """
    table, diameter = scene.environment.table, scene.cable.diameter
    if table is None or scene.effects.get("table", "auto") == "off":
        return []
    notes = []
    for obstacle in obstacles:
        if not isinstance(obstacle, Box | Cylinder):
            continue
        row = obstacle.row()
        base = float(row[3] - np.abs(row[4:13].reshape(3, 3)[:, 2]) @ row[13:16])  # if its walls are upright
        above = base - table.height
        stands = obstacle.upright_at(table.height, 0.5 * diameter) or not obstacle.upright_at(base, diameter)
        if 0.0 < above < 0.5 * diameter and not stands:
            i = scene.environment.obstacles.index(obstacle)
            notes.append(
                f"obstacles[{i}] begins {in_mm(above + 0.5 * diameter)} above the surface of the table, which is half "
                "a diameter below table.height: the cable can slip under its edge. Let it begin at "
                f"z = {table.height:g} m or below"
            )
    return notes


def _of_units(scene: Scene) -> list[str]:
    """Return a note on a cable lighter than air, as if its lengths were in millimetres, or heavier than any metal."""
    cable = scene.cable
    density = cable.linear_density / (0.25 * math.pi * cable.diameter**2)
    if LIGHTEST <= density <= HEAVIEST:
        return []
    thick = f"{cable.diameter:g} m thick and weighs {cable.linear_density:g} kg/m"
    if density < LIGHTEST:
        return [f"the cable is {thick}, so it is lighter than air: its length and diameter may be in millimetres"]
    return [f"the cable is {thick}, so it is heavier than any metal: linear_density is its mass per length in kg/m"]


def _of_curve(scene: Scene) -> list[str]:
    """Return notes on a start curve that was scaled to the cable's length, is uneven, or misses its points."""
    if isinstance(scene.shape, Straight):
        return []
    length = scene.cable.length
    start = start_curve(scene.shape, length)
    notes = []
    if start.slid > SAME_START * length:
        notes.append(
            "|r'| of the control points of the shape is not 1 everywhere: the cable lies along their curve at its own "
            f"length, which moves its places, also those that grippers hold, by up to {in_mm(start.slid)}. If the "
            "control points are those of r(u), with u the material coordinate, give `strain` as zeros, one for each"
        )
    differ = abs(start.length_given - length) > SAME_LENGTH * length
    if differ and start.ends_moved > SAME_ENDS * length:
        points = "control points" if isinstance(scene.shape, ControlPoints) else "points"
        return [
            *notes,
            f"the {points} of the shape are {start.length_given:.4g} m long and the cable {length:.4g} m: their curve "
            f"is scaled to the cable about its middle, which moves an end by up to {in_mm(start.ends_moved)}, and with "
            "it a gripper that holds it there",
        ]
    if start.fit_missed > (scene.quality.target_error or AUTO_TARGET * length):
        return [
            f"the start is a smooth curve that misses the points of the shape by {in_mm(start.fit_missed)}, in "
            "addition to their noise. The estimated error does not include this: give points that are as long as the "
            "cable, more of them at sharp bends, or the control points of a spline"
        ]
    return notes


def _of_times(scene: Scene) -> list[str]:
    """Return notes on grippers that would close when the motion is over."""
    horizon = cast(float, scene.horizon)
    return [
        f"primitives[{i}] never holds the cable: it closes at {grasp.start:g} s and the horizon is {horizon:g} s"
        for i, grasp in enumerate(scene.grasps)
        if grasp.start >= horizon
    ]


def _of_waiting(scene: Scene) -> list[str]:
    """Return a note on recorded paths that begin long after the scene, as if by the clock of their recorder."""
    moving = [(i, grasp) for i, grasp in enumerate(scene.grasps) if grasp.path.duration > 0.0]
    if not moving or not all(isinstance(g.path, Waypoints) and g.start == 0.0 for _, g in moving):
        return []
    spans = {i: cast(Floats, cast(Waypoints, grasp.path).times)[[0, -1]] for i, grasp in moving}
    first, (begin, end) = min(spans.items(), key=lambda span: float(span[1][0]))
    if not begin > WAITS * (end - begin):
        return []
    return [
        f"primitives[{first}].path.times begin at {begin:.6g} s, and no gripper moves before: times count from when a "
        "gripper closes, so subtract the first if they are those of a recorder"
    ]


def _of_turns(scene: Scene) -> list[str]:
    """Return notes on grippers that turn about the cable but hold only its direction."""
    notes = []
    for i, grasp in enumerate(scene.grasps):
        path = grasp.path
        if grasp.hold != "tangent" or grasp.start > 0.0 or not isinstance(path, Move) or path.rotation is None:
            continue
        turn = cast(Floats, path.rotation)
        along = start_curve(scene.shape, scene.cable.length)(grasp.u, 1)[0]
        about = abs(float(turn @ along)) / float(np.linalg.norm(along))
        if about > ABOUT_ITSELF * float(np.linalg.norm(turn)):
            notes.append(
                f"primitives[{i}] turns about the cable, but hold 'tangent' lets the cable turn in the gripper: "
                "hold 'clamp' twists it"
            )
    return notes


def _of_conventions(scene: Scene) -> list[str]:
    """Return notes on paths that seem to be in degrees, in (x, y, z, w), or by the clock of the scene."""
    return [
        f"primitives[{i}]{asked}"
        for i, grasp in enumerate(scene.grasps)
        for asked in (_in_degrees(grasp), _scalar_last(grasp), _by_another_clock(grasp))
        if asked
    ]


def _in_degrees(grasp: Grasp) -> str:
    if not isinstance(grasp.path, Move) or grasp.path.rotation is None:
        return ""
    rotation = cast(Floats, grasp.path.rotation)
    angle = float(np.linalg.norm(rotation))
    if not angle > MANY_TURNS * 2.0 * math.pi or np.any(rotation % _DEGREES):
        return ""
    meant = ", ".join(f"{x:.4g}" for x in np.radians(rotation))
    around = f"turns by {angle:.4g} rad, {angle / (2.0 * math.pi):.3g} times around"
    return f" {around}: rotation is in radians; if degrees were meant, give ({meant})"


def _scalar_last(grasp: Grasp) -> str:
    if not isinstance(grasp.path, Waypoints) or grasp.path.orientations is None:
        return ""
    turns = np.abs(cast(Floats, grasp.path.orientations))
    least = math.sqrt(0.5)  # of cos(angle/2): a quarter turn from none
    if not (turns[0, 3] > 1.0 - NO_TURN and turns[:, 3].min() > least and np.ptp(turns, axis=0).any()):
        return ""
    begins = ".path.orientations begin at a half turn about z, (0, 0, 0, 1) read as (w, x, y, z)"
    return f"{begins}: if they are meant as (x, y, z, w), in which that is no turn, put w first"


def _by_another_clock(grasp: Grasp) -> str:
    if not isinstance(grasp.path, Waypoints) or grasp.start == 0.0:
        return ""
    first = float(cast(Floats, grasp.path.times)[0])
    if not math.isclose(first, grasp.start, rel_tol=_SAME_TIME):
        return ""
    begins = f".path.times begin at {first:.4g} s, as grasp_time: they count from then, so the gripper waits until"
    return f"{begins} {grasp.start + first:.4g} s. Let them begin at 0 to move at once"


def _of_overshoots(scene: Scene) -> list[str]:
    """Return notes on paths that swing far out of their waypoints, as smooth ones through uneven times do."""
    notes = []
    for i, grasp in enumerate(scene.grasps):
        if not isinstance(grasp.path, Waypoints):
            continue
        times, given = cast(Floats, grasp.path.times), cast(Floats, grasp.path.positions)
        t = _along(times)
        path, low, high = grasp.path.at(t, given[0]), given.min(axis=0), given.max(axis=0)
        out = np.linalg.norm(np.maximum(0.0, np.maximum(low - path, path - high)), axis=1)
        k = int(np.argmax(out))
        if out[k] > max(OVERSHOOTS * float(np.linalg.norm(high - low)), OUT * scene.cable.length):
            notes.append(
                f"the path of primitives[{i}] swings out of its waypoints by up to {in_mm(out[k])}, at "
                f"{grasp.start + t[k]:.3g} s, because a smooth path through uneven times overshoots: use more even "
                "times, or a profile that stops at each waypoint"
            )
    return notes


def _of_close_times(scene: Scene) -> list[str]:
    """Return notes on waypoints whose times are so close that noise or a late time throws a smooth path off."""
    notes = []
    for i, path, times, given in _smooth_paths(scene):
        usual = float(np.median(np.diff(times)))
        close = np.append(False, np.diff(times) < CLOSE * usual)
        if not close.any() or (~close).sum() < 2:
            continue
        without = Waypoints(times=times[~close], positions=given[~close], start=path.start)
        t = _along(times[times <= without.duration])
        thrown = np.linalg.norm(path.at(t, given[0]) - without.at(t, given[0]), axis=1)
        off = np.linalg.norm(given[close] - without.at(times[close], given[0]), axis=1)
        k = int(np.argmax(thrown))
        much = THROWN * scene.cable.length
        near = max(much, _NEAR * float(np.linalg.norm(np.ptp(given, axis=0))))
        if off.max() < near and thrown[k] > max(much, _MORE * off.max()):
            j = int(np.flatnonzero(close)[np.argmin(np.abs(times[close] - t[k]))])
            gap = times[j] - times[j - 1]
            notes.append(
                f"primitives[{i}].path.times[{j}] is {gap:.2g} s after the one before it, others are {usual:.2g} s "
                f"apart: their noise, or a late time, throws the smooth path off by up to {in_mm(thrown[k])}, at "
                f"{scene.grasps[i].start + t[k]:.4g} s. Leave this waypoint out"
            )
    return notes


def _of_scatter(scene: Scene) -> list[str]:
    """Return notes on paths that noise of the waypoints, or of their times, shakes.

    A waypoint of a smooth path is much nearer to the cubic through its neighbours than to that through every other one;
    noise is as far from both.
    """
    notes = []
    for i, path, times, given in _smooth_paths(scene):
        near, far = _scatter(times, given, 1), _scatter(times, given, 2)
        if len(far) < _FEW:
            continue
        typical, length = float(np.median(near)), scene.cable.length
        if not typical > max(SCATTERED * float(np.median(far)), _EXACT * length):
            continue
        shaken = _root_mean_square(times, path.acceleration(times))
        if shaken > SHAKEN or typical > THROWN * length:
            notes.append(
                f"the waypoints of primitives[{i}] scatter about a smooth path, by some {in_mm(typical, 1)} and at "
                f"most {in_mm(near.max())}. The gripper passes through all of them, with accelerations of "
                f"{in_m_per_s2(shaken)} (r.m.s.), which the forces show. If this is noise of a log, or of its times, "
                "smooth its positions first"
            )
    return notes


def _smooth_paths(scene: Scene) -> Iterator[tuple[int, Waypoints, Floats, Floats]]:
    """Yield index, path, times (k,) [s] and positions (k, 3) [m] of each grasp that follows waypoints smoothly."""
    for i, grasp in enumerate(scene.grasps):
        if isinstance(grasp.path, Waypoints) and grasp.path.profile == "spline":
            yield i, grasp.path, cast(Floats, grasp.path.times), cast(Floats, grasp.path.positions)


def _scatter(times: Floats, given: Floats, stride: int) -> Floats:
    """Return how far moving waypoints are (k,) [m] from the cubic through two on either side, `stride` apart."""
    k = np.arange(2 * stride, len(times) - 2 * stride)
    way = np.linalg.norm(given[k + stride] - given[k - stride], axis=1)
    k = k[way > _MOVES * way.mean()] if way.any() else k[:0]
    around = k[:, None] + stride * np.array([-2, -1, 1, 2])
    return np.asarray(np.linalg.norm(given[k] - through_others(times, given, k, around), axis=1))


def _root_mean_square(times: Floats, x: Floats) -> float:
    """Return the r.m.s. size of what is linear between its values x (n, 3) at times (n,)."""
    a, b = x[:-1], x[1:]
    return math.sqrt(np.diff(times) @ (a * a + a * b + b * b).sum(axis=1) / (3.0 * (times[-1] - times[0])))


def _along(times: Floats) -> Floats:
    """Return the times [s], at and between those of waypoints (n,), at which a path is evaluated."""
    between = np.linspace(0.0, 1.0, _BETWEEN, endpoint=False)
    return np.asarray((times[:-1, None] + np.diff(times)[:, None] * between).ravel())
