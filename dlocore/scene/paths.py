"""Grasp paths: where a gripper goes, and how it turns, over time.

A path's clock starts when its grasp does (`Grasp.grasp_time`, t = 0 by default). Before its first time and after its
last the gripper stands still.
"""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, cast, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dlocore.errors import SceneError, array, choice, number
from dlocore.pickling import Checked
from dlocore.words import counted

if TYPE_CHECKING:
    from scipy.interpolate import CubicSpline
    from scipy.spatial.transform import Rotation

Floats = NDArray[np.float64]
Profile = Literal["minimum_jerk", "linear", "cubic"]
Through = Literal["spline", "minimum_jerk", "linear", "cubic"]
Start = Literal["rest", "moving"]

# coefficients of x to x^5 of the position s(x) on 0 <= x <= 1
_PROFILES: dict[str, tuple[float, ...]] = {
    "minimum_jerk": (0.0, 0.0, 10.0, -15.0, 6.0),
    "linear": (1.0, 0.0, 0.0, 0.0, 0.0),
    "cubic": (0.0, 3.0, -2.0, 0.0, 0.0),
}
MAX_WAYPOINTS = 100_000
LATEST = 1e4  # [s], of a waypoint
MAX_STOPS = 1000  # waypoints at which a gripper stops: each is an event
SAME_TURN = 1e-9  # [rad]: orientations that differ by less are the same: the gripper does not turn
DRAWN = 0.2  # [s], in which a gripper that closes beside its first waypoint draws the cable to its path
STAYS = (1.0, *_PROFILES["linear"], 0.0, 0.0, 0.0)  # a straight move, or a turn about one axis, of zero size


@dataclass(frozen=True, kw_only=True, eq=False)
class Still:
    """A gripper that stays where it grasped the cable."""

    @property
    def duration(self) -> float:
        """Time until the path ends [s]."""
        return 0.0

    @property
    def line(self) -> tuple[float, ...]:
        """Duration, profile and displacement of a straight move."""
        return STAYS

    @property
    def turn(self) -> tuple[float, ...]:
        """Duration, profile and rotation vector of a turn about one axis."""
        return STAYS

    def at(self, t: Floats, start: Floats) -> Floats:
        """Positions at times `t` (k,) [s] of a grasp that began at `start` (3,) [m]; (k, 3) [m]."""
        return np.broadcast_to(start, (len(t), 3))

    def rotation_at(self, t: Floats) -> Floats | None:
        """Rotations since the grasp began at times `t`; (k, 3, 3), or None if it never turns."""
        return None

    def spin(self, t: Floats, tangents: Floats) -> Floats:
        """Turn about the `tangents` (k, 3) between successive times `t` (k,) [s]; (k - 1,) [rad]."""
        return np.zeros(len(t) - 1)


@dataclass(frozen=True, kw_only=True, eq=False)
class Move(Checked):
    """Move by `displacement` (3,) [m] and turn by the rotation vector `rotation` (3,) [rad] in `duration` [s].

    `profile` is "minimum_jerk" (zero velocity and acceleration at both ends), "cubic" (zero velocity at both ends) or
    "linear" (constant velocity, which jumps at both ends).
    """

    displacement: ArrayLike
    duration: float
    rotation: ArrayLike | None = None
    profile: Profile = "minimum_jerk"

    def __post_init__(self) -> None:
        object.__setattr__(self, "displacement", array("displacement", self.displacement, shape=(3,), unit="m"))
        object.__setattr__(self, "duration", number("duration", self.duration, above=1e-4, at_most=1e4, unit="s"))
        if self.rotation is not None:
            object.__setattr__(self, "rotation", array("rotation", self.rotation, shape=(3,), unit="rad"))
        choice("profile", self.profile, get_args(Profile))

    @property
    def line(self) -> tuple[float, ...]:
        """Duration [s], coefficients of x to x^5 of the profile, and displacement [m] of a straight move."""
        return (self.duration, *_PROFILES[self.profile], *cast(Floats, self.displacement).tolist())

    @property
    def turn(self) -> tuple[float, ...]:
        """Duration [s], coefficients of x to x^5 of the profile, and rotation vector [rad] of a turn about one axis."""
        if self.rotation is None:
            return STAYS
        return (self.duration, *_PROFILES[self.profile], *cast(Floats, self.rotation).tolist())

    def _share(self, t: Floats) -> Floats:
        """Return the share of the way that is covered at times `t` (k,) [s]."""
        return _share(self.profile, t / self.duration)

    def at(self, t: Floats, start: Floats) -> Floats:
        """Positions at times `t` (k,) [s] of a grasp that began at `start` (3,) [m]; (k, 3) [m]."""
        s = self._share(t)
        return start + s[:, None] * cast(Floats, self.displacement)

    def rotation_at(self, t: Floats) -> Floats | None:
        """Rotations since the grasp began at times `t`; (k, 3, 3), or None if it never turns."""
        if self.rotation is None:
            return None
        rotation = cast(Floats, self.rotation)
        full = math.sqrt(rotation @ rotation)
        x, y, z = (rotation / (full or 1.0)).tolist()
        across = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
        angle = (full * self._share(t))[:, None, None]
        return np.eye(3) + np.sin(angle) * across + 2.0 * np.sin(0.5 * angle) ** 2 * (across @ across)  # Rodrigues

    def spin(self, t: Floats, tangents: Floats) -> Floats:
        """Turn about the `tangents` (k, 3) between successive times `t` (k,) [s]; (k - 1,) [rad].

        The angle between the tangent and the rotation vector is constant, so this is exact.
        """
        if self.rotation is None:
            return np.zeros(len(t) - 1)
        s = self._share(t)
        return np.diff(s) * float(tangents[0] @ cast(Floats, self.rotation))


