"""Identification while a cable moves."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.simulated_recordings import CABLE, DRAG, simulated
from dlocore import SceneError
from dlocore.identify.online import Identifier


@pytest.mark.parametrize("off", [0.0, 1e-9])  # some windows begin in a motion so unstable that rounding decides on it
def test_a_wrong_stiffness_is_corrected_while_frames_arrive(off: float) -> None:
    recording = simulated(8, 4.0, cable=CABLE, environment=DRAG)
    wrong = replace(CABLE, bending_stiffness=9e-3 * (1.0 + off))
    names = ("bending_stiffness", "bending_damping")
    identifier = Identifier(recording.u, recording.held, wrong, DRAG, names=names)
    updates = []
    for k in range(0, 400, 3):  # 33 frames a second
        identifier.add(float(np.asarray(recording.times)[k]), np.asarray(recording.markers)[k])
        if k % 12 == 0 and (update := identifier.update()) is not None:
            updates.append(update)
    first, last = updates[0], updates[-1]
    assert last.deviations["bending_stiffness"] < 0.5 * first.deviations["bending_stiffness"]
    # from three times too stiff to within a third: windows of 0.8 s whose start is as noisy as their markers
    assert identifier.cable.bending_stiffness == pytest.approx(3e-3, rel=0.35)


def test_what_is_masked_in_a_frame_was_not_seen() -> None:
    identifier = Identifier(np.linspace(0.0, 1.0, 5), (0,), CABLE)
    frame = np.ma.masked_array(np.zeros((5, 3)))
    frame[2] = np.ma.masked
    identifier.add(0.0, frame)
    assert np.isnan(identifier._markers[-1]).any(axis=1).tolist() == [False, False, True, False, False]


def test_frames_that_do_not_fit_are_refused() -> None:
    identifier = Identifier(np.linspace(0.0, 1.0, 5), (0,), CABLE)
    identifier.add(0.0, np.zeros((5, 3)))
    assert identifier.update() is None
    with pytest.raises(SceneError, match="time"):
        identifier.add(0.0, np.zeros((5, 3)))
    with pytest.raises(SceneError, match="markers"):
        identifier.add(0.1, np.zeros((4, 3)))
