"""The plane of a motion: whether two coordinates describe it, and whether the cable stays on the table."""

import math
from dataclasses import dataclass, replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from dlocore.scene.paths import Move, Path, Waypoints
from dlocore.scene.scene import Scene, Table
from dlocore.shape.shape import StartCurve

Floats = NDArray[np.float64]

FLATNESS = 1e-9  # of the length: a start and a motion this close to a plane are planar
NEARLY = 1e-5  # relative: forces this close to a plane draw a cable out of it by less than real cables are bent
_ALONG = np.array([1.0, 0.0, 0.0])  # direction to use if all vectors are zero
_SEEN = 0.005, 0.02  # [m] and of the length: points seen this close to the table lie on it


@dataclass(frozen=True, eq=False)
class Plane:
    """Coordinates of the solve: x = axes (r - origin).

    Attributes:
        axes: (nc, 3), orthonormal rows; nc = 2 in the plane, 3 in space.
        origin: (3,) [m].
        reason: why the scene is planar or not, in words.
    """

    axes: Floats
    origin: Floats
    reason: str

    @property
    def dimensions(self) -> int:
        """Number of coordinates, 2 or 3."""
        return len(self.axes)

    def points(self, r: Floats) -> Floats:
        """Return plane coordinates (..., nc) of the points r (..., 3) [m]."""
        return (r - self.origin) @ self.axes.T

    def vectors(self, v: Floats) -> Floats:
        """Return components (..., nc) of the vectors v (..., 3)."""
        return v @ self.axes.T

    def world(self, x: Floats) -> Floats:
        """Return the points r (..., 3) [m] of plane coordinates x (..., nc)."""
        return self.origin + x @ self.axes

    def distance(self, r: Floats) -> float:
        """Return the largest component of the distances of the points r (..., 3) from the plane [m]."""
        return float(np.abs(r - self.world(self.points(r))).max())

    def world_vectors(self, x: Floats) -> Floats:
        """Return the vectors (..., 3) of components x (..., nc)."""
        return x @ self.axes


def natural_points(scene: Scene) -> Floats | None:
    """Return the points (n, 3) [m] of a stress-free shape that is given by points, or None."""
    rest = scene.cable.rest_shape
    return None if isinstance(rest, str) else cast(Floats, rest)


def is_straight(start: StartCurve) -> bool:
    """Return whether the start is straight."""
    chord = start.control_points - start.control_points[0]
    return float(np.linalg.svd(chord, compute_uv=False)[1]) <= FLATNESS * float(np.abs(chord).max())


def off_line(vectors: Floats, along: Floats) -> float:
    """Return the largest part of vectors (k, 3) across a direction (3,)."""
    unit = along / math.sqrt(along @ along)
    return float(np.abs(vectors - np.outer(vectors @ unit, unit)).max())


def table_tolerance(scene: Scene) -> float:
    """Return how far off the table, or inside an obstacle, a cable that touches it may be seen [m]."""
    absolute, relative = _SEEN
    return min(absolute, relative * scene.cable.length)


def lies_on(table: Table, scene: Scene, start: StartCurve) -> bool:
    """Return whether a start lies on a table, within `table_tolerance`."""
    return max(abs(z - table.height) for z in start.heights) <= table_tolerance(scene)


def off_the_table(scene: Scene, start: StartCurve, met: tuple[int, ...]) -> str:
    """Return why the cable leaves the table or does more than slide on it, or "" if it lies there all the time."""
    table, environment = scene.environment.table, scene.environment
    assert table is not None
    if scene.effects.get("table", "auto") == "on":
        return "contact with the table is switched on in the scene"
    if scene.effects.get("twist", "auto") == "on":
        return "twist is switched on in the scene"
    off = max(abs(z - table.height) for z in start.heights)
    if not off <= table_tolerance(scene):
        return f"the cable starts up to {off:.3g} m above it"
    if cast(Floats, environment.gravity)[2] > 0:
        return "gravity lifts the cable off it"
    if start.velocity is not None and np.any(np.abs(start.velocity.control_points[:, 2]) > 1e-9):
        return "the cable starts with a velocity off its plane"
    for grasp in scene.grasps:
        path = grasp.path
        if isinstance(path, Move) and cast(Floats, path.displacement)[2] != 0:
            return "a grasp lifts the cable off it"
        if isinstance(path, Waypoints) and np.ptp(cast(Floats, path.positions)[:, 2]) > 0:
            return "a grasp lifts the cable off it"
        turns = turns_of(path, 9)
        if turns is not None and np.abs(turns[:, 2, :2]).max() > 1e-9:
            return "a grasp turns the cable off its plane"
    for load in scene.loads:
        if np.any(np.atleast_2d(cast(Floats, load.force))[:, 2] > 0):
            return "a load lifts the cable off it"
    for i in met:
        if not environment.obstacles[i].upright_at(table.height, 0.5 * scene.cable.diameter):
            return f"obstacles[{i}] has no upright walls where the cable lies"
    natural = natural_points(scene)
    if natural is not None and not np.ptp(natural[:, 2]) <= table_tolerance(scene):
        return "the stress-free shape is not flat"
    if start.twisted:
        return "the cable is twisted"
    if start.material is not None and np.abs(_remembered_bends(start, FLATNESS)[:, 2]).max() > FLATNESS:
        return "the cable remembers bends that are not flat"
    return ""