@dataclass(frozen=True, kw_only=True, eq=False)
class Waypoints(Checked):
    """Pass through `positions` (n, 3) [m] at `times` (n,) [s] along a C2 cubic spline, or stop at each of them.

    `profile` "spline" is for smooth paths. They start at rest, or with `start` "moving" at the velocity that the first
    waypoints imply, as recorded paths do.

    With another profile the path is a robot program: it goes straight from each waypoint to the next, as a `Move` with
    that profile does, and turns about one axis on the way. Two waypoints in the same place are a pause. With "linear"
    the gripper does not stop at a waypoint, but its velocity jumps there.

    `orientations` (n, 4) are unit quaternions (w, x, y, z). They turn the grasp by their rotation since the first,
    R(t) R(0)^-1 in world axes, the shorter way from each to the next. Along a spline the rotation is as smooth as the
    positions, and starts at rest or moving as they do. If the orientations stay the same, the grasp does not turn.

    The first position must be within 10 mm of the grasped point of the cable when the grasp closes. The start shape is
    moved to it; a cable in motion is drawn to it within 0.2 s.
    """

    times: ArrayLike
    positions: ArrayLike
    orientations: ArrayLike | None = None
    start: Start = "rest"
    profile: Through = "spline"

    def __post_init__(self) -> None:
        choice("start", self.start, get_args(Start))
        choice("profile", self.profile, get_args(Through))
        smooth = self.profile == "spline"
        if self.start == "moving" and not smooth:
            raise SceneError("start", self.start, f'"rest" with profile "{self.profile}"')
        times = array("times", self.times, shape=(None,), unit="s")
        most = MAX_WAYPOINTS if smooth else MAX_STOPS
        if not 2 <= len(times) <= most:
            raise SceneError("times", counted(len(times), "time"), f'2 to {most} times with profile "{self.profile}"')
        if not (np.diff(times) > 1e-6).all():
            k = int(np.argmin(np.diff(times)))
            raise SceneError(f"times[{k + 1}]", times[k + 1], "times that rise by more than 1e-6 s")
        if times[0] < 0.0:
            raise SceneError("times[0]", times[0], "at least 0 [s]")
        if times[0] > LATEST:
            clock = "Times count from when the gripper closes, and these look like those of a clock"
            raise SceneError("times[0]", times[0], f"at most {LATEST:g} [s], such as 0", clock)
        number("times[-1]", float(times[-1]), above=1e-4, at_most=LATEST, unit="s")
        positions = array("positions", self.positions, shape=(None, 3), unit="m")
        if len(positions) != len(times):
            raise SceneError("positions", counted(len(positions), "position"), f"as many as times ({len(times)})")
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "positions", positions)
        from scipy.interpolate import make_interp_spline  # slow to import, as are the rotations below

        spline = self._smoothly(positions) if smooth else make_interp_spline(times, positions, 1)
        object.__setattr__(self, "_spline", spline)
        object.__setattr__(self, "_turns", None)
        if self.orientations is not None:
            quaternions = array("orientations", self.orientations, shape=(None, 4))
            if len(quaternions) != len(times):
                raise SceneError("orientations", counted(len(quaternions), "row"), f"as many as times ({len(times)})")
            norms = np.linalg.norm(quaternions, axis=1)
            if not (np.abs(norms - 1.0) < 1e-3).all():
                k = int(np.argmax(np.abs(norms - 1.0)))
                raise SceneError(f"orientations[{k}]", quaternions[k], "unit quaternions (w, x, y, z)")
            object.__setattr__(self, "orientations", quaternions)
            from scipy.spatial.transform import Rotation, Slerp

            given = Rotation.from_quat(quaternions[:, [1, 2, 3, 0]])
            turns = given * given[0].inv()
            if turns.magnitude().max() > SAME_TURN:
                object.__setattr__(self, "_turns", self._smoothly(_nearest(turns)) if smooth else Slerp(times, turns))

    def _smoothly(self, values: Floats) -> "CubicSpline":
        """Return the C2 cubic spline through values (n, k) at the times; it starts at rest if the path does."""
        from scipy.interpolate import CubicSpline

        zero = np.zeros(values.shape[1])
        boundary: Any = "not-a-knot" if self.start == "moving" else ((1, zero), (2, zero))
        return CubicSpline(cast(Floats, self.times), values, bc_type=boundary)

    @property
    def duration(self) -> float:
        """Time until the path ends [s]."""
        return float(cast(Floats, self.times)[-1])

    @property
    def line(self) -> None:
        """None: the path is not a single straight move."""

    @property
    def stops(self) -> Floats:
        """Times (k,) [s] at which one move ends and the next begins; none along a spline."""
        return np.zeros(0) if self.profile == "spline" else cast(Floats, self.times)[1:-1]

    @property
    def turn(self) -> tuple[float, ...] | None:
        """None if the grasp turns, since that is not about a single axis; otherwise a turn of zero size."""
        return STAYS if self._turns is None else None  # type: ignore[attr-defined]

    def _evenly(self, t: Floats) -> Floats:
        """Return the parameters [s] at which to evaluate the spline, or the chords, for the times t (k,) [s]."""
        times = cast(Floats, self.times)
        t = np.clip(t, times[0], times[-1])
        if self.profile == "spline":
            return t
        k = np.clip(np.searchsorted(times, t, side="right") - 1, 0, len(times) - 2)
        lasts = times[k + 1] - times[k]
        return np.asarray(times[k] + lasts * _share(self.profile, (t - times[k]) / lasts))

    def at(self, t: Floats, start: Floats) -> Floats:
        """Positions at times `t` (k,) [s]; (k, 3) [m]. `start` is not used: waypoints are absolute."""
        return self._spline(self._evenly(t))  # type: ignore[attr-defined]

    def acceleration(self, t: Floats) -> Floats:
        """Accelerations (k, 3) [m/s^2] at times `t` (k,) [s] of a path with profile "spline"."""
        return np.asarray(self._spline(self._evenly(t), 2))  # type: ignore[attr-defined]

    def rotation_at(self, t: Floats) -> Floats | None:
        """Rotations since the grasp began at times `t`; (k, 3, 3), or None if it never turns."""
        return None if self._turns is None else self._turned(t).as_matrix()  # type: ignore[attr-defined]

    def _turned(self, t: Floats) -> "Rotation":
        """Return the rotations (k,) since the first waypoint at times `t` (k,) [s]; only for a path that turns."""
        from scipy.spatial.transform import Rotation

        turns = self._turns(self._evenly(t))  # type: ignore[attr-defined]
        return Rotation.from_quat(turns) if self.profile == "spline" else turns

    def spin(self, t: Floats, tangents: Floats) -> Floats:
        """Turn about the `tangents` (k, 3) between successive times `t` (k,) [s]; (k - 1,) [rad].

        Between two waypoints the gripper turns the shorter way, so a full turn needs three waypoints or more.
        """
        if self._turns is None:  # type: ignore[attr-defined]
            return np.zeros(len(t) - 1)
        fine = np.unique(np.concatenate([t, cast(Floats, self.times)]))
        turns = self._turned(fine)
        steps = (turns[1:] * turns[:-1].inv()).as_rotvec()
        at = np.clip(np.searchsorted(t, fine[:-1], side="right") - 1, 0, len(t) - 2)
        inside = (fine[:-1] >= t[0]) & (fine[1:] <= t[-1])
        along = (steps * tangents[at]).sum(axis=1)
        return np.asarray(np.bincount(at[inside], along[inside], minlength=len(t) - 1), dtype=np.float64)


