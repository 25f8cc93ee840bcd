"""Fit a cable's curve to the points of a vision system: in order or not, 2D or 3D, noisy, with outliers."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import BSpline
from scipy.spatial import cKDTree

from dlocore.errors import SceneError, calculable, points_array
from dlocore.scene.scene import Points
from dlocore.shape.fit import MAX_SPANS, NOISE, check_length, fit_points, way_along
from dlocore.shape.ordering import Indices, Order, cutoff, order_points, without_spikes
from dlocore.shape.shape import StartCurve, start_curve
from dlocore.shape.smoothing import smooth
from dlocore.spline import DEGREE

Floats = NDArray[np.float64]

LEAST = 4  # points
MOST = 20_000  # points of an unordered cloud: ordering them takes 0.3 s
GROUPS = 250  # to which a cloud is averaged: about as many points as a cable has places to bend
REFITS = 3  # each without the outliers of the one before


@dataclass(frozen=True, eq=False)
class CloudFit:
    """A curve through the points of a cable.

    Attributes:
        curve: cubic spline in arclength with its fit errors [m].
        measured_length: length of the curve before it was scaled to the cable [m].
        order: indices of the points along the cable (m,).
        outliers: indices of the points that do not belong to it, rising.
    """

    curve: StartCurve
    measured_length: float
    order: Indices
    outliers: Indices


def fit_cloud(
    points: ArrayLike,
    *,
    ordered: bool = True,
    length: float | None = None,
    start: Floats | None = None,
    remove_outliers: bool = True,
) -> CloudFit:
    """Fit a unit-speed cubic spline to the points of a cable.

    Args:
        points: (n, 2 or 3) [m].
        ordered: whether they are in order along the cable.
        length: of the cable [m]; None: the measured one.
        start: a point near the cable's end at u = 0 (3,) [m], for unordered points.
        remove_outliers: whether to leave out points that do not belong to the cable.

    Raises:
        SceneError: the points are too few or too many, do not show a single curve, or show one whose length differs
            from the cable's.
    """
    p = points_array("points", points)
    allowed, reason = "points along one smooth curve", "No curve can be fitted to them"
    with calculable("points", f"{len(p)} points", allowed, reason):
        return _fitted(p, ordered, length, start, remove_outliers)


def _fitted(p: Floats, ordered: bool, length: float | None, start: Floats | None, remove_outliers: bool) -> CloudFit:
    count = len(p)
    if ordered:
        found = without_spikes(p) if remove_outliers else Order(np.arange(count), np.arange(0))
    else:
        if count > MOST:
            raise SceneError("points", f"{count} points", f"at most {MOST}, unless they are in order")
        found = order_points(p, start)
    kept = found.order
    for _ in range(REFITS):
        if len(kept) < LEAST:
            raise SceneError("points", f"{len(kept)} points along the cable", f"at least {LEAST}")
        seen = p[kept] if ordered else _averaged(p[kept])
        no_curve = _no_curve(len(kept), count)
        try:
            measured = _measured(seen)
        except SceneError:  # it names a length and points that are not the caller's, as does that of the fit below
            raise no_curve from None
        try:
            curve = start_curve(Points(points=seen), measured if length is None else length)
        except SceneError:
            if length is not None:
                check_length("points", "points along the whole cable", measured, length, "length")
            raise no_curve from None
        off = _off(curve, p[kept])
        bad = off > cutoff(off, floor=NOISE)
        if not remove_outliers or not bad.any():
            break
        kept = kept[~bad]
    off = _off(curve, p[kept])
    curve = replace(curve, fit_rms=float(np.sqrt((off**2).mean())), fit_max=float(off.max()))
    return CloudFit(curve, measured, kept, np.setdiff1d(np.arange(count), kept))


def _no_curve(kept: int, count: int) -> SceneError:
    """Return the error for `count` points of which the `kept` ones can't be fitted."""
    given = f"{count} points" if kept == count else f"{count} points, of which {count - kept} would be left out"
    allowed = "points along one smooth curve, in their order if need be, or more of them, without outliers"
    return SceneError("points", given, allowed, "They show no single curve")


def _averaged(p: Floats) -> Floats:
    """Average points, ordered along the cable, over groups; noise hides their order within a group."""
    if len(p) <= GROUPS:
        return p
    first = np.linspace(0, len(p), GROUPS + 1).astype(np.intp)
    mean = np.add.reduceat(p, first[:-1]) / np.diff(first)[:, None]
    mean[[0, -1]] = p[[0, -1]]
    return mean


def _measured(p: Floats) -> float:
    """Return the length of the curve that ordered points show [m].

    The chords between noisy points are too long. A smooth curve over them gives a first estimate of the length, and a
    fit in its arclength the final one.
    """
    middle = p - p.mean(axis=0)
    s = way_along(p)
    if not s[-1] > 0:
        raise SceneError("points", "points all in one place", "points along a curve")
    spans = int(np.clip(len(p), 8, MAX_SPANS))
    rough = smooth(s, middle, np.ones(len(p)), float(s[-1]), spans, np.inf, np.ones(spans))
    return fit_points(middle, _length(rough, float(s[-1]))).length_given


def _length(spline: BSpline, end: float) -> float:
    grid = np.linspace(0.0, end, 16 * (len(spline.c) - DEGREE) + 1)
    return float(np.sqrt((np.diff(spline(grid), axis=0) ** 2).sum(axis=1)).sum())


def _off(curve: StartCurve, p: Floats) -> Floats:
    """Return the distances of points from a curve (n,) [m]."""
    grid = curve(np.linspace(0.0, curve.knots[-1], 2000))
    return np.asarray(cKDTree(grid).query(p)[0])