def lay_on_table(scene: Scene, start: StartCurve) -> StartCurve:
    """Return the start at the table's height."""
    table = scene.environment.table
    assert table is not None
    if start.heights == (table.height, table.height):
        return start
    flat = start.control_points.copy()
    flat[:, 2] = table.height
    return replace(start, control_points=flat)


def find_plane(scene: Scene, start: StartCurve, on_table: bool, met: bool) -> Plane:
    """Decide between two and three coordinates from everything that could move the cable out of a plane."""
    origin = np.array(start.control_points[0])
    if met and not on_table:
        return Plane(np.eye(3), origin, "obstacles are not in the plane of the motion")
    if scene.environment.table is not None and not on_table and scene.effects.get("table", "auto") != "off":
        return Plane(np.eye(3), origin, "the cable does not stay on the table")
    if scene.effects.get("twist", "auto") == "on":
        return Plane(np.eye(3), origin, "twist is switched on in the scene")
    if start.twisted and scene.effects.get("twist", "auto") != "off":
        return Plane(np.eye(3), origin, "the start is twisted")
    if on_table:
        return Plane(np.eye(3)[:2], origin, "the cable lies on the table and moves in its plane")
    return flat_plane(scene, start)


def rest_plane(scene: Scene, start: StartCurve) -> Plane:
    """Return the plane of start, paths and forces; if the start settles in a plane first, of all but the paths.

    They may deviate from it by rounding elsewhere (NEARLY), as coordinates that were measured or rotated do. That draws
    the cable out of the plane by less than any real cable is bent, and does not decide to which side it goes.
    """
    for still in (False, True) if scene.shape.settle else (False,):
        nearly = flat_plane(scene, start, still=still, flat=NEARLY)
        if nearly.dimensions == 2:
            exactly = flat_plane(scene, start, still=still)
            return exactly if exactly.dimensions == 2 else nearly
    return nearly


def flat_plane(scene: Scene, start: StartCurve, *, still: bool = False, flat: float = FLATNESS) -> Plane:
    """Return the plane of start, paths and forces, whatever the cable may touch; all of space if they have none.

    With `still`, only the first points of the paths count. `flat` is the allowed deviation relative to the largest
    vector of each kind. If it is more than FLATNESS, velocities and forces are also compared with those that move a
    free cable by its length within the horizon.
    """
    origin, length, mass = np.array(start.control_points[0]), scene.cable.length, scene.cable.mass
    speed = length / cast(float, scene.horizon) if flat > FLATNESS else 0.0  # [m/s], its length within the horizon
    fall = speed**2 / length
    spread = [(start.control_points - origin) / length]
    if start.velocity is not None:
        v = start.velocity.control_points
        spread.append(v / max(1e-9, float(np.abs(v).max()), speed))
    for grasp in scene.grasps:
        if isinstance(grasp.path, Move) and not still:
            spread.append(cast(Floats, grasp.path.displacement)[None] / length)
        if isinstance(grasp.path, Waypoints):
            positions = cast(Floats, grasp.path.positions)
            if not still:
                spread.append((positions - positions[0]) / length)
            spread.append((positions[:1] - start(grasp.u)) / length)
    gravity = cast(Floats, scene.environment.gravity)
    if gravity.any() and scene.effects.get("gravity", "auto") != "off":
        spread.append(gravity[None] / max(float(np.linalg.norm(gravity)), fall))
    for load in scene.loads:
        force = np.atleast_2d(cast(Floats, load.force))
        spread.append(force / max(1e-300, float(np.abs(force).max()), fall * mass))
    natural = natural_points(scene)
    if natural is not None:
        spread.append((natural - natural[0]) / length)
    if start.material is not None:
        spread.append(_remembered_bends(start, flat))
    vectors = np.concatenate(spread)
    normal = _normal_of(vectors, flat)
    off_plane = float(np.abs(vectors @ normal).max())
    if not off_plane <= flat * max(1.0, np.abs(vectors).max()):
        return Plane(np.eye(3), origin, "start, motion and forces do not lie in one plane")
    flat_turns = True
    for grasp in () if still else scene.grasps:
        turns = turns_of(grasp.path, 33)
        if turns is not None and np.abs(turns @ normal - normal).max() > flat:
            flat_turns = False
    if not flat_turns:
        return Plane(np.eye(3), origin, "a grasp turns the cable out of the plane of its motion")
    normal = normal * (1.0 if normal[np.argmax(np.abs(normal))] > 0 else -1.0)
    first = unit_across(normal)
    return Plane(np.array([first, _cross(normal, first)]), origin, "start, motion and forces lie in one plane")


