"""Windows of recordings: none bridges what a held marker that was lost for long does not tell."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from benchmarks.simulated_recordings import CABLE, DRAG, simulated
from dlocore import SceneError
from dlocore.identify import Resolution, identify
from dlocore.identify.online import Identifier
from dlocore.identify.windows import cut, gaps, gaps_told
from dlocore.recordings import Recording

RATE = 100.0  # [Hz]


def hanging(frames: int = 500, rate: float = RATE, **facts: Any) -> Recording:
    """Return a recording of a cable that hangs still from its first marker."""
    markers = np.zeros((frames, 6, 3))
    markers[:, :, 2] = -0.1 * np.arange(6)
    given: dict[str, Any] = {"held": (0,), "linear_density": 0.05, "name": "still"} | facts
    return Recording(times=np.arange(frames) / rate, markers=markers, **given)


def lost(recording: Recording, first: int, last: int, marker: int | slice = 0) -> Recording:
    """Return a recording in which a marker, or several, were lost from one frame to another."""
    markers = np.array(recording.markers)
    markers[first : last + 1, marker] = np.nan
    return replace(recording, markers=markers)


def spans(*recordings: Recording) -> list[tuple[float, float]]:
    """Return beginning and end [s] of the windows."""
    return [(float(np.asarray(w.times)[0]), float(np.asarray(w.times)[-1])) for w in cut(recordings, 5.0)]


def test_windows_end_where_a_held_marker_is_lost_for_long() -> None:
    assert spans(lost(hanging(), 150, 249)) == [(0.0, 1.49), (2.5, 4.99)]
    (gap,) = gaps(lost(hanging(), 150, 249))
    assert (gap.marker, gap.begin, gap.end) == (0, 1.49, 2.5)


def test_windows_end_where_frames_are_missing_for_long() -> None:
    whole = hanging()
    kept = np.r_[0:150, 250:500]
    dropped = replace(whole, times=np.asarray(whole.times)[kept], markers=np.asarray(whole.markers)[kept])
    assert spans(dropped) == [(0.0, 1.49), (2.5, 4.99)]
    (gap,) = gaps(dropped)
    assert (gap.marker, gap.begin, gap.end) == (0, 1.49, 2.5)
    assert "held marker 0 of 'still' from 1.49 to 2.5 s" in gaps_told([dropped])[0]


def test_short_gaps_and_free_markers_cut_nothing() -> None:
    assert spans(lost(hanging(), 150, 160)) == [(0.0, 4.99)]
    assert spans(lost(hanging(), 150, 249, slice(1, None))) == [(0.0, 4.99)]
    slow = hanging(100, rate=10.0)
    assert spans(lost(slow, 20, 21)) == [(0.0, 4.9), (5.0, 9.9)]  # two frames, a fifth of a second
    assert spans(lost(slow, 20, 25))[0] == (0.0, 1.9)


def test_a_recording_begins_where_its_markers_are_seen() -> None:
    assert spans(lost(hanging(), 0, 29)) == [(0.3, 4.99)]
    assert spans(lost(hanging(), 0, 4, slice(None))) == [(0.05, 4.99)]
    assert spans(lost(hanging(), 470, 499)) == [(0.0, 4.69)]


def test_what_is_too_short_between_two_gaps_is_left_out() -> None:
    assert spans(lost(lost(hanging(), 100, 149), 180, 229)) == [(0.0, 0.99), (2.3, 4.99)]
    # a free marker that is not seen there at all tells nothing of where it lies
    assert spans(lost(lost(hanging(), 150, 249), 0, 149, 3)) == [(2.5, 4.99)]
    whole = hanging()
    for first in range(0, 480, 40):
        whole = lost(whole, first, first + 19)
    with pytest.raises(SceneError, match=r"^recordings\['still'\]\.markers: got held markers that are lost again"):
        cut([whole], 5.0)


def test_shapes_at_rest_have_no_gaps() -> None:
    assert not gaps(lost(hanging(static=True), 150, 249))


def test_gaps_are_told_of() -> None:
    gap = lost(hanging(160), 60, 99)
    (said,) = gaps_told([gap])
    assert said.endswith("are replayed separately: held marker 0 of 'still' from 0.59 to 1 s.")
    assert said in identify([gap], names=("drag",), resolution=Resolution(n_u=9), iterations=1).message
    several = hanging()
    for first in (70, 170, 270, 370, 450):
        several = lost(several, first, first + 19)
    assert gaps_told([several])[0].endswith(" from 2.69 to 2.9 s, and 2 more.")


def test_no_estimate_is_improved_by_a_gripper_that_was_not_seen() -> None:
    recording = simulated(8, 1.0, cable=CABLE, environment=DRAG)
    for gap in (False, True):
        identifier = Identifier(recording.u, recording.held, CABLE, DRAG)
        seen = lost(recording, 60, 100) if gap else recording
        for k in range(0, 170, 6):
            identifier.add(float(np.asarray(seen.times)[k]), np.asarray(seen.markers)[k])
        assert (identifier.update() is None) is gap
