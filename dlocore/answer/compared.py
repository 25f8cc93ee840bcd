"""How far what is read from a motion may be off, as the same motion marched on other grids tells."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

_LEFT = 1.5  # times the distance to a force on another grid: benchmarks.force_errors
_NEARBY = 12  # an error holds for this part of the motion: forces of two grids that swing cross each other


class Series(NamedTuple):
    """Vectors over time.

    Attributes:
        times: (k,) [s].
        parts: where in them those between each two events are; an event ends one and begins the next.
        values: (k, 3).
    """

    times: Floats
    parts: list[slice]
    values: Floats


def parts_of(lengths: Sequence[int]) -> list[slice]:
    """Return where parts of these lengths, one after the other, are."""
    ends = np.cumsum([0, *lengths])
    return [slice(int(end) - length, int(end)) for end, length in zip(ends[1:], lengths, strict=True)]


def at_times(t: Floats, times: Floats, values: Floats) -> Floats:
    """Return vectors (m, 3) at times (m,), linear between, at the times `t` (k,); (k, 3)."""
    return np.column_stack([np.interp(t, times, values[:, d]) for d in range(3)])


def apart(own: Series, other: Series) -> Floats | None:
    """Return the distance (k,) of vectors over time to others, in each part to those of the same time.

    None where one of the parts has no other beside it: a least squares has fewer, as it goes through events.
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
    """Return the estimated errors (k,) of vectors over time, None where no other series is beside all of them.

    It is _LEFT times the largest distance to another series within a _NEARBYth of the motion (docs/model.md, grids and
    error estimate).
    """
    known = [distance for other in others if (distance := apart(own, other)) is not None]
    return _LEFT * _largest_nearby(np.max(known, axis=0)) if known else None


def _largest_nearby(values: Floats) -> Floats:
    """Return for each of the values (k,), at about even times, the largest within half a _NEARBYth of all times."""
    from scipy.ndimage import maximum_filter1d  # takes longer to load than most motions to solve

    return np.asarray(maximum_filter1d(values, size=2 * round(0.5 * len(values) / _NEARBY) + 1))
