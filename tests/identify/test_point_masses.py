"""Point masses of a recorded cable: told with the recording, found in the cable that comes of it."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.reports.identification import document_of_identification
from app.schemas.cable import CableModel
from app.schemas.convert import cable_of
from dlocore import PointMass, SceneError
from dlocore.identify import estimate, identify
from dlocore.recordings import Recording, load_recording, recording_of, save_recording

CONNECTOR = PointMass(u=0.5, mass=0.02)


def hanging(frames: int = 40, **facts: Any) -> Recording:
    """Return a recording of a cable of 0.5 m that hangs still along -z, with a connector at its free end."""
    markers = np.zeros((frames, 6, 3))
    markers[:, :, 2] = -0.1 * np.arange(6)
    given: dict[str, Any] = {"held": (0,), "linear_density": 0.05, "point_masses": (CONNECTOR,)} | facts
    return Recording(times=np.arange(frames) * 0.02, markers=markers, **given)


def test_they_are_read_as_they_were_written(tmp_path: Path) -> None:
    save_recording(hanging(), tmp_path / "shaken.npz")
    assert load_recording(tmp_path / "shaken.npz").point_masses == (CONNECTOR,)


def test_a_table_tells_them_in_its_json(tmp_path: Path) -> None:
    rows = [f"{t}," + ",".join(f"{x}" for x in frame.ravel()) for t, frame in enumerate(np.asarray(hanging().markers))]
    (tmp_path / "shaken.csv").write_text("\n".join(rows))
    (tmp_path / "shaken.json").write_text(json.dumps({"point_masses": [{"u": 0.5, "mass": 0.02}]}))
    assert load_recording(tmp_path / "shaken.csv").point_masses == (CONNECTOR,)


@pytest.mark.parametrize(
    ("given", "field"),
    [
        (0.02, "point_masses"),
        ([0.02], "point_masses[0]"),
        ([{"u": 0.5}], "point_masses[0]"),
        ([{"u": 0.1, "mass": 0.1}, {"u": 0.5, "mass": -1.0}], "point_masses[1].mass"),
        ([{"u": 0.6, "mass": 0.02}], "point_masses[0].u"),
    ],
)
def test_what_is_wrong_with_them_is_named(given: Any, field: str) -> None:
    shape = hanging()
    with pytest.raises(SceneError) as error:
        recording_of(shape.times, shape.markers, {"held": [0], "point_masses": given})
    assert error.value.field == field


def test_the_cable_that_is_found_has_them_in_python_and_in_its_document() -> None:
    found = identify([hanging()], names=("drag",))
    assert found.cable.point_masses == (CONNECTOR,)
    document = document_of_identification(found)["cable"]
    assert document["point_masses"] == [{"u": 0.5, "mass": 0.02}]
    assert cable_of(CableModel.model_validate(document)).point_masses == (CONNECTOR,)


def test_the_document_has_all_that_is_known_of_the_cable() -> None:
    given = replace(
        estimate.cable_of([hanging()]), torsional_damping=1e-5, yield_twist=0.1, memory_rate=9.0, hardening=0.3
    )
    found = identify([hanging()], names=("drag",))
    document = document_of_identification(replace(found, candidate=replace(found.candidate, cable=given)))["cable"]
    again = cable_of(CableModel.model_validate(document))
    for name in ("torsional_damping", "yield_twist", "memory_rate", "hardening", "axial_damping"):
        assert getattr(again, name) == getattr(given, name), name


def test_one_recording_of_several_may_tell_them_and_two_tell_the_same() -> None:
    silent = hanging(41, point_masses=(), length=0.505, name="silent")
    assert estimate.cable_of([silent, hanging()]).point_masses == (PointMass(u=0.505, mass=0.02),)
    other = hanging(41, point_masses=(replace(CONNECTOR, mass=0.03),), name="other")
    with pytest.raises(SceneError, match=r"^recordings\['other'\]\.point_masses: got 0\.03 kg at 0\.5 m\."):
        identify([hanging(), other])


@pytest.mark.parametrize("own", [(), (PointMass(u=0.3, mass=0.01),)], ids=["without", "with its own"])
def test_a_given_cable_has_its_own_or_those_of_the_recordings(own: tuple[PointMass, ...]) -> None:
    known = replace(estimate.cable_of([hanging()]), point_masses=own)
    assert identify([hanging()], known, names=("drag",)).cable.point_masses == (own or (CONNECTOR,))
