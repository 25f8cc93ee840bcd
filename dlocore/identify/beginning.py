"""The first frames of a recording: where its markers are, how fast they move, and whether they are at rest."""

import warnings
from typing import cast

import numpy as np
from numpy.typing import NDArray

from dlocore.errors import SceneError
from dlocore.recordings import Recording

Floats = NDArray[np.float64]

_REWEIGHTED = 12  # times, at most, that the weights of outliers are reduced
_SETTLED = 1e-3  # largest change of a weight
_STILL = 0.01  # [m/s]: a marker slower than this, or than its noise can show, is at rest


def rests(recording: Recording, frames: int) -> bool:
    """Tell whether no marker moves in the first frames, within its noise."""
    times, markers = cast(Floats, recording.times)[:frames], cast(Floats, recording.markers)[:frames]
    half = frames // 2
    between = float(times[half:].mean() - times[:half].mean())
    with np.errstate(all="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of a marker that was not seen
        moved = np.nanmedian(markers[half:], axis=0) - np.nanmedian(markers[:half], axis=0)
        noise = 1.4826 * np.nanmedian(np.abs(np.diff(markers, axis=0)), axis=(0, 2)) / np.sqrt(2.0)
    speed = np.linalg.norm(moved, axis=1) / between
    allowed = np.maximum(_STILL, 1.25 * np.sqrt(3.0) * np.sqrt(4.0 / frames) * noise / between * 2.0)
    known = np.isfinite(speed)
    return bool((speed[known] <= allowed[known]).all())


def start_markers(
    recording: Recording, frames: int, at: float, shake: np.random.Generator | None
) -> tuple[NDArray[np.int64], Floats, Floats]:
    """Return the markers seen in the first frames, their positions at time `at` and their velocities.

    Two or three frames are fitted by a straight line, more by a parabola, with reduced weight for outliers.

    Raises:
        SceneError: fewer than three markers are seen.
    """
    times, markers = cast(Floats, recording.times)[:frames], cast(Floats, recording.markers)[:frames]
    order = 1 if frames < 6 else 2
    finite = np.isfinite(markers[..., 0])
    seen = np.flatnonzero(finite.sum(axis=0) > order)
    if len(seen) < 3:
        raise SceneError("markers", f"{len(seen)} markers seen at the beginning", "at least 3")
    keep = finite[:, seen].T
    count = keep.sum(axis=1)
    x = np.where(keep[..., None], markers[:, seen].swapaxes(0, 1), 0.0)
    unit = float(np.abs(times - at).max())
    A = np.vander((times - at) / unit, order + 1, increasing=True)

    def fitted(w: Floats, x: Floats) -> Floats:
        """Return the coefficients (m, order + 1, 3) of a least squares fit with the weights w (m, frames)."""
        weighted = A.T * w[:, None, :]
        return np.asarray(np.linalg.solve(weighted @ A, weighted @ x))

    w = keep.astype(float)
    for _ in range(1 if frames < 6 else _REWEIGHTED):
        c = fitted(w * w, x)
        away = np.where(keep, np.linalg.norm(x - A @ c, axis=2), np.inf)
        ordered = np.sort(away, axis=1)
        row = np.arange(len(seen))
        scale = np.maximum(1.4826 * 0.5 * (ordered[row, (count - 1) // 2] + ordered[row, count // 2]), 1e-5)
        before, w = w, 1.0 / (1.0 + (away / (2.0 * scale[:, None])) ** 2)
        if np.abs(w - before).max() < _SETTLED:
            break
    if shake is not None:
        spare = np.maximum((w * w).sum(axis=1) - (order + 1), 1.0)
        square = ((w[..., None] * (x - A @ c)) ** 2).sum(axis=(1, 2))
        noise = np.where(count > order + 1, np.sqrt(square / (3.0 * spare)), 0.0)
        drawn = noise[:, None, None] * shake.standard_normal(x.shape)
        c = c + fitted(keep.astype(float), drawn)
    return seen, c[:, 0], c[:, 1] / unit
