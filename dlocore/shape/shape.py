"""Initial shapes: the curve a cable lies along at t = 0, and its control points on given knots."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dlocore.errors import SceneError
from dlocore.kernels.basis import GAUSS_4, gauss_points, spline_values
from dlocore.kernels.holding import place
from dlocore.kernels.projection import on_knots
from dlocore.scene.scene import MAX_STRAIN, ControlPoints, Material, Points, Shape, Straight
from dlocore.spline import DEGREE, greville, uniform_knots

if TYPE_CHECKING:
    from scipy.interpolate import BSpline

Floats = NDArray[np.float64]

SPEED_RANGE = (0.5, 1.5)  # of |r'| in material coordinates: a coarse spline of a hairpin stays inside
UNEVEN = 1e-3  # of |r'|: control points that deviate more from 1 define only a curve, not the places of the cable on it
_SAME_SPEED = 1e-9  # of |r'|
SAME_ANGLE = 1e-9  # [rad]
SAME_SPIN = 1e-6  # [rad/s]
_SPUN = 8  # places in each span at which the spin of the sections is computed
_PLACES = 129  # places at which the turning of a curve is computed
_ONE_SPAN = uniform_knots(4, 1.0)
_THIRDS = np.linspace(0.0, 1.0, 4)[:, None]


@dataclass(frozen=True, kw_only=True, eq=False)
class SplineCurve:
    """A cubic spline over the material coordinate: control points (n, 3 or 1) on knots (n + 4,) [m]."""

    knots: Floats
    control_points: Floats

    def __call__(self, u: ArrayLike, derivative: int = 0) -> Floats:
        """Return the value or a derivative, of order up to 3, at `u` (k,) [m]; (k, 3)."""
        at = np.atleast_1d(np.asarray(u, dtype=np.float64))
        return np.asarray(spline_values(_plain(self.knots), _plain(self.control_points), _plain(at), derivative))

    def place(self, u: float) -> Floats:
        """Return the point [m] and the unit tangent (2, 3) at `u` [m]."""
        return np.asarray(place(_plain(self.knots), _plain(self.control_points), u, 3))


@dataclass(frozen=True, kw_only=True, eq=False)
class StartCurve(SplineCurve):
    """The shape of a cable at t = 0, r(u) over 0 <= u <= L.

    Attributes:
        velocity: v(u) [m/s], or None at rest.
        fit_rms: root mean square distance of the given points from the curve [m]; 0 if it was given exactly.
        fit_max: the largest of these distances [m].
        fit_missed: root mean square of the part of them that neighbouring points share, which is not noise [m].
        length_given: length of the curve without its strain, before it was scaled to the cable [m].
        ends_moved: how far the scaling moved the end that it moved farther [m]; 0 if the curve was given exactly.
        slid: largest distance of a place from where uneven control points had it, before the curve was scaled to the
            cable [m]; 0 if they are even.
        theta: angle of the sections, a spline with control points (n, 1) [rad], or None if it is the same everywhere.
        theta_rate: its rate, a spline with control points (n, 1) [rad/s], or None if no section spins.
        strain: coordinates u (k,) [m], rising, and the axial strain there (k,), or None if there is none.
        material: what the sections remember, or None if the scene's `rest_shape` defines that.
        bow: height of the stress-free bow that a straight start was given so that it buckles [m], see
            `problem/buckling.py`.
        aside: height of the bow that a planar start was given out of its plane [m].
        lean: angle about the tangent by which the section at u = 0 is turned, so that at the grasps the sections lie as
            they did in the plane, on average [rad].
    """

    velocity: SplineCurve | None = None
    fit_rms: float = 0.0
    fit_max: float = 0.0
    fit_missed: float = 0.0
    length_given: float = 0.0
    ends_moved: float = 0.0
    slid: float = 0.0
    theta: SplineCurve | None = None
    theta_rate: SplineCurve | None = None
    strain: tuple[Floats, Floats] | None = None
    material: Material | None = None
    bow: float = 0.0
    aside: float = 0.0
    lean: float = 0.0

    @cached_property
    def heights(self) -> tuple[float, float]:
        """Heights of the lowest and the highest control point, between which the curve lies [m]."""
        z = self.control_points[:, 2].tolist()
        return min(z), max(z)

    @property
    def twisted(self) -> bool:
        """Whether its sections are turned, or turn, against each other or against what they remember."""
        rate = self.theta_rate
        return self.theta is not None or (rate is not None and _turned(rate.control_points, SAME_SPIN, self.material))

    @cached_property
    def even(self) -> bool:
        """Whether |r'| is 1 + strain everywhere. Without strain this is so only of a straight spline."""
        return float(np.abs(_speed(self)[0] - 1.0).max()) < _SAME_SPEED

    def strain_at(self, u: Floats) -> Floats:
        """Return the axial strain (k,) at u (k,) [m]."""
        if self.strain is None:
            return np.zeros(len(u))
        return np.interp(u, *self.strain)

    def spin_at(self, u: Floats) -> Floats:
        """Return how fast the sections spin about their tangent (k,) [rad/s] at u (k,) [m], rising.

        It is theta_t + f. Here f is the spin of the frame without twist along the cable against which theta is
        measured: f(0) = 0, f' = t . (t_t x r_uu) at unit speed (docs/model.md eq. 9).
        """
        if self.theta_rate is None:
            return np.zeros(len(u))
        spin = self.theta_rate(u)[:, 0]
        if self.velocity is None:
            return spin
        first, second, rate = self(u, 1), self(u, 2), self.velocity(u, 1)
        slope = np.einsum("kd,kd->k", first, np.cross(rate, second)) / np.linalg.norm(first, axis=1) ** 3
        frame = np.concatenate([[0.0], np.cumsum(0.5 * (slope[1:] + slope[:-1]) * np.diff(u))])
        return np.asarray(spin + frame)

    @cached_property
    def turning(self) -> float:
        """Total angle by which the tangent turns along the curve, whatever the direction [rad]."""
        tangents = self(np.linspace(0.0, self.knots[-1], _PLACES), 1)
        tangents /= np.linalg.norm(tangents, axis=1)[:, None]
        chords = np.linalg.norm(np.diff(tangents, axis=0), axis=1)
        return float(np.sum(2.0 * np.arcsin(np.minimum(0.5 * chords, 1.0))))


