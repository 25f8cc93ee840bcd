"""Initial shapes: the curve a cable lies along at t = 0, and its control points on given knots."""

from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import BSpline, make_interp_spline
from scipy.linalg import solveh_banded

from dlocore.errors import SceneError
from dlocore.fit import fit_points
from dlocore.scene import ControlPoints, Points, Shape, Straight
from dlocore.spline import DEGREE, uniform_knots

Floats = NDArray[np.float64]

MAX_LENGTH_MISMATCH = 0.10  # of the cable's length: beyond it the points are of another cable, or of a part of it
SPEED_RANGE = (0.5, 1.5)  # of |r'|: beyond it u is no material coordinate, e.g. evenly spaced points on clamped knots


@dataclass(frozen=True, kw_only=True, eq=False)
class SplineCurve:
    """A cubic spline over the material coordinate: control points (n, 3) on knots (n + 4,) [m]."""

    knots: Floats
    control_points: Floats

    def __call__(self, u: ArrayLike, derivative: int = 0) -> Floats:
        """Return the value or a derivative at `u` (k,) [m]; (k, 3)."""
        return BSpline(self.knots, self.control_points, DEGREE)(np.atleast_1d(u), derivative)


@dataclass(frozen=True, kw_only=True, eq=False)
class StartCurve(SplineCurve):
    """The shape of a cable at t = 0, r(u) over 0 <= u <= L.

    Attributes:
        velocity: v(u) [m/s], or None at rest.
        fit_rms: root mean square distance of the given points from the curve [m]; 0 where it is given exactly.
        fit_max: the largest of these distances [m].
        length_given: length of the curve before it was made as long as the cable [m].
    """

    velocity: SplineCurve | None = None
    fit_rms: float = 0.0
    fit_max: float = 0.0
    length_given: float = 0.0


def start_curve(shape: Shape, length: float) -> StartCurve:
    """Return the curve that a cable of `length` [m] lies along at t = 0.

    Raises:
        SceneError: the points are of a curve more than 10 % longer or shorter than the cable.
    """
    if isinstance(shape, Straight):
        return _straight(shape, length)
    if isinstance(shape, ControlPoints):
        return _given(shape, length)
    return _fitted(shape, length)


def _straight(shape: Straight, length: float) -> StartCurve:
    start, direction = cast(Floats, shape.start), cast(Floats, shape.direction)
    direction = direction / np.linalg.norm(direction)
    knots = uniform_knots(4, length)
    control = start + np.linspace(0.0, length, 4)[:, None] * direction
    rows = 2 if shape.velocity is None else len(cast(Floats, shape.velocity))
    velocity = _velocity(shape.velocity, np.linspace(0.0, length, rows))
    return StartCurve(knots=knots, control_points=control, velocity=velocity, length_given=length)


def _given(shape: ControlPoints, length: float) -> StartCurve:
    control = cast(Floats, shape.control_points)
    knots = uniform_knots(len(control), length) if shape.knots is None else cast(Floats, shape.knots)
    velocity = None
    if shape.velocity is not None:
        velocity = SplineCurve(knots=knots, control_points=np.broadcast_to(cast(Floats, shape.velocity), control.shape))
    return StartCurve(knots=knots, control_points=control, velocity=velocity, length_given=length)


def _fitted(shape: Points, length: float) -> StartCurve:
    points = cast(Floats, shape.points)
    middle = points.mean(axis=0)
    fit = fit_points(points - middle, length)
    _check_length("shape.points", fit.length_given, length)
    scale = length / fit.curve.t[-1]
    centre = fit.curve(np.linspace(0.0, fit.curve.t[-1], 65)).mean(axis=0)
    knots = fit.curve.t * scale
    curve = SplineCurve(knots=knots, control_points=middle + centre + scale * (fit.curve.c - centre))
    at = fit.at * scale
    off = _distance(curve, at, points)
    return StartCurve(
        knots=knots,
        control_points=curve.control_points,
        velocity=_velocity(shape.velocity, at),
        fit_rms=float(np.sqrt((off**2).mean())),
        fit_max=float(off.max()),
        length_given=fit.length_given,
    )


def _distance(curve: SplineCurve, at: Floats, points: Floats) -> Floats:
    """Return the distances (n,) [m] of points from a unit-speed curve, from parameters near their feet."""
    foot = at + ((points - curve(at)) * curve(at, 1)).sum(axis=1)
    return np.sqrt(((points - curve(np.clip(foot, 0.0, curve.knots[-1]))) ** 2).sum(axis=1))


def _check_length(name: str, given: float, length: float) -> None:
    if not abs(given - length) <= MAX_LENGTH_MISMATCH * length:
        raise SceneError(
            name,
            f"a curve {given:.4g} m long",
            "points along the whole cable, or another cable.length",
            f"The cable is {length:.4g} m long, and they may differ by {MAX_LENGTH_MISMATCH:.0%} of that",
        )


def _velocity(given: ArrayLike | None, at: Floats) -> SplineCurve | None:
    if given is None:
        return None
    velocity = cast(Floats, given)
    if velocity.ndim == 1:
        return SplineCurve(knots=uniform_knots(4, float(at[-1])), control_points=np.tile(velocity, (4, 1)))
    spline = make_interp_spline(at, velocity, k=DEGREE)
    return SplineCurve(knots=spline.t, control_points=spline.c)


def fit_to_knots(curve: SplineCurve, knots: Floats) -> Floats:
    """Return the control points (len(knots) - 4, 3) [m] of `curve` on clamped cubic `knots` [m], by least squares."""
    if len(curve.control_points) == 4:
        return _blossom(curve, knots)
    if np.array_equal(curve.knots, knots):
        return curve.control_points
    n = len(knots) - DEGREE - 1
    ends = knots[np.flatnonzero(np.diff(knots))]
    width = np.diff(np.append(ends, knots[-1]))
    x, w = np.polynomial.legendre.leggauss(4)
    u = (ends[:, None] + width[:, None] * (x + 1) / 2).ravel()
    weight = (width[:, None] * w).ravel()
    design = BSpline.design_matrix(u, knots, DEGREE)
    b, k = design.data.reshape(-1, 4).T, design.indices[::4]
    r = curve(u)
    band, right = np.zeros((4, n)), np.zeros((n, 3))
    for i in range(4):
        wb = weight * b[i]
        for d in range(3):
            right[:, d] += np.bincount(k + i, wb * r[:, d], n)
        for j in range(i + 1):
            band[i - j] += np.bincount(k + j, wb * b[j], n)
    return solveh_banded(band, right, lower=True)


def velocity_to_knots(curve: StartCurve, knots: Floats) -> Floats | None:
    """Return the control points [m/s] of the initial velocity on `knots` [m], or None at rest."""
    return None if curve.velocity is None else fit_to_knots(curve.velocity, knots)


def _blossom(curve: SplineCurve, knots: Floats) -> Floats:
    """Return the control points of a single cubic polynomial on any knots: its blossom at each three of them; exact."""
    length = curve.knots[-1]
    c = curve.control_points[:, None, :]
    for i in (1, 2, 3):
        a = (knots[i : i + len(knots) - 4] / length)[:, None]
        c = c[:-1] + a * (c[1:] - c[:-1])
    return c[0]
