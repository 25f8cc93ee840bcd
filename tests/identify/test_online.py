"""Identification while a cable moves."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from benchmarks.simulated_recordings import CABLE, DRAG, simulated
from dlocore import SceneError
from dlocore.identify.online import Identifier
from dlocore.identify.replay import Resolution


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
    assert identifier.skipped == "1 of the 24 frames of a window have arrived"
    with pytest.raises(SceneError, match="time"):
        identifier.add(0.0, np.zeros((5, 3)))
    with pytest.raises(SceneError, match="markers"):
        identifier.add(0.1, np.zeros((4, 3)))


@pytest.mark.parametrize(
    ("field", "time", "markers"),
    [
        ("time", np.nan, np.zeros((5, 3))),
        ("time", np.inf, np.zeros((5, 3))),
        ("time", "0.1", np.zeros((5, 3))),
        ("markers", 0.1, np.full((5, 3), np.inf)),
        ("markers", 0.1, np.full((5, 3), "0.1")),
        ("markers", 0.1, [[0.0, 0.0, 0.0], [0.1, 0.0]]),
    ],
)
def test_a_frame_of_what_is_no_number_is_refused_and_the_next_is_taken(field: str, time: Any, markers: Any) -> None:
    identifier = Identifier(np.linspace(0.0, 1.0, 5), (0,), CABLE)
    with pytest.raises(SceneError) as error:
        identifier.add(time, markers)
    assert error.value.field == field
    identifier.add(0.1, np.zeros((5, 3)))


@pytest.mark.parametrize(
    ("field", "given"),
    [
        ("rate", {"rate": 0}),
        ("rate", {"rate": np.nan}),
        ("window", {"window": np.nan}),
        ("window", {"window": -1}),
        ("window", {"window": "0.8"}),
        ("held[0]", {"held": (9,)}),
        ("held[1]", {"held": (0, 0.5)}),
        ("held", {"held": 0}),
        ("held", {"held": ()}),
        ("u", {"u": [0.0, 0.5, 0.4, 1.0]}),
        ("markers", {"u": [0.0, 1.0]}),
        ("length", {"u": [0.0, 0.5, 1.5]}),
        ("cable", {"cable": None}),
        ("cable.rest_shape", {"cable": replace(CABLE, rest_shape="initial")}),
        ("environment", {"environment": {}}),
        ("resolution", {"resolution": 9}),
        ("parameters", {"names": "drag"}),
        ("parameters[0]", {"names": (1,)}),
        ("parameters", {"names": ("clamp_angles",)}),
        ("held", {"names": ("turn",)}),
        ("held", {"names": ("marker_offsets",)}),
        ("parameters", {"names": ("marker_offsets[0][0]",), "held": (0, 1), "u": [0.0, 0.05, 0.5, 1.0]}),
    ],
)
def test_what_can_not_be_identified_with_is_refused_at_once(field: str, given: dict[str, Any]) -> None:
    asked: dict[str, Any] = {"u": np.linspace(0.0, 1.0, 5), "held": (0,), "cable": CABLE}
    with pytest.raises(SceneError) as error:
        Identifier(**(asked | given))
    assert error.value.field == field


def test_why_a_parameter_needs_a_clamp_is_said() -> None:
    with pytest.raises(SceneError, match=r"Without a clamp nothing shows .* which marker_offsets needs"):
        Identifier(np.linspace(0.0, 1.0, 5), (0,), CABLE, names=("marker_offsets",))


def test_offsets_of_markers_are_identified_while_frames_arrive() -> None:
    recording = simulated(8, 1.0, cable=CABLE, environment=DRAG)
    names = ("bending_stiffness", "marker_offsets[5][0]")
    identifier = Identifier(recording.u, recording.held, CABLE, DRAG, names=names)
    for k in range(0, 100, 3):
        identifier.add(float(np.asarray(recording.times)[k]), np.asarray(recording.markers)[k])
    update = identifier.update()
    assert update is not None
    assert abs(update.values["marker_offsets[5][0]"]) < 0.005  # the marker is on the cable


@pytest.mark.parametrize(
    ("marker", "begin", "why"),
    [
        (5, 0, "the window can't be replayed: markers[:, 5]: got seen in 0% of the frames"),
        (0, 60, "held marker 0 is lost for 0.21 s, up to 0.495 s"),
    ],
)
def test_a_marker_that_is_hardly_seen_shows_nothing_and_that_is_said(marker: int, begin: int, why: str) -> None:
    recording = simulated(8, 1.2, cable=CABLE, environment=DRAG)
    identifier = Identifier(recording.u, recording.held, CABLE, DRAG)
    for k in range(0, 100, 3):
        frame = np.array(recording.markers)[k]
        frame[marker] = np.nan if k >= begin else frame[marker]
        identifier.add(float(np.asarray(recording.times)[k]), frame)
    assert identifier.update() is None
    assert identifier.skipped.startswith(why)
    for k in range(100, 120):
        identifier.add(float(np.asarray(recording.times)[k]), np.asarray(recording.markers)[k])
    assert (identifier.update() is None) == bool(identifier.skipped)


@pytest.mark.parametrize(
    ("field", "value"),
    [("n_u", 4), ("n_u", 9.5), ("step", 0), ("step", -1), ("step", np.nan), ("start_frames", 0), ("start_frames", "6")],
)
def test_a_resolution_out_of_range_is_refused(field: str, value: Any) -> None:
    with pytest.raises(SceneError) as error:
        Resolution(**{field: value})
    assert error.value.field == field
