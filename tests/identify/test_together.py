"""Recordings of one cable: each once, in metres, with facts that agree."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dlocore import SceneError
from dlocore.identify.together import check_together
from dlocore.recordings import Recording


def recording(name: str, shift: float = 0.0, **facts: Any) -> Recording:
    markers = np.zeros((12, 5, 3))
    markers[:, :, 0] = 0.1 * np.arange(5) + shift
    markers[3, 2] = np.nan
    return Recording(times=0.01 * np.arange(12), markers=markers, held=(0,), name=name, **facts)


def test_a_recording_that_is_given_twice_is_refused() -> None:
    with pytest.raises(SceneError, match=r"^recordings\['again'\]: got times and markers of 'first' again\."):
        check_together([recording("first"), recording("other", 0.1), recording("again")])


@pytest.mark.parametrize(
    ("field", "one", "other"), [("length", 0.5, 0.6), ("diameter", 0.005, 0.006), ("linear_density", 0.05, 0.1)]
)
def test_facts_that_contradict_each_other_are_refused(field: str, one: float, other: float) -> None:
    first, second = recording("first", **{field: one}), recording("second", 0.1, **{field: other})
    with pytest.raises(SceneError, match="All must be of one cable") as error:
        check_together([first, second])
    assert error.value.field == f"recordings['second'].{field}"
    check_together([first, replace(second, **{field: 1.01 * one})])  # as medians of noisy distances differ


def test_a_fact_that_one_recording_alone_tells_is_fine() -> None:
    check_together([recording("first", linear_density=0.05), recording("second", 0.1)])


@pytest.mark.parametrize(("facts", "field"), [({}, "length"), ({"u": 0.1 * np.arange(5), "length": 0.4}, "markers")])
def test_markers_in_millimetres_are_refused(facts: dict[str, Any], field: str) -> None:
    metres = recording("shaken")
    long = Recording(times=metres.times, markers=1e3 * np.asarray(metres.markers), held=(0,), name="shaken", **facts)
    with pytest.raises(SceneError, match="this looks like millimetres") as error:
        check_together([long])
    assert error.value.field == f"recordings['shaken'].{field}"
