"""Smooth paths of held markers: without outliers, as smooth as their noise suggests."""

from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from dlocore.errors import SceneError
from dlocore.recordings import Recording
from dlocore.shape.smoothing import smooth
from dlocore.spline import through_others

Floats = NDArray[np.float64]

_JUMP = 6.0  # robust deviations beyond which a sample of a held marker is an outlier
_FLOOR = 5e-4  # [m] below which no sample is an outlier
_PASSES = 20  # of the search for outliers
_AWAY = 4.0  # robust deviations from the smooth path, beyond which a sample is an outlier, if a small one
_MOST = 1.3  # times the noise that neighbouring samples indicate
_CROWD = 7  # samples, of which most are no outliers
_LEAST = 8  # samples
_SPANS = 0.7  # of the path's spline for each sample at most
_KNOT = 0.02  # [s] between its knots at least


def held_paths(recording: Recording, shake: np.random.Generator | None) -> dict[int, CubicSpline]:
    """Return smooth paths of the held markers: without outliers, as smooth as their noise suggests."""
    times = cast(Floats, recording.times)
    wanted = {h.marker for h in recording.holds} | {h.towards for h in recording.holds if h.towards is not None}
    out = {}
    for marker in wanted:
        x = cast(Floats, recording.markers)[:, marker]
        keep = np.isfinite(x[:, 0])
        t, x = times[keep], x[keep]
        t, x = _without_outliers(t, x)
        path = _smoothed(t, x, times)
        if shake is not None:
            noise = 1.4826 * float(np.median(np.abs(x - path(t))))
            path = _smoothed(t, path(t) + noise * shake.standard_normal(x.shape), times)
        out[marker] = path
    return out


def varying(x: Floats) -> NDArray[np.bool_]:
    """Tell which coordinates of positions (..., 3) [m] ever change; NaN if a marker was lost."""
    flat = x.reshape(-1, x.shape[-1])
    return np.asarray(np.nanmax(flat, axis=0) > np.nanmin(flat, axis=0))


def noise_of(x: Floats) -> float:
    """Return the standard deviation of the noise of consecutive samples x (k, 3) [m], or more; infinite for three.

    It is found from third differences, to which a well sampled path adds little. Coordinates that never change, such as
    z of 2D markers, are ignored.
    """
    if len(x) < 4:
        return np.inf
    away = np.abs(np.diff(x[:, varying(x)], n=3, axis=0))
    return 1.4826 * float(np.median(away)) / np.sqrt(20.0) if away.size else 0.0


def noise_of_free(recording: Recording) -> Floats:
    """Return the standard deviation (3,) of the noise of the markers that nothing holds [m], the median over them."""
    markers = cast(Floats, recording.markers)[:, recording.free]
    seen = [x[np.isfinite(x[:, 0])] for x in markers.swapaxes(0, 1)]
    found = [[noise_of(x[:, [axis]]) for axis in range(3)] for x in seen if len(x)]
    return np.asarray(np.median(found, axis=0)) if found else np.full(3, np.inf)


def _without_outliers(t: Floats, x: Floats) -> tuple[Floats, Floats]:
    """Return the samples without those that leave the cubic through their four neighbours, the worst ones first."""
    for _ in range(_PASSES):
        if len(t) < _LEAST:
            break
        away = _leaps(t, x)
        limit = max(_JUMP * 1.4826 * float(np.median(away)), _FLOOR)
        around = np.concatenate([[0.0, 0.0], away, [0.0, 0.0]])
        worst = np.max([around[i : i + len(away)] for i in range(5)], axis=0)
        out = (away > limit) & (away >= worst)
        if not out.any():
            break
        t, x = t[~out], x[~out]
    return t, x


def _leaps(t: Floats, x: Floats) -> Floats:
    """Return the distance (k,) of samples from the cubic through four neighbours, at the ends through the nearest."""
    around = np.clip(np.arange(len(t)), 2, len(t) - 3)[:, None] + np.array([-2, -1, 0, 1, 2])
    own = np.arange(len(t))[:, None]
    others = around[around != own].reshape(len(t), 4)
    return np.asarray(np.linalg.norm(x - through_others(t, x, own[:, 0], others), axis=1))


def _smoothed(t: Floats, x: Floats, times: Floats) -> CubicSpline:
    """Return the spline through `times` of samples x (k, 3) whose smoothness has the largest likelihood.

    Samples far from it are left out, and it is made again. It continues straight before the first sample and after the
    last one that is kept.

    Raises:
        SceneError: too few samples are left.
    """
    keep = np.ones(len(t), dtype=bool)
    middle = x.mean(axis=0)
    most = _MOST * noise_of(x)  # otherwise the path could be all noise
    for _ in range(_PASSES):
        if keep.sum() < _LEAST:
            raise SceneError(
                "markers", f"{keep.sum()} samples of a held marker", f"at least {_LEAST} that are not outliers"
            )
        first, last = t[keep][0], t[keep][-1]
        spans = max(round(min(_SPANS * keep.sum(), (last - first) / _KNOT)), _LEAST)
        path = smooth(t[keep] - first, x[keep] - middle, np.ones(keep.sum()), last - first, spans, most)
        away = x - middle - path(np.clip(t, first, last) - first)
        limit = max(_AWAY * 1.4826 * float(np.median(np.abs(away[keep]))), _FLOOR)
        near = np.linalg.norm(away, axis=1) <= limit
        near |= np.convolve(~near, np.ones(_CROWD), "same") > 0.5 * _CROWD  # so many at once: the path is too smooth
        if (near == keep).all():
            break
        keep = near
    inside = np.clip(times, first, last)
    slope = path.derivative()(inside - first)
    return CubicSpline(times, middle + path(inside - first) + (times - inside)[:, None] * slope)