Path = Still | Move | Waypoints


def _nearest(turns: "Rotation") -> Floats:
    """Return one of the two quaternions (x, y, z, w) of each rotation: the one nearer to the quaternion before it."""
    quaternions = turns.as_quat()
    signs = np.where((quaternions[1:] * quaternions[:-1]).sum(axis=1) < 0.0, -1.0, 1.0)
    return np.asarray(quaternions * np.cumprod(np.append(1.0, signs))[:, None])


def held_at(path: Path, t: Floats, start: Floats) -> Floats:
    """Positions (k, 3) [m] at times `t` (k,) [s] of a grasped point that was at `start` (3,) [m] as the gripper closed.

    They are those of the path. Waypoints draw the point from `start` to the path by minimum jerk within DRAWN, or
    within the duration of the path if that is shorter.
    """
    at = path.at(t, start)
    if not isinstance(path, Waypoints):
        return at
    drawn = _share("minimum_jerk", t / min(DRAWN, path.duration))
    return at + (1.0 - drawn)[:, None] * (start - cast(Floats, path.positions)[0])


def _share(profile: str, x: Floats) -> Floats:
    """Return the share of the way that a profile has covered at x (k,), where x is 0 at its start and 1 at its end."""
    x = np.clip(x, 0.0, 1.0)
    a, b, c, d, e = _PROFILES[profile]
    return np.asarray(x * (a + x * (b + x * (c + x * (d + x * e)))))
