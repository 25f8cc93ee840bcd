"""The bivariate cubic B-spline q(u, t) = sum_ij b_i(u) b_j(t) q_ij of the paper's eq. (15)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dlocore.errors import SceneError, unmasked, whole
from dlocore.pickling import Answered

Floats = NDArray[np.float64]
DEGREE = 3
_TINY = 1e-300  # smallest divisor |r'|^3
_GAUSS = 1.0 / 3.0**0.5  # of half an interval: the two Gauss points
_MOST_SAMPLES = 1_000_000  # evenly spaced, in either direction
_ROUNDING = 1e-9  # of the length, or of the time: how far beyond its ends a surface may be read


def uniform_knots(n: int, end: float) -> Floats:
    """Return clamped uniform cubic knots for `n` control points on [0, end]; (n + 4,)."""
    knots = np.zeros(n + DEGREE + 1)
    knots[DEGREE:n] = end / (n - 3) * np.arange(n - 3)
    knots[n:] = end
    return knots


def greville(knots: Floats) -> Floats:
    """Return the Greville abscissae (n,), the means of three successive inner knots."""
    return (knots[1:-3] + knots[2:-2] + knots[3:-1]) / 3.0


def design_matrix(knots: Floats, x: ArrayLike, derivative: int = 0) -> Floats:
    """Return the basis functions, or a derivative of them, at the points `x`; (len(x), n) [1/unit^derivative]."""
    return spline_at(knots, np.eye(len(knots) - DEGREE - 1), x, derivative)


def spline_at(knots: Floats, control_points: Floats, x: ArrayLike, derivative: int = 0) -> Floats:
    """Return the spline with control points (n, ...), or a derivative of it, at the points `x` (k,); (k, ...)."""
    from scipy.interpolate import BSpline  # slow to import, and not needed to make a scene

    return np.asarray(BSpline(knots, control_points, DEGREE)(np.asarray(x, dtype=float), derivative))


def through_others(x: Floats, values: Floats, k: NDArray[np.intp], others: NDArray[np.intp]) -> Floats:
    """Return the values (n, d), at x[k] (n,), of the cubics through the four `others` (n, 4) of values (m, d) at x."""
    found = np.zeros((len(k), values.shape[1]))
    for a in range(4):
        share = np.ones(len(k))
        for b in range(4):
            if b != a:
                share *= (x[k] - x[others[:, b]]) / (x[others[:, a]] - x[others[:, b]])
        found += share[:, None] * values[others[:, a]]
    return found


def nearest_line(x: Floats, u: Floats, values: Floats) -> Floats:
    """Return values (n,) at x (n,): the piecewise linear function nearest to that with `values` (k,) at u (k,).

    Nearest is meant in the least-squares sense. Both x and u rise, from the same first to the same last coordinate. The
    two functions have the same integral, also if the given one jumps.
    """
    from scipy.linalg import solveh_banded  # slow to import

    cuts = np.union1d(x, u)
    half = 0.5 * np.diff(cuts)
    at = np.concatenate([cuts[:-1] + (1.0 + side) * half for side in (-_GAUSS, _GAUSS)])
    weights, known = np.tile(half, 2), np.interp(at, u, values)
    k = np.clip(np.searchsorted(x, at) - 1, 0, len(x) - 2)
    after = (at - x[k]) / (x[k + 1] - x[k])
    before = 1.0 - after

    def sums(places: NDArray[np.intp], of: Floats) -> Floats:
        return np.asarray(np.bincount(places, weights * of, len(x)), dtype=float)

    band = np.stack([sums(k, before**2) + sums(k + 1, after**2), sums(k, before * after)])
    return np.asarray(solveh_banded(band, sums(k, before * known) + sums(k + 1, after * known), lower=True))


def in_range(name: str, x: ArrayLike, end: float, unit: str) -> Floats:
    """Return `x`, a number or a row of numbers, as an array (k,).

    Raises:
        SceneError: it is neither, a number is masked, or a number is outside 0 to `end` by more than rounding.
    """
    allowed, margin = f"finite numbers at least 0 at most {end:g} [{unit}]", _ROUNDING * end
    try:
        raw = np.asarray(unmasked(x))
    except ValueError:
        raise SceneError(name, repr(x), allowed) from None
    if raw.dtype.kind not in "fiu":
        raise SceneError(name, repr(x), allowed)
    x = np.atleast_1d(raw.astype(float, copy=False))
    if x.ndim > 1:
        raise SceneError(name, f"shape {x.shape}", f"one row of {allowed}")
    for k in (x.argmin(), x.argmax()) if x.size else ():  # both return the index of a NaN, if there is one
        if not -margin <= x.item(k) <= end + margin:
            raise SceneError(name, x.item(k), allowed)
    return x


def _order(name: str, order: int) -> int:
    """Return the order of a derivative, or raise SceneError unless it is 0 to 3."""
    return whole(name, order, at_least=0, at_most=DEGREE)


@dataclass(frozen=True, eq=False)
class SplineSurface(Answered):
    """A predicted space-time surface: positions and twist over material coordinate and time.

    Every method that reads it raises SceneError if a coordinate is off the cable or a time outside the predicted time.

    Attributes:
        control_points: q_ij, (n_t, n_u, 4) [m, m, m, rad].
        knots_u: (n_u + 4,) [m].
        knots_t: (n_t + 4,) [s].
    """

    control_points: Floats
    knots_u: Floats
    knots_t: Floats

    def __repr__(self) -> str:
        n_t, n_u = self.control_points.shape[:2]
        return f"<SplineSurface: {n_u} x {n_t} control points, {self.length:g} m, {self.horizon:g} s>"

    @property
    def length(self) -> float:
        """Length of the cable [m]."""
        return float(self.knots_u[-1])

    @property
    def horizon(self) -> float:
        """Predicted time [s]."""
        return float(self.knots_t[-1])

    def __call__(self, u: ArrayLike, t: ArrayLike, du: int = 0, dt: int = 0) -> Floats:
        """Return q, or its derivative of orders `du` and `dt`, on the grid of `t` and `u`.

        Args:
            u: material coordinates (k_u,) [m].
            t: times (k_t,) [s].
            du: order of the derivative in u, 0 to 3.
            dt: order of the derivative in t, 0 to 3.

        Returns:
            (k_t, k_u, 4) [m, m, m, rad], per m^du s^dt.

        Raises:
            SceneError: a coordinate is off the cable, a time outside the predicted time, or an order not 0 to 3.
        """
        over = design_matrix(self.knots_u, in_range("u", u, self.length, "m"), _order("du", du))
        t = in_range("t", t, self.horizon, "s")
        if len(t) < len(self.control_points):
            return np.asarray(over @ spline_at(self.knots_t, self.control_points, t, _order("dt", dt)))
        return spline_at(self.knots_t, over @ self.control_points, t, _order("dt", dt))

    def states(self, t: ArrayLike, dt: int = 0) -> Floats:
        """Return the control points of the spatial spline, or their derivatives, at times `t` (k,) [s]; (k, n_u, 4)."""
        return spline_at(self.knots_t, self.control_points, in_range("t", t, self.horizon, "s"), _order("dt", dt))

    def positions(self, u: ArrayLike, t: ArrayLike) -> Floats:
        """Return the positions r on the grid of `t` and `u`; (k_t, k_u, 3) [m]."""
        return self(u, t)[..., :3]

    def sample(self, samples_u: int = 101, samples_t: int = 33) -> tuple[Floats, Floats, Floats]:
        """Return evenly spaced u (samples_u,) [m] and t (samples_t,) [s], and q there (samples_t, samples_u, 4)."""
        u = np.linspace(0.0, self.length, whole("samples_u", samples_u, at_least=1, at_most=_MOST_SAMPLES))
        t = np.linspace(0.0, self.horizon, whole("samples_t", samples_t, at_least=1, at_most=_MOST_SAMPLES))
        return u, t, self(u, t)

    def curvature(self, u: ArrayLike, t: ArrayLike) -> Floats:
        """Return the curvature |r' x r''| / |r'|^3 on the grid; (k_t, k_u) [1/m]. It is 0 where r' is zero.

        It is least accurate at clamps and free ends. If a clamp bends a limp cable sharply, the moment of its gripper
        gives the curvature more accurately (docs/api.md).
        """
        first, second = self(u, t, du=1)[..., :3], self(u, t, du=2)[..., :3]
        cross = np.linalg.norm(np.cross(first, second), axis=-1)
        return cross / np.maximum(np.linalg.norm(first, axis=-1) ** 3, _TINY)

    def twist_rate(self, u: ArrayLike, t: ArrayLike) -> Floats:
        """Return the twist strain tau = theta' on the grid (docs/model.md eq. 19); (k_t, k_u) [rad/m]."""
        return self(u, t, du=1)[..., 3]

    def frenet_twist(self, u: ArrayLike, t: ArrayLike, regularisation: float) -> Floats:
        """Return the paper's twist strain, theta' minus the Frenet torsion (paper eq. 8), regularised; (k_t, k_u).

        For comparison only. The torsion (r_u x r_uu) . r_uuu / |r_u x r_uu|^2 is undefined where the cable is straight
        or inflected. Therefore the square of `regularisation` [1/m] is added to the denominator. Below that curvature
        the torsion fades out, and with it the twist that belongs there. theta is interpreted as in the paper, against
        the Frenet frame.
        """
        first, second, third = (self(u, t, du=order)[..., :3] for order in (1, 2, 3))
        binormal = np.cross(first, second)
        square = (binormal**2).sum(axis=-1) + regularisation**2
        return self.twist_rate(u, t) - (binormal * third).sum(axis=-1) / square

    def axial_strain(self, u: ArrayLike, t: ArrayLike) -> Floats:
        """Return the axial strain |r'| - 1 of the spline on the grid; (k_t, k_u).

        It is evaluated at the middle of each span and interpolated between, because elsewhere the derivative of the
        spline oscillates about it. In the two spans beside an end, a grasp or a load it may be off by a fifth. For a
        tension use `Prediction.stretch`, the strain that balances the forces on the cable.
        """
        u, breaks = in_range("u", u, self.length, "m"), np.unique(self.knots_u)
        middles = 0.5 * (breaks[:-1] + breaks[1:])
        strain = np.linalg.norm(self(middles, t, du=1)[..., :3], axis=-1) - 1.0
        return np.array([np.interp(u, middles, row) for row in strain]).reshape(len(strain), len(u))
