"""Error estimates of forces over time, from the same motion marched on other grids."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_LEFT = 1.5  # the estimate, over the distance to a force on another grid: benchmarks.force_errors
_NEARBY = 12  # an error holds for one such part of the motion, since oscillating forces of two grids cross each other


class Series(NamedTuple):
    """Vectors over time.

    Attributes:
        times: (k,) [s].
        parts: the indices between each two events; an event ends one part and begins the next.
        values: (k, 3).
    """

    times: Floats
    parts: list[slice]
    values: Floats


def parts_of(lengths: Sequence[int]) -> list[slice]:
    """Return the slices of successive parts of these lengths."""
    ends = np.cumsum([0, *lengths])
    return [slice(int(end) - length, int(end)) for end, length in zip(ends[1:], lengths, strict=True)]


def at_times(t: Floats, times: Floats, values: Floats) -> Floats:
    """Return the vectors (k, 3) at times `t` (k,), linear between `values` (m, 3) at `times` (m,)."""
    return np.column_stack([np.interp(t, times, values[:, d]) for d in range(3)])


def apart(own: Series, other: Series) -> Floats | None:
    """Return the distances (k,) of vectors over time to others, compared part by part at the same times.

    None if a part has no counterpart: a least squares has fewer parts, because it passes through some events.
    """
    met = []
    for here in own.parts:
        begin, end = own.times[here][[0, -1]]
        beside = [there for there in other.parts if other.times[there][-1] > begin and other.times[there][0] < end]
        if not beside:
            return None
        there = slice(beside[0].start, beside[-1].stop)
        met.append(at_times(own.times[here], other.times[there], other.values[there]))
    return np.asarray(np.linalg.norm(own.values - np.concatenate(met), axis=1))


def errors(own: Series, others: Sequence[Series]) -> Floats | None:
    """Return the estimated errors (k,) of vectors over time, None if no other series has counterparts to all parts.

    It is _LEFT times the largest distance to another series within a _NEARBYth of the motion (docs/model.md, grids and
    error estimate).
    """
    known = [distance for other in others if (distance := apart(own, other)) is not None]
    return _LEFT * _largest_nearby(np.max(known, axis=0)) if known else None


def _largest_nearby(values: Floats) -> Floats:
    """Return for each of the values (k,), at about even times, the largest within half a _NEARBYth of all times."""
    from scipy.ndimage import maximum_filter1d  # takes longer to load than most motions take to solve

    return np.asarray(maximum_filter1d(values, size=2 * round(0.5 * len(values) / _NEARBY) + 1))
