"""The result of an identification as JSON and as a page."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from app.reports.identification import _figures, _view, _window_names, document_of_identification, report_of
from dlocore.identify import Fit, Identification, identify
from dlocore.recordings import Recording


def lying(**facts: Any) -> Recording:
    """Return a recording of a cable that hangs still along -y, from its first marker."""
    markers = np.zeros((40, 6, 2))
    markers[:, :, 1] = -0.1 * np.arange(6)
    given: dict[str, Any] = {"held": (0,), "linear_density": 0.05, "gravity": (0.0, -9.81, 0.0)} | facts
    return Recording(times=np.arange(40) * 0.02, markers=markers, **given)


@pytest.fixture(scope="module")
def found() -> Identification:
    return identify([lying()], names=("drag",))


def test_the_environment_has_the_gravity_of_the_recording(found: Identification) -> None:
    assert document_of_identification(found)["environment"]["gravity"] == [0.0, -9.81, 0.0]
    np.testing.assert_array_equal(np.asarray(found.environment.gravity), [0.0, -9.81, 0.0])


def fit(**changes: Any) -> Fit:
    """Return a fit, off by a millimetre, to a window of a cable along x that sags along -y."""
    x = np.linspace(0.0, 1.0, 6)
    measured = np.tile(np.column_stack([x, -x * (1.0 - x), 0.0 * x]), (20, 1, 1))
    predicted = measured + np.array([0.0, 1e-3, 0.0])
    given: dict[str, Any] = {
        "name": "shaken", "begin": 0.0, "end": 5.0, "static": False, "gravity": np.array([0.0, -9.81, 0.0]),
        "times": np.linspace(0.5, 5.0, 20), "measured": measured, "predicted": predicted, "free": np.arange(1, 6),
        "stalled": False,
    }  # fmt: skip
    return Fit(**(given | changes))


@pytest.mark.parametrize(
    ("gravity", "turned"),
    [
        ([0.0, -9.81, 0.0], np.eye(3)),
        ([0.0, 0.0, -9.81], np.eye(3)[[0, 2, 1]]),  # sags along -z
        ([-9.81, 0.0, 0.0], np.eye(3)[[2, 0, 1]]),  # along z, sags along -x
        ([0.0, 0.0, -9.81], np.eye(3)),  # lies on a table
        ([0.0, 0.0, 0.0], np.eye(3)),
    ],
)
def test_a_shape_is_seen_from_where_it_is_wide_with_up_upwards(gravity: list[float], turned: np.ndarray) -> None:
    points = np.asarray(fit().predicted[0]) @ turned.T
    points = points - points.mean(axis=0)
    right, up = _view(np.array(gravity), points)
    np.testing.assert_allclose(np.ptp(points @ right), 1.0, atol=1e-9)
    np.testing.assert_allclose(np.ptp(points @ up), 0.24, atol=1e-9)
    assert (points @ up)[0] > 0 > (points @ up)[2]


def test_a_straight_hanging_cable_is_seen_too() -> None:
    points = np.linspace(0.5, -0.5, 5)[:, None] * np.array([1.0, 0.0, 0.0])
    right, up = _view(np.array([-9.81, 0.0, 0.0]), points)
    np.testing.assert_allclose(up, [1.0, 0.0, 0.0])
    np.testing.assert_allclose([right @ up, np.linalg.norm(right)], [0.0, 1.0], atol=1e-9)


def test_what_was_lost_breaks_the_curve_of_the_error() -> None:
    whole, lost = fit(), fit()
    lost.measured[8:12] = np.nan
    assert _figures("shaken", whole).count('stroke-width="1.5"') == 1
    assert _figures("shaken", lost).count('stroke-width="1.5"') == 2
    points = " ".join(line.split('"')[1] for line in _figures("shaken", lost).split("<polyline ")[1:3]).split()
    assert len(points) == 16  # of 20 frames


def test_windows_of_one_recording_are_told_apart_by_their_times() -> None:
    assert _window_names([fit(), fit(begin=5.0, end=9.5)]) == ["shaken, 0 to 5 s", "shaken, 5 to 9.5 s"]
    assert _window_names([fit(), fit(name="other")]) == ["shaken", "other"]


def test_the_windows_of_a_search_know_their_times() -> None:
    found = identify([lying()], names=("drag",), window=0.4)
    assert [(f.begin, f.end) for f in found.fits] == [(0.0, 0.38), (0.4, 0.78)]
    assert "recording, 0.4 to 0.78 s" in report_of(found, "lying")
    assert "1 iteration in" in report_of(found, "lying")


def test_shapes_at_rest_are_numbered() -> None:
    shapes = fit(static=True, times=np.arange(20.0))
    shapes.measured[3, 2:] += 0.05
    assert "worst shape" in _figures("rest", shapes)
    assert "worst shape, shape 4 of 20, with a median distance of " in _figures("rest", shapes)
    assert "over time" not in _figures("rest", shapes)


def test_what_was_sought_is_in_the_document(found: Identification) -> None:
    cable = replace(found.cable, yield_strain=0.01, memory_rate=100.0)
    sought = (replace(found.parameters[0], name="turn"),)
    other = replace(found, candidate=replace(found.candidate, cable=cable, turn=0.3), parameters=sought)
    document = document_of_identification(other)
    assert (document["turn"], document["cable"]["yield_strain"], document["cable"]["memory_rate"]) == (0.3, 0.01, 100.0)
    assert "turn" not in document_of_identification(found)
