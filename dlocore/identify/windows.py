"""Windows of recordings that are replayed, each from its own start, where the markers show how the cable is moved."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import cast

import numpy as np
from numpy.typing import NDArray

from dlocore.errors import SceneError, within
from dlocore.recordings import LEAST_FRAMES, LEAST_SEEN, Recording, apart_in_words

Floats = NDArray[np.float64]

LONGEST_GAP = 0.15  # [s] over which the path of a gripper is bridged while its marker is lost
_FEW = 4  # or this many frames, if they are far apart
_SHORTEST = 0.5  # [s] between two gaps, for that part to be replayed
_LEAST_BEGUN = 3  # markers seen, from which a start can be found
_NAMED = 3  # gaps that the message names one by one


@dataclass(frozen=True)
class Gap:
    """A time during which a held marker was lost so long that nothing shows how its gripper moved.

    Attributes:
        marker: that was lost.
        first, last: frames; none, with `first` the one after, if the frames themselves are missing.
        begin, end: when it was last seen before and first seen after [s], or where the recording begins or ends.
    """

    marker: int
    first: int
    last: int
    begin: float
    end: float


def gaps(recording: Recording) -> tuple[Gap, ...]:
    """Return where held markers of a motion are lost for too long."""
    if recording.static:
        return ()
    times, markers = cast(Floats, recording.times), cast(Floats, recording.markers)
    longest = max(LONGEST_GAP, _FEW * float(np.median(np.diff(times))))
    found = []
    for marker in recording.held:
        seen = np.flatnonzero(np.isfinite(markers[:, marker, 0]))
        for before, after in pairwise([-1, *seen, len(times)]):
            begin, end = times[max(before, 0)], times[min(after, len(times) - 1)]
            if end - begin > longest:
                found.append(Gap(marker, int(before) + 1, int(after) - 1, float(begin), float(end)))
    return tuple(found)


def gaps_told(recordings: Sequence[Recording]) -> list[str]:
    """Return a message on where held markers are lost for too long."""
    found = [(recording.name, gap) for recording in recordings for gap in gaps(recording)]
    if not found:
        return []
    named = [
        f"held marker {gap.marker} of {name!r} from {gap.begin:.4g} to {gap.end:.4g} s" for name, gap in found[:_NAMED]
    ]
    more = [f"and {len(found) - _NAMED} more"] if len(found) > _NAMED else []
    return [f"Lost for too long, so the parts before and after are replayed separately: {', '.join([*named, *more])}."]


def cut(recordings: Sequence[Recording], window: float) -> list[Recording]:
    """Return the recordings in windows of about `window` seconds, without gaps where held markers are lost too long.

    Raises:
        SceneError: a window has too few frames, or nothing is left of a recording.
    """
    out = []
    for recording in recordings:
        with within(recording.place):
            for piece in _pieces(recording):
                parts = 1 if piece.static else max(1, round(piece.duration / window))
                width = piece.duration / parts
                out += [piece] if parts == 1 else [piece.part(i * width, (i + 1) * width) for i in range(parts)]
    return out


def _pieces(recording: Recording) -> list[Recording]:
    """Return the parts of a recording between its gaps, from the first frame on in which enough markers are seen."""
    if recording.static:
        return [recording]
    times, seen = cast(Floats, recording.times), np.isfinite(cast(Floats, recording.markers)[..., 0])
    lost = np.zeros(len(times), dtype=bool)
    lost[: int(np.argmax(seen.sum(axis=1) >= _LEAST_BEGUN))] = True
    apart = np.zeros(len(times), dtype=bool)  # from the frame before
    for gap in gaps(recording):
        lost[gap.first : gap.last + 1] = True
        apart[min(gap.first, len(times) - 1)] = True
    if not (lost.any() or apart.any()):
        return [recording]
    kept = np.flatnonzero(~lost)
    runs = np.split(kept, 1 + np.flatnonzero((np.diff(kept) > 1) | apart[kept[1:]]))
    whole = [
        recording.part(float(times[run[0]] - times[0]), float(times[run[-1]] - times[0]))
        for run in runs
        if len(run) >= LEAST_FRAMES
        and times[run[-1]] - times[run[0]] >= _SHORTEST
        and (seen[run].mean(axis=0) >= LEAST_SEEN).all()
    ]
    if not whole:
        given = "held markers that are lost again and again"
        allowed = f"every held marker seen for {_SHORTEST:g} s at least, without a gap of {LONGEST_GAP:g} s"
        raise SceneError("markers", given, allowed, apart_in_words(times) if apart.any() and not lost.any() else "")
    return whole