def _plain(x: Floats) -> Floats:
    """Return x, or a copy of it, as a C-contiguous writable array, as the kernels are compiled for."""
    return x if x.flags.c_contiguous and x.flags.writeable else np.array(x, order="C")


def start_curve(shape: Shape, length: float) -> StartCurve:
    """Return the curve along which a cable of `length` [m] lies at t = 0.

    Raises:
        SceneError: the points or control points are of a curve more than 10 % longer or shorter than the cable, or of
            no curve that a cable can follow.
    """
    if isinstance(shape, Straight):
        return _straight(shape, length)
    if isinstance(shape, ControlPoints):
        return _given(shape, length)
    return _fitted(shape, length)


def rest_curve(points: Floats, length: float) -> SplineCurve:
    """Return the stress-free curve of a cable of a length [m] through points (n, 3) [m].

    Raises:
        SceneError: the points do not lie along a curve of about that length.
    """
    try:
        return start_curve(Points(points=points), length)
    except SceneError as error:  # it names the points of the start: name the rest shape
        raise SceneError("cable.rest_shape", error.given, error.allowed, error.reason) from None


def _straight(shape: Straight, length: float) -> StartCurve:
    start, direction = cast(Floats, shape.start), cast(Floats, shape.direction)
    control = start + length * _THIRDS * (direction / math.sqrt(direction @ direction))
    velocity = _velocity(shape.velocity, length, lambda rows: np.linspace(0.0, length, rows), exact=True)
    return StartCurve(knots=length * _ONE_SPAN, control_points=control, velocity=velocity, length_given=length)