def _normal_of(vectors: Floats, flat: float) -> Floats:
    """Return a unit vector (3,) normal to the largest of the vectors (k, 3) and to the one farthest off its line.

    If they lie in one plane it is the normal of that. If they lie in a line, but for a part `flat`, it is across it.
    """
    squares = np.einsum("ij,ij->i", vectors, vectors)
    k = int(squares.argmax())
    size = math.sqrt(squares[k])
    first = vectors[k] / size if size > 0.0 else _ALONG
    off = vectors - (vectors @ first)[:, None] * first
    squares = np.einsum("ij,ij->i", off, off)
    k = int(squares.argmax())
    if not math.sqrt(squares[k]) > flat * size:
        return unit_across(first)
    normal = _cross(first, off[k])
    return normal / math.sqrt(normal @ normal)


def turns_of(path: Path, times: int) -> Floats | None:
    """Return the rotations (times, 3, 3) of a path at evenly spaced times, or None if it never turns."""
    if path.turn is not None and not any(path.turn[6:]):
        return None
    return path.rotation_at(np.linspace(0.0, path.duration, times))


def _remembered_bends(start: StartCurve, flat: float) -> Floats:
    """Return vectors (k, 3) along which the sections' memory bends the cable; all three axes if it is twisted.

    Bends and twist smaller than a part `flat` of the largest value are ignored.
    """
    material = start.material
    assert material is not None
    memory = cast(Floats, material.memory)
    scale = float(np.abs(memory).max())
    if scale == 0.0:
        return np.zeros((1, 3))
    if np.abs(memory[:, 2]).max() > flat * scale:
        return np.eye(3)
    # a flat curve carries its frame flat: all its bends lie in its plane if those at u = 0 do
    tangent = start(0.0, 1)[0] / np.linalg.norm(start(0.0, 1)[0])
    first = cast(Floats, material.director)
    second = np.cross(tangent, first)
    _, sizes, principal = np.linalg.svd(memory[:, :2] / scale, full_matrices=False)
    bends = np.array([d[0] * first + d[1] * second for d in principal])
    return bends if sizes[1] > flat * sizes[0] else bends[:1]


def turned_about(tangent: Floats, director: Floats, angle: float) -> Floats:
    """Return a director (3,), turned by an angle [rad] about the unit tangent (3,) to which it is normal."""
    return math.cos(angle) * director + math.sin(angle) * np.cross(tangent, director)


def leftwards(tangent: Floats) -> Floats:
    """Return the horizontal unit vector (3,) to the left of a tangent (3,); x for a vertical one."""
    left = np.array([-tangent[1], tangent[0], 0.0])
    size = float(np.linalg.norm(left))
    return left / size if size > 1e-9 * float(np.linalg.norm(tangent)) else np.array([1.0, 0.0, 0.0])


def unit_across(normal: Floats) -> Floats:
    """Return a unit vector in the plane of `normal`: the world axis nearest to it, x before y before z."""
    sizes = [round(abs(x), 9) for x in normal.tolist()]
    k = sizes.index(min(sizes))
    across = -normal[k] * normal
    across[k] += 1.0
    return across / math.sqrt(across @ across)


def _cross(a: Floats, b: Floats) -> Floats:
    """Return a x b of two vectors (3,). NumPy's own, made for arrays of many, takes ten times as long."""
    (x, y, z), (u, v, w) = a.tolist(), b.tolist()
    return np.array([y * w - z * v, z * u - x * w, x * v - y * u])
