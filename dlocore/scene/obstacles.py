"""Solid obstacles by their true surfaces; the cable touches them with its radius."""

from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dlocore.effects.kinds import BOX, CAPSULE, CYLINDER, SPHERE
from dlocore.errors import SceneError, array, number
from dlocore.pickling import Checked

Floats = NDArray[np.float64]

_ROUNDING = 1e-9  # relative, of directions, and of heights against the size that they are compared with


def _row(kind: int, center: Floats, frame: Floats, half: tuple[float, float, float], friction: float) -> Floats:
    """Return (kind, centre, three axes of the body's frame, half sizes, friction): (ROW,)."""
    return np.concatenate([[kind], center, frame.ravel(), half, [friction]])


def _frame(axis: Floats) -> Floats:
    """Return the rows of a right-handed orthonormal frame whose third axis is along `axis`."""
    third = axis / np.linalg.norm(axis)
    first = np.eye(3)[int(np.argmin(np.abs(third)))]
    first = first - third * (first @ third)
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(third, first), third])


def _vertical(axis: Floats) -> bool:
    return bool(np.hypot(axis[0], axis[1]) <= _ROUNDING * np.linalg.norm(axis))


def _covers(center: float, half: float, height: float, reach: float) -> bool:
    """Return whether walls from center - half to center + half cover the heights from `height` to `height` + `reach`.

    `height` is that of the centreline of a cable on the table, one radius above the table's surface. Walls that begin
    there, as those of an obstacle that stands at z = 0 if `table.height` is 0, push the cable sideways only: it can't
    get below them.
    """
    rounding = _ROUNDING * reach
    return bool(center - half <= height + rounding and height + reach <= center + half + rounding)


def _level(z: float, height: float, size: float) -> bool:
    return bool(abs(z - height) <= _ROUNDING * size)


def _point(name: str, value: ArrayLike) -> Floats:
    point = array(name, value, shape=(3,), unit="m")
    if not (np.abs(point) <= 1e4).all():
        raise SceneError(name, point, "coordinates of -10000 to 10000 [m]")
    return point


def _length(name: str, value: float) -> float:
    return number(name, value, above=0.0, at_most=1e4, unit="m")


def _friction(value: float) -> float:
    return number("friction", value, at_least=0.0, at_most=10.0)


@dataclass(frozen=True, kw_only=True, eq=False)
class Sphere(Checked):
    """A ball.

    Args:
        center: (3,) [m], coordinates of -10,000 to 10,000.
        radius: [m], above 0, up to 10,000.
        friction: Coulomb's mu between it and the cable, 0 to 10.

    Raises:
        SceneError: a value is not finite, or outside these limits.
    """

    center: ArrayLike
    radius: float
    friction: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "center", _point("center", self.center))
        object.__setattr__(self, "radius", _length("radius", self.radius))
        object.__setattr__(self, "friction", _friction(self.friction))

    def upright_at(self, height: float, reach: float) -> bool:
        """Return whether a cable on a table, its centreline at `height` [m], touches the ball only sideways.

        A ball has no vertical walls, so this holds only by symmetry, if its centre lies exactly at `height`.
        """
        return _level(cast(Floats, self.center)[2], height, self.radius)

    def row(self) -> Floats:
        """Return the row (ROW,) that the compiled distance reads."""
        return _row(SPHERE, cast(Floats, self.center), np.eye(3), (self.radius, 0.0, 0.0), self.friction)


@dataclass(frozen=True, kw_only=True, eq=False)
class Capsule(Checked):
    """All points within a radius of a segment: a rod with round ends.

    Args:
        start, end: ends of the segment (3,) [m], coordinates of -10,000 to 10,000.
        radius: [m], above 0, up to 10,000.
        friction: Coulomb's mu between it and the cable, 0 to 10.

    Raises:
        SceneError: a value is not finite, or outside these limits, or the segment has no length.
    """

    start: ArrayLike
    end: ArrayLike
    radius: float
    friction: float = 0.0

    def __post_init__(self) -> None:
        start = _point("start", self.start)
        end = _point("end", self.end)
        if not np.linalg.norm(end - start) > 1e-9:
            raise SceneError("end", end, "a point away from start; a Sphere has only one")
        object.__setattr__(self, "start", start)
        object.__setattr__(self, "end", end)
        object.__setattr__(self, "radius", _length("radius", self.radius))
        object.__setattr__(self, "friction", _friction(self.friction))

    def upright_at(self, height: float, reach: float) -> bool:
        """Return whether a cable on a table, its centreline at `height` [m], touches the capsule only sideways.

        This holds if the axis is vertical and the part between the round ends covers `height` to `height` + `reach`,
        or, by symmetry, if the axis is horizontal and lies exactly at `height`.
        """
        start, end = cast(Floats, self.start), cast(Floats, self.end)
        if _vertical(end - start):
            return _covers(0.5 * (start[2] + end[2]), 0.5 * abs(end[2] - start[2]), height, reach)
        return _level(start[2], height, self.radius) and _level(end[2], height, self.radius)

    def row(self) -> Floats:
        """Return the row (ROW,) that the compiled distance reads."""
        start, end = cast(Floats, self.start), cast(Floats, self.end)
        half = 0.5 * float(np.linalg.norm(end - start))
        return _row(CAPSULE, 0.5 * (start + end), _frame(end - start), (self.radius, 0.0, half), self.friction)