def _given(shape: ControlPoints, length: float) -> StartCurve:
    from dlocore.shape.fit import check_length  # slow to import, as are those below; a straight cable needs none

    rows = cast(Floats, shape.control_points)
    control, angles = rows[:, :3].copy(), rows[:, 3:].copy()
    knots = uniform_knots(len(control), length) if shape.knots is None else cast(Floats, shape.knots)
    velocity = theta_rate = None
    if shape.velocity is not None:
        rates = cast(Floats, shape.velocity)
        velocity = SplineCurve(knots=knots, control_points=np.array(np.broadcast_to(rates[..., :3], control.shape)))
        if rates.shape[-1] == 4:
            theta_rate = SplineCurve(knots=knots, control_points=rates[:, 3:].copy())
    turned = _turned(angles, SAME_ANGLE, shape.material)
    curve = StartCurve(
        knots=knots,
        control_points=control,
        velocity=velocity,
        theta=SplineCurve(knots=knots, control_points=angles) if turned else None,
        theta_rate=theta_rate,
        strain=None if shape.strain is None else (greville(knots), cast(Floats, shape.strain)),
        material=shape.material,
    )
    speed, width = _speed(curve)
    given = float((speed * width).sum())
    unstrained = "" if curve.strain is None else f" without `strain` ({MAX_STRAIN:.0%} at most)"
    check_length("shape.control_points", f"control points of the whole cable{unstrained}", given, length)
    slowest, fastest = float(speed.min()), float(speed.max())
    curve = replace(curve, length_given=given)
    if curve.strain is None and curve.material is None:
        return curve if max(1.0 - slowest, fastest - 1.0) <= UNEVEN else _in_arclength(curve, length)
    if not (slowest >= SPEED_RANGE[0] and fastest <= SPEED_RANGE[1]):
        allowed = (
            f"|r'|{unstrained} from {SPEED_RANGE[0]:g} to {SPEED_RANGE[1]:g} everywhere, as u is the cable's own "
            "arclength: a straight cable has its control points at the means of three successive knots"
        )
        raise SceneError("shape.control_points", f"|r'| from {slowest:.3g} to {fastest:.3g}", allowed)
    return curve


def _in_arclength(given: StartCurve, length: float) -> StartCurve:
    """Refit the curve of control points in its own arclength, and scale it about its middle to the cable's length [m].

    The angle of the sections, the velocity and the spin stay with the places of the curve.
    """
    from dlocore.shape.fit import in_arclength

    origin = given.control_points[0]
    beside = {name: getattr(given, name) for name in ("theta", "velocity", "theta_rate")}
    columns = {name: part.control_points for name, part in beside.items() if part is not None}
    curve = in_arclength(given.knots, np.column_stack([given.control_points - origin, *columns.values()]))
    if curve is None:
        raise _too_sharp(given)
    u, end = np.linspace(0.0, 1.0, _PLACES), float(curve.t[-1])
    slid = np.linalg.norm(origin + curve(end * u)[:, :3] - given(length * u), axis=1).max()
    knots, control, ends_moved = _to_length(curve, length, origin)
    values = np.split(curve.c[:, 3:], np.cumsum([part.shape[1] for part in columns.values()]), axis=1)
    splines: dict[str, Any] = {
        name: SplineCurve(knots=knots, control_points=c) for name, c in zip(columns, values, strict=False)
    }
    return replace(given, knots=knots, control_points=control, ends_moved=ends_moved, slid=float(slid), **splines)


def _too_sharp(given: StartCurve) -> SceneError:
    """Return the error for control points of a curve that is too sharp for a cable."""
    u = np.linspace(0.0, given.knots[-1], _PLACES)
    tangents = given(u, 1)
    tangents /= np.maximum(np.linalg.norm(tangents, axis=1), 1e-300)[:, None]
    at = u[int(np.argmin((tangents[1:] * tangents[:-1]).sum(axis=1)))]
    allowed = "control points of a curve that a cable can follow, without corners, which never turns back on itself"
    return SceneError("shape.control_points", f"a curve that turns too sharply about u = {at:.3g} m", allowed)


def _turned(angles: Floats, same: float, material: Material | None) -> bool:
    """Return whether sections with these angles (n, 1), or rates, are turned against each other or their memory."""
    return bool(np.ptp(angles) > same or (material is not None and np.abs(angles).max() > same))


def _speed(curve: StartCurve) -> tuple[Floats, Floats]:
    """Return |r'| without the strain at the Gauss points of the knot spans (k,), and their weights (k,) [m]."""
    u, width = gauss_points(_plain(curve.knots), *GAUSS_4)
    return np.sqrt((curve(u, 1) ** 2).sum(axis=1)) / (1.0 + curve.strain_at(u)), width


