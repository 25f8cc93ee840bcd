"""Fit a unit-speed spline to ordered, noisy points: a penalised cubic B-spline in true arclength."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline, CubicHermiteSpline, make_interp_spline
from scipy.linalg.lapack import dpbtrf, dpbtrs

from dlocore.spline import DEGREE

Floats = NDArray[np.float64]

MAX_GROUPS = 2000  # points are averaged down to this many: each group then still is a small fraction of a knot span
FINEST = 128  # knot spans: 2.5 for each radius of a cable that turns 8 full loops
SPARSE = 40  # points: up to here their chords are long against the noise, and their order is not in doubt
REFITS = 4  # of the parameter: measured, a fifth changes the shape by less than 1 % of the noise


@dataclass(frozen=True, eq=False)
class PointFit:
    """A curve fitted to points.

    Attributes:
        curve: unit-speed spline on [0, length] [m].
        length: its length [m].
        at: material coordinates of the points (n,) [m].
    """

    curve: BSpline
    length: float
    at: Floats


def fit_points(points: Floats, length: float) -> PointFit:
    """Fit a curve to ordered points (n, 3) [m] of a cable of about `length` [m]."""
    middle = points.mean(axis=0)
    given = points - middle
    share = _share(given)
    p, w, weight = _grouped(given, share, MAX_GROUPS)
    u = _first_parameter(p, w, weight, length)
    for _ in range(REFITS):
        span = u[-1] - u[0]
        spans = int(np.clip(len(p), 8, FINEST))
        spline = smooth(u - u[0], p, weight, span, spans)
        x = u - u[0]
        if len(p) > SPARSE:
            x = np.clip(_projected(spline, x, p), -0.05 * span, 1.05 * span)
        grid, s = arclength(spline, 0.0, span, 4 * spans)
        u = np.interp(x, grid, s) + np.minimum(x, 0.0) + np.maximum(x - span, 0.0)
        first, last = _ends(u, p, spline, x)
        u = u - first
        origin = first
    total = last - first
    curve = unit_speed(spline, float(np.interp(origin, s, grid)), float(np.interp(last, s, grid)), 2 * spans)
    at = np.interp(share, w, np.clip(u, 0.0, total))
    return PointFit(BSpline(curve.t, curve.c + middle, DEGREE), float(curve.t[-1]), at)


def _share(p: Floats) -> Floats:
    """Return a measure of progress along the points (n,), from 0 to 1: half by count, half by chord length."""
    chord = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(p, axis=0), axis=1))])
    return 0.5 * (np.arange(len(p)) / (len(p) - 1) + chord / chord[-1])


def _grouped(p: Floats, share: Floats, count: int) -> tuple[Floats, Floats, Floats]:
    """Average consecutive points over `count` equal parts of their progress; points, progress, number in each."""
    if len(p) <= count:
        return p, share, np.ones(len(p))
    # an irrational number of parts about the middle: no point lies on a boundary by regularity, so rounding decides
    # nothing, and reversed points fall into the same groups
    part = np.rint((share - 0.5) * (count - 1 - 0.38196601125))
    start = np.flatnonzero(np.diff(part, prepend=np.nan) != 0)
    number = np.diff(start, append=len(p)).astype(float)
    return np.add.reduceat(p, start) / number[:, None], np.add.reduceat(share, start) / number, number


def _noise(p: Floats) -> float:
    """Return a robust estimate of the noise of one coordinate [m], from each point's distance to its neighbours' chord."""
    before, after = np.diff(p, axis=0)[:-1], np.diff(p, axis=0)[1:]
    a, b = np.linalg.norm(before, axis=1), np.linalg.norm(after, axis=1)
    left = a / np.maximum(a + b, 1e-300)
    offset = (1 - left)[:, None] * before - left[:, None] * after
    squared = (offset**2).sum(axis=1) / (1 + left**2 + (1 - left) ** 2)
    return float(np.sqrt(np.median(squared) / 1.39))  # the median of chi^2 with two degrees of freedom is 1.39


def _first_parameter(p: Floats, w: Floats, weight: Floats, length: float) -> Floats:
    """Return the chord length of averaged points at each point (n,) [m]."""
    if len(p) <= SPARSE:
        return np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(p, axis=0), axis=1))])
    bins = int(np.clip(length / (6 * _noise(p) + 1e-9 * length), SPARSE, len(p)))
    q, wq, _ = _grouped(p, w, bins)
    chord = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(q, axis=0), axis=1))])
    u = np.interp(w, wq, chord)
    u += np.minimum(w - wq[0], 0.0) * (chord[1] - chord[0]) / (wq[1] - wq[0])
    return u + np.maximum(w - wq[-1], 0.0) * (chord[-1] - chord[-2]) / (wq[-1] - wq[-2])


def _projected(spline: BSpline, x: Floats, p: Floats) -> Floats:
    """Move parameters towards the feet of the points on the curve by one Newton step of the tangent."""
    tangent = spline(x, 1)
    return x + ((p - spline(x)) * tangent).sum(axis=1) / (tangent**2).sum(axis=1)


def _ends(u: Floats, p: Floats, spline: BSpline, x: Floats) -> tuple[float, float]:
    """Return where the first and the last point lie on the curve, free of their noise [m].

    Projections of dense noisy points overshoot the ends; a line through the first few tells where the first one is.
    """
    off = np.linalg.norm(p - spline(x), axis=1)
    reach = 6 * float(np.median(off))
    k = int(np.clip(np.rint(reach * (len(u) - 1) / (u[-1] - u[0])), 1, max(len(u) // 8, 1)))

    def end(v: Floats) -> float:
        one, two = v[:k].mean(), v[k : 2 * k].mean()
        return float(one - (two - one) / k * (k - 1) / 2)

    return end(u), end(u[::-1])


def _basis(x: Floats, spans: int) -> tuple[NDArray[np.int64], Floats]:
    """Return the first index (n,) and the four values (4, n) of the uniform cubic B-splines at `x` [spans]."""
    k = np.clip(np.floor(x).astype(int), 0, spans - 1)
    f = x - k
    g = 1 - f
    return k, np.stack([g**3, 3 * f**3 - 6 * f**2 + 4, 3 * g**3 - 6 * g**2 + 4, f**3]) / 6


def smooth(x: Floats, p: Floats, weight: Floats, length: float, spans: int) -> BSpline:
    """Return the cubic spline that minimises sum w |r(x) - p|^2 + lambda int |r'''|^2, lambda by cross-validation."""
    k, b = _basis(x * spans / length, spans)
    n = spans + DEGREE
    normal = np.zeros((4, n))
    right = np.zeros((n, 3))
    for i in range(4):
        wb = weight * b[i]
        for d in range(3):
            right[:, d] += np.bincount(k + i, wb * p[:, d], n)
        for j in range(i + 1):
            normal[i - j] += np.bincount(k + j, wb * b[j], n)
    penalty = _penalty(n)
    control = _cross_validated(normal, right, float((weight * (p**2).sum(axis=1)).sum()), penalty, len(x))
    h = length / spans
    knots = h * np.arange(-DEGREE, spans + DEGREE + 1)
    return BSpline(knots, control, DEGREE)


def _penalty(n: int) -> Floats:
    """Return the lower band (4, n) of the squared third differences."""
    band = np.zeros((4, n))
    c = np.array([-1.0, 3.0, -3.0, 1.0])
    for i in range(4):
        for j in range(i + 1):
            band[i - j, j : j + n - 3] += c[i] * c[j]
    c = np.array([1.0, -2.0, 1.0]) * 1e-4
    for i in range(3):
        for j in range(i + 1):
            band[i - j, j : j + n - 2] += c[i] * c[j]
    return band


def _cross_validated(normal: Floats, right: Floats, square: float, penalty: Floats, count: int) -> Floats:
    """Solve (A + lambda P) c = b for the lambda of least generalised cross-validation score."""
    n = normal.shape[1]
    scale = normal[0].mean() / penalty[0].mean()
    strength = scale * 10.0 ** np.arange(-6.0, 12.5, 0.5)
    logdet = np.empty(len(strength))
    residual = np.empty(len(strength))
    for i, s in enumerate(strength):
        factor, c = _solve(normal + s * penalty, right)
        logdet[i] = 2 * np.log(factor[0]).sum()
        residual[i] = square - (c * (2 * right - _banded(normal, c))).sum()
    freedom = n - np.gradient(logdet, np.log(strength))
    score = np.maximum(residual, 1e-24 * square) / np.maximum(count - freedom, 1e-3) ** 2
    best = int(np.argmin(score))
    return _solve(normal + strength[best] * penalty, right)[1]


def _solve(band: Floats, right: Floats) -> tuple[Floats, Floats]:
    factor, _ = dpbtrf(band, lower=1)
    return factor, dpbtrs(factor, right, lower=1)[0]


def _banded(band: Floats, c: Floats) -> Floats:
    """Return the product of a symmetric lower-banded matrix with `c` (n, 3)."""
    y = band[0][:, None] * c
    for d in range(1, len(band)):
        y[d:] += band[d, :-d, None] * c[:-d]
        y[:-d] += band[d, :-d, None] * c[d:]
    return y


def arclength(spline: BSpline, start: float, end: float, steps: int) -> tuple[Floats, Floats]:
    """Return a grid of parameters (steps + 1,) and the arclength there, by Simpson's rule on each step [m]."""
    grid = np.linspace(start, end, 2 * steps + 1)
    speed = np.linalg.norm(spline(grid, 1), axis=1)
    part = (speed[:-1:2] + 4 * speed[1::2] + speed[2::2]) * (end - start) / (6 * steps)
    return grid[::2], np.concatenate([[0.0], np.cumsum(part)])


def unit_speed(spline: BSpline, start: float, end: float, spans: int) -> BSpline:
    """Return the piece of a curve between two parameters, in arclength from its start."""
    grid, s = arclength(spline, start, end, 4 * spans)
    u = np.linspace(0.0, s[-1], spans + 1)
    x = CubicHermiteSpline(s, grid, 1 / np.linalg.norm(spline(grid, 1), axis=1))(u)
    tangent = spline(x[[0, -1]], 1)
    tangent /= np.linalg.norm(tangent, axis=1)[:, None]
    return make_interp_spline(u, spline(x), k=DEGREE, bc_type=([(1, tangent[0])], [(1, tangent[1])]))