@dataclass(frozen=True, kw_only=True, eq=False)
class Cylinder(Checked):
    """A solid cylinder with flat ends.

    Args:
        center: (3,) [m], half-way between its ends, coordinates of -10,000 to 10,000.
        radius: [m], above 0, up to 10,000.
        height: [m], from end to end, above 0, up to 10,000.
        axis: direction of its axis (3,), of any length.
        friction: Coulomb's mu between it and the cable, 0 to 10.

    Raises:
        SceneError: a value is not finite, or outside these limits, or `axis` is zero.
    """

    center: ArrayLike
    radius: float
    height: float
    axis: ArrayLike = (0.0, 0.0, 1.0)
    friction: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "center", _point("center", self.center))
        axis = array("axis", self.axis, shape=(3,))
        if not 1e-12 < np.abs(axis).max() <= 1e12:
            raise SceneError("axis", axis, "components up to 1e12, not all zero")
        object.__setattr__(self, "axis", axis)
        object.__setattr__(self, "radius", _length("radius", self.radius))
        object.__setattr__(self, "height", _length("height", self.height))
        object.__setattr__(self, "friction", _friction(self.friction))

    def upright_at(self, height: float, reach: float) -> bool:
        """Return whether a cable on a table, its centreline at `height` [m], touches the cylinder only sideways.

        This holds if the axis is vertical and the curved wall covers `height` to `height` + `reach`, or, by symmetry,
        if the axis is horizontal and lies exactly at `height`.
        """
        center, axis = cast(Floats, self.center), cast(Floats, self.axis)
        if _vertical(axis):
            return _covers(center[2], 0.5 * self.height, height, reach)
        return _level(axis[2], 0.0, float(np.linalg.norm(axis))) and _level(center[2], height, self.radius)

    def row(self) -> Floats:
        """Return the row (ROW,) that the compiled distance reads."""
        half = (self.radius, 0.0, 0.5 * self.height)
        return _row(CYLINDER, cast(Floats, self.center), _frame(cast(Floats, self.axis)), half, self.friction)


@dataclass(frozen=True, kw_only=True, eq=False)
class Box(Checked):
    """A solid box.

    Args:
        center: (3,) [m], coordinates of -10,000 to 10,000.
        size: lengths of its edges along its own x, y and z (3,) [m], above 0, up to 10,000.
        orientation: unit quaternion (w, x, y, z) that turns it about its centre; None: its axes are those of the world.
        friction: Coulomb's mu between it and the cable, 0 to 10.

    Raises:
        SceneError: a value is not finite, or outside these limits, or `orientation` is no unit quaternion.
    """

    center: ArrayLike
    size: ArrayLike
    orientation: ArrayLike | None = None
    friction: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "center", _point("center", self.center))
        size = array("size", self.size, shape=(3,), unit="m")
        if not ((size > 0.0) & (size <= 1e4)).all():
            raise SceneError("size", size, "three lengths above 0 at most 10000 [m]")
        object.__setattr__(self, "size", size)
        if self.orientation is not None:
            turn = array("orientation", self.orientation, shape=(4,))
            if not abs(float(np.linalg.norm(turn)) - 1.0) < 1e-3:
                raise SceneError("orientation", turn, "a unit quaternion (w, x, y, z)")
            object.__setattr__(self, "orientation", turn)
        object.__setattr__(self, "friction", _friction(self.friction))

    def upright_at(self, height: float, reach: float) -> bool:
        """Return whether a cable on a table, its centreline at `height` [m], touches the box only sideways.

        This holds if four walls are vertical and cover `height` to `height` + `reach` [m].
        """
        z, sizes = cast(Floats, self.center)[2], cast(Floats, self.size)
        return any(
            _vertical(axis) and _covers(z, 0.5 * size, height, reach)
            for axis, size in zip(self._frame(), sizes, strict=True)
        )

    def _frame(self) -> Floats:
        """Return the axes of the box as rows (3, 3)."""
        if self.orientation is None:
            return np.eye(3)
        from scipy.spatial.transform import Rotation  # slow to import, and rarely needed

        w, x, y, z = cast(Floats, self.orientation)
        return Rotation.from_quat([x, y, z, w]).as_matrix().T

    def row(self) -> Floats:
        """Return the row (ROW,) that the compiled distance reads."""
        half = tuple(0.5 * cast(Floats, self.size))
        return _row(BOX, cast(Floats, self.center), self._frame(), half, self.friction)


Obstacle = Sphere | Capsule | Cylinder | Box