def _fitted(shape: Points, length: float) -> StartCurve:
    """Fit the points, and scale the curve about its middle to the cable's length.

    The scaling removes the mismatch in length that noise at the ends does not explain. It keeps the curve's shape and
    its unit speed. If the points are to scale but miss the ends of the cable, scaling costs 10 to 16 mm rms for 5 % of
    a 1 m cable. Extending the curve beyond its ends would cost as much if the points are off scale; but the points are
    defined to cover the whole cable.
    """
    from dlocore.shape.fit import fit_points

    points = cast(Floats, shape.points)
    middle = points.mean(axis=0)
    fit = fit_points(points - middle, length)
    at = np.minimum(fit.at * (length / float(fit.curve.t[-1])), length)
    knots, control, ends_moved = _to_length(fit.curve, length, middle)
    off = _offsets(SplineCurve(knots=knots, control_points=control), at, points)
    distance = np.sqrt((off**2).sum(axis=1))
    alike = float((off[1:] * off[:-1]).sum(axis=1).mean())
    return StartCurve(
        knots=knots,
        control_points=control,
        velocity=_velocity(shape.velocity, length, lambda rows: at, exact=False),
        fit_rms=float(np.sqrt((distance**2).mean())),
        fit_max=float(distance.max()),
        fit_missed=math.sqrt(max(alike, 0.0)),
        length_given=fit.length_given,
        ends_moved=ends_moved,
    )


def _to_length(curve: "BSpline", length: float, origin: Floats) -> tuple[Floats, Floats, float]:
    """Scale a curve in arclength, given relative to `origin` (3,) [m], about its middle to a length [m].

    Returns:
        Its knots [m], its control points (n, 3) [m], and how far the end moved that moved farther [m].
    """
    scale, c = length / float(curve.t[-1]), curve.c[:, :3]
    centre = curve(np.linspace(0.0, curve.t[-1], 65))[:, :3].mean(axis=0)
    knots = curve.t * scale
    knots[-DEGREE - 1 :] = length
    ends = np.linalg.norm(c[[0, -1]] - centre, axis=1)
    return knots, origin + centre + scale * (c - centre), abs(scale - 1.0) * float(ends.max())


def _offsets(curve: SplineCurve, at: Floats, points: Floats) -> Floats:
    """Return the offsets (n, 3) [m] of points from a unit-speed curve, given parameters near their feet."""
    foot = at + ((points - curve(at)) * curve(at, 1)).sum(axis=1)
    return points - curve(np.clip(foot, 0.0, curve.knots[-1]))


def _velocity(
    given: ArrayLike | None, length: float, at: Callable[[int], Floats], *, exact: bool
) -> SplineCurve | None:
    """Return the velocity field of one velocity (3,) for all, or of `rows` velocities at `at(rows)` [m].

    `exact` interpolates them; otherwise they are smoothed.
    """
    if given is None:
        return None
    velocity = cast(Floats, given)
    if velocity.ndim == 1:
        return SplineCurve(knots=uniform_knots(4, length), control_points=np.tile(velocity, (4, 1)))
    from scipy.interpolate import make_interp_spline

    from dlocore.shape.fit import MAX_SPANS
    from dlocore.shape.smoothing import smooth

    u, mean = at(len(velocity)), velocity.mean(axis=0)
    if exact:
        spline = make_interp_spline(u, velocity - mean, k=DEGREE)
    else:
        spans = int(np.clip(len(u), 8, MAX_SPANS))
        spline = smooth(u, velocity - mean, np.ones(len(u)), length, spans, np.inf, np.ones(spans))
    return SplineCurve(knots=spline.t, control_points=mean + spline.c)


def fit_to_knots(curve: SplineCurve, knots: Floats) -> Floats:
    """Return the control points (len(knots) - 4, 3) [m] of `curve` on clamped cubic `knots` [m], by least squares.

    Exact for a straight cable, for the curve's own knots and for knots that contain them. Otherwise the projection
    keeps the shape but not the unit speed: a 1 m cable along one sine wave is strained by 4 % in the middle of a span
    on 9 control points with uniform knots, by 0.9 % on 13, and by 0.07 % on 25.
    """
    return np.asarray(on_knots(_plain(curve.knots), _plain(curve.control_points), _plain(knots), *GAUSS_4))


def velocity_to_knots(curve: StartCurve, knots: Floats) -> Floats | None:
    """Return the control points [m/s] of the initial velocity on `knots` [m], or None at rest."""
    return None if curve.velocity is None else fit_to_knots(curve.velocity, knots)


def spin_to_knots(curve: StartCurve, knots: Floats) -> Floats | None:
    """Return the control points (n_u,) [rad/s] of the sections' spin on `knots` [m], or None if they have none."""
    if curve.theta_rate is None:
        return None
    from scipy.interpolate import make_lsq_spline

    cuts = np.unique(np.concatenate([curve.knots, knots]))
    u = np.unique(np.concatenate([np.linspace(a, b, _SPUN) for a, b in pairwise(cuts)]))
    return np.asarray(make_lsq_spline(u, curve.spin_at(u), knots, k=DEGREE).c)
