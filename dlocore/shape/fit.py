"""Fit a unit-speed curve to ordered, noisy points: a penalised cubic B-spline in true arclength."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import BSpline, CubicHermiteSpline, make_interp_spline

from dlocore.errors import MILLIMETRES, SceneError
from dlocore.kernels.basis import GAUSS_4, gauss_points
from dlocore.scene.scene import FARTHEST
from dlocore.shape.smoothing import smooth, stiffness_of
from dlocore.spline import DEGREE

Floats = NDArray[np.float64]

MAX_LENGTH_MISMATCH = 0.10  # of the cable's length: with more, the shape is of another cable, or only part of this one
SAME = 1e-6  # of the length: points closer than this are one point given twice
MAX_GROUPS = 2000  # points are averaged down to about this many: a group is then a small part of a knot span
MAX_SPANS = 160  # knot spans: three for each radius of a cable that turns eight full loops
SPARSE = 40  # points: up to so many are far apart compared with their noise, so order and spacing are not in doubt
REFITS = 4  # of the parameter: a fifth was measured to move the curve by 1 % of the noise, by 7 % in 1 case of 100
NOISE = 0.002  # [m], or of a length above 1 m: larger deviations of few points from a smooth curve are shape
END_NOISE = 3.0  # an end point, and so the cable's end, lies within three standard deviations of the noise
MARGIN = 0.05  # of the length: how far the feet of noisy points may lie beyond the ends
SPEED_ERROR = 3e-4  # at quarter points; between them it is at most twice that, below the 1e-3 strain of a taut cable
SLOWEST = 1e-3  # of the chord's speed: a curve that is slower in its parameter has a cusp
STEPS, MIN_STEPS = 16, 512  # of the arclength, per knot span and least in all: its inverse is smooth to SPEED_ERROR
STEP_BACK = 0.04  # of the size of the curve: shorter steps may turn back because of noise
TURNED_BACK = -0.5  # cosine of two successive steps
MISSED = 0.01  # of the length: a fit with fewer spans may miss the points by this much more on average
MIN_SPANS = 8  # of a fit: enough for few points to show three bends
MIN_UNIT_SPANS, MAX_UNIT_SPANS = 64, 4096  # a curve that needs more is too sharp for a cable, and is fitted with fewer
OF_GIVEN = 2  # spans for each one of a spline that is refitted in its arclength: its other columns may turn in each
KEPT = 64  # cached fits, each at most some 100 kB


@dataclass(frozen=True, eq=False)
class PointFit:
    """A curve through noisy points.

    Attributes:
        curve: cubic spline in arclength on clamped knots, from 0 to its length [m].
        length_given: length between the first and the last point, before the ends were adjusted to the cable [m].
        at: arclength of each given point (n,) [m].
    """

    curve: BSpline
    length_given: float
    at: Floats


def fit_points(points: Floats, length: float) -> PointFit:
    """Fit a curve to ordered points along a whole cable.

    1. Take the length of the chords between the points as their first parameter. For dense points noise makes it many
       times too long, but evenly so. Averaging points before that was measured to change nothing.
    2. Minimise sum |r(s_i) - p_i|^2 + lambda int k |r'''|^2 ds (`smooth`), where s_i is the arclength of point i.
    3. Project the points on the curve, measure its true arclength there, and fit again, more softly where it bends.
    4. Noise leaves some doubt about where the first and the last point lie on the curve. Within that doubt the cable's
       length decides.

    Args:
        points: in order (n, 3) [m], relative to their middle.
        length: of the cable [m].

    Raises:
        SceneError: the curve differs in length from the cable by more than MAX_LENGTH_MISMATCH, fewer than three
            points are distinct, or the curve is so sharp that a curve which a cable can follow misses the points.
    """
    return _fit(np.asarray(points, dtype=np.float64).tobytes(), length)


def forget_fits() -> None:
    """Clear the cached fits, so that a prediction takes as long as the first one from its points."""
    _fit.cache_clear()
    _in_arclength.cache_clear()


def in_arclength(knots: Floats, columns: Floats) -> BSpline | None:
    """Return a cubic spline refitted in the arclength of its curve, or None if a cable cannot follow the curve.

    Args:
        knots: clamped, from 0 (n + 4,) [m].
        columns: control points (n, >= 3); the first three columns are the curve [m], relative to one of its points.
    """
    return _in_arclength(knots.tobytes(), columns.tobytes(), columns.shape[1])


@lru_cache(maxsize=KEPT)
def _in_arclength(knots: bytes, columns: bytes, count: int) -> BSpline | None:
    """Refit as `in_arclength` does. The last splines are cached."""
    spline = BSpline(np.frombuffer(knots), np.frombuffer(columns).reshape(-1, count), DEGREE)
    cuts = np.unique(spline.t)
    steps = max(STEPS, -(-MIN_STEPS // (len(cuts) - 1)))
    grid = np.append(np.linspace(cuts[:-1], cuts[1:], steps, endpoint=False, axis=1).ravel(), cuts[-1])
    u, width = gauss_points(np.pad(grid, DEGREE, mode="edge"), *GAUSS_4)
    lengths = (np.sqrt((spline(u, 1)[:, :3] ** 2).sum(axis=1)) * width).reshape(len(grid) - 1, -1).sum(axis=1)
    along = np.concatenate([[0.0], np.cumsum(lengths)])
    spans = min(max(MIN_UNIT_SPANS, OF_GIVEN * (len(cuts) - 1)), MAX_UNIT_SPANS)
    return _unit_speed(spline, (grid, along), 0.0, float(along[-1]), spans)


@lru_cache(maxsize=KEPT)
def _fit(coordinates: bytes, length: float) -> PointFit:
    """Fit as `fit_points` does. The last fits are cached, because planners predict many motions from one shape."""
    points = np.frombuffer(coordinates).reshape(-1, 3)
    distinct, which = _distinct(points, SAME * length)
    if len(distinct) < 3:
        raise SceneError("shape.points", f"{len(distinct)} distinct points", "at least 3 distinct points")
    share = _share(distinct)
    p, progress, weight = _averaged(distinct, share)
    noise = _noise(p) if len(p) > SPARSE else 0.0
    most_noise = max(NOISE * max(length, 1.0), 1.5 * noise)
    chords = way_along(p)
    spans, most_missed = 2 * int(np.clip(len(p), MIN_SPANS, MAX_SPANS)), np.inf
    while spans > MIN_SPANS:
        spans = max(spans // 2, MIN_SPANS)
        spline, x, s, measured = _smoothed(chords, p, weight, spans, noise, most_noise)
        first, last = _ends(s, noise)
        given = last - first
        missed = float(np.sqrt(((p - spline(x)) ** 2).sum(axis=1).mean()))
        most_missed = min(most_missed, missed + MISSED * length)
        if not _is_about(given, length) and _is_about(chords[-1], length):
            continue  # the spline makes a loop at a corner that the points do not show
        if not _is_about(given, length):
            break
        doubt = 2 * END_NOISE * missed
        extra = float(np.clip(length - given, -doubt, doubt))
        start, end = first - extra / 2, last + extra / 2
        curve = _unit_speed(spline, measured, start, end) if missed <= most_missed else None
        if curve is not None:
            at = np.clip(np.interp(share, progress, s) - start, 0.0, end - start)
            return PointFit(curve=curve, length_given=given, at=at[which])
    back = _turns_back(points)
    if back is None:
        check_length("shape.points", "points along the whole cable", given, length)
    raise _doubled_back(back)


def _smoothed(
    s: Floats, p: Floats, weight: Floats, spans: int, noise: float, most_noise: float
) -> tuple[BSpline, Floats, Floats, tuple[Floats, Floats]]:
    """Return a smooth spline through the points, starting from a guess `s` of their arclengths.

    Returns:
        The spline, the parameters of the points on it (n,), their arclengths (n,) [m], and its `_arclength`.
    """
    stiffness = np.ones(spans)
    for _ in range(REFITS):
        first, last = _ends(s, noise)
        x, span = s - first, max(last - first, np.ptp(s) / 2)
        if not span > 0:
            raise _doubled_back(_turns_back(p))
        spline = smooth(x, p, weight, span, spans, most_noise, stiffness)
        stiffness = stiffness_of(spline)
        if len(p) > SPARSE:
            x = np.clip(_foot(spline, x, p), -MARGIN * span, (1 + MARGIN) * span)
        measured = _arclength(spline)
        s = np.interp(x, *measured)
    return spline, x, s, measured


def _turns_back(points: Floats) -> int | None:
    """Return the index of the first point (n, 3) at which their path doubles back by more than noise, or None.

    It doubles back where two successive steps, both long compared with the size of the curve, turn by more than a
    cable can follow.
    """
    kept = np.flatnonzero(np.concatenate([[True], np.any(np.diff(points, axis=0) != 0.0, axis=1)]))
    steps = np.diff(points[kept], axis=0)
    lengths = np.sqrt((steps**2).sum(axis=1))
    long = lengths > STEP_BACK * np.sqrt((np.ptp(points, axis=0) ** 2).sum())
    cosines = (steps[:-1] * steps[1:]).sum(axis=1) / (lengths[:-1] * lengths[1:])
    back = np.flatnonzero(long[:-1] & long[1:] & (cosines < TURNED_BACK))
    return int(kept[back[0] + 1]) if len(back) else None


def _doubled_back(at: int | None) -> SceneError:
    """Return the error for points that double back at the point `at`, or, with None, bend too sharply somewhere."""
    allowed = (
        "points in order along a curve that a cable can follow, without outliers; dlocore.shape.cloud.fit_cloud, or "
        "POST /v1/shapes:fit, fits points without order (ordered false) or with outliers"
    )
    where = "" if at is None else f" at points[{at}]"
    return SceneError("shape.points", f"points that double back on themselves{where}", allowed)


def check_length(name: str, allowed: str, given: float, length: float, field: str = "cable.length") -> None:
    """Raise SceneError on `name` unless a curve `given` [m] long fits a cable of `length` [m], the value of `field`."""
    if not _is_about(given, length):
        reason = f"The cable is {length:.4g} m long; the two may differ by {MAX_LENGTH_MISMATCH:.0%}"
        if given > FARTHEST * length:
            reason = f"{MILLIMETRES}. {reason}"
        raise SceneError(name, f"a curve {given:.4g} m long", f"{allowed}, or another {field}", reason)


def _is_about(given: float, length: float) -> bool:
    return abs(given - length) <= MAX_LENGTH_MISMATCH * length


def _distinct(p: Floats, distance: float) -> tuple[Floats, NDArray[np.intp]]:
    """Return the points without repetitions of their predecessors (m, 3), and for each point its index in these.

    A repeated point is not a second measurement: counted as one it would look like a point without noise.
    """
    new = np.concatenate([[True], (np.diff(p, axis=0) ** 2).sum(axis=1) > distance**2])
    return p[new], np.cumsum(new) - 1


def _share(p: Floats) -> Floats:
    """Return the progress along the points (n,), from 0 to 1: the mean of that by number and that by chord length."""
    chord = way_along(p)
    return 0.5 * (np.arange(len(p)) / (len(p) - 1) + chord / chord[-1])


def way_along(p: Floats) -> Floats:
    """Return the length of the chords from the first of the points (n, 3) up to each of them (n,) [m]."""
    return np.concatenate([[0.0], np.cumsum(np.sqrt((np.diff(p, axis=0) ** 2).sum(axis=1)))])


def _averaged(p: Floats, share: Floats) -> tuple[Floats, Floats, Floats]:
    """Return averages of consecutive points over equal parts of their progress: points, progress and number in each."""
    if len(p) <= MAX_GROUPS:
        return p, share, np.ones(len(p))
    # An irrational number of parts, symmetric about the middle: no regular spacing puts points on the boundaries, where
    # rounding would decide, and reversed points fall into the same groups.
    part = np.rint((share - 0.5) * (MAX_GROUPS - 0.38196601125))
    start = np.flatnonzero(np.diff(part, prepend=np.nan) != 0)
    number = np.diff(start, append=len(p)).astype(float)
    return np.add.reduceat(p, start) / number[:, None], np.add.reduceat(share, start) / number, number


def _noise(p: Floats) -> float:
    """Return a robust estimate of the noise of a coordinate [m], from points against the chord of their neighbours."""
    before, after = np.diff(p, axis=0)[:-1], np.diff(p, axis=0)[1:]
    a, b = np.sqrt((before**2).sum(axis=1)), np.sqrt((after**2).sum(axis=1))
    left = a / np.maximum(a + b, 1e-300)
    offset = (1 - left)[:, None] * before - left[:, None] * after
    square = (offset**2).sum(axis=1) / (1 + left**2 + (1 - left) ** 2)
    return float(np.sqrt(np.median(square) / 1.39))  # the median of chi^2 with two degrees of freedom is 1.39


def _foot(spline: BSpline, x: Floats, p: Floats) -> Floats:
    """Return parameters moved towards the feet of the points on the curve, by one Newton step along the tangent."""
    tangent = spline(x, 1)
    return x + ((p - spline(x)) * tangent).sum(axis=1) / np.maximum((tangent**2).sum(axis=1), SLOWEST**2)


def _ends(s: Floats, noise: float) -> tuple[float, float]:
    """Return the arclength of the first and the last point, free of their noise [m].

    A foot is as uncertain as its point. If points are dense, a line through the first few gives the place of the first
    one. Only those within four standard deviations of it are used, because their spacing is uncertain too.
    """

    def end(v: Floats) -> float:
        k = int(np.clip((np.abs(v - v[0]) < 4 * noise).sum(), 1, max(len(v) // 8, 1)))
        one, two = v[:k].mean(), v[k : 2 * k].mean()
        return float(one - (two - one) * (k - 1) / (2 * k))

    return end(s), end(s[::-1])


def _arclength(spline: BSpline) -> tuple[Floats, Floats]:
    """Return a grid of parameters with margins and the arclength there [m], 0 at parameter 0, by Simpson's rule."""
    span, steps = spline.t[-DEGREE - 1], max(STEPS * (len(spline.c) - DEGREE), MIN_STEPS)
    fine = np.linspace(-MARGIN * span, (1 + MARGIN) * span, 2 * steps + 1)
    speed = np.sqrt((spline(fine, 1) ** 2).sum(axis=1))
    part = (speed[:-1:2] + 4 * speed[1::2] + speed[2::2]) * (fine[2] - fine[0]) / 6
    grid, s = fine[::2], np.concatenate([[0.0], np.cumsum(part)])
    return grid, s - np.interp(0.0, grid, s)


def _unit_speed(
    spline: BSpline, measured: tuple[Floats, Floats], start: float, end: float, spans: int = MIN_UNIT_SPANS
) -> BSpline | None:
    """Return the piece of a curve, `measured` by `_arclength`, between two arclengths [m] as a spline in arclength.

    Further columns stay with the places of the curve. It begins with `spans` spans, which are halved until
    | |r'| - 1 | <= SPEED_ERROR. None if the curve has a cusp or is too sharp for MAX_UNIT_SPANS.
    """
    grid, along = measured
    speed = np.sqrt((spline(grid, 1)[:, :3] ** 2).sum(axis=1))
    if not speed.min() > SLOWEST:
        return None
    parameter = CubicHermiteSpline(along, grid, 1 / speed)
    while spans <= MAX_UNIT_SPANS:
        s = np.linspace(start, end, spans + 1)
        x = parameter(s)
        first, last = (t / np.linalg.norm(t[:3]) for t in spline(x[[0, -1]], 1))
        ends: Any = ([(1, first)], [(1, last)])
        curve = make_interp_spline(s - start, spline(x), k=DEGREE, bc_type=ends)
        between = (s[:-1, None] + (end - start) / spans * np.array([0.25, 0.5, 0.75])).ravel() - start
        if np.abs(np.sqrt((curve(between, 1)[:, :3] ** 2).sum(axis=1)) - 1).max() <= SPEED_ERROR:
            return curve
        spans *= 2
    return None
