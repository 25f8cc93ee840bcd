"""Names of parameters: each means what is there, and what is not there is refused."""

from typing import Any

import numpy as np
import pytest

from app.commands.command_line import parser
from dlocore import Cable, Environment, SceneError
from dlocore.identify import Candidate
from dlocore.identify.parameters import DEFAULT, SCALARS, parameters, prepared

FREE = (2, 3, 4)


@pytest.mark.parametrize(
    ("name", "allowed"),
    [
        ("clamp_angles[7][0]", "clamp_angles[i][0] and clamp_angles[i][1] for i of 0, 1"),
        ("rest_curvature[9][1]", "rest_curvature[i][0] and rest_curvature[i][1] for i of 0, 1, 2, 3, 4"),
        ("marker_offsets[77][0]", "marker_offsets[i][0] and marker_offsets[i][1] for i of 2, 3, 4"),
        ("marker_offsets[0][0]", "for i of 2, 3, 4"),  # a gripper holds it
        ("clamp_angles[0][2]", "one of bending_stiffness"),
    ],
)
def test_a_number_of_a_clamp_place_or_marker_that_is_not_there_is_refused(name: str, allowed: str) -> None:
    with pytest.raises(SceneError) as error:
        parameters(("drag", name), 2, FREE)
    assert error.value.field == "parameters"
    assert error.value.given == name
    assert allowed in error.value.allowed


def test_angles_of_clamps_are_refused_where_there_is_no_clamp() -> None:
    with pytest.raises(SceneError, match=r"^parameters: got clamp_angles\. Allowed: where a recording has a clamp"):
        parameters(("drag", "clamp_angles"), 0, FREE)


def test_a_name_alone_is_no_list_of_names() -> None:
    names: Any = "drag"
    with pytest.raises(SceneError, match=r"^parameters: got 'drag'\. Allowed: a list of names\.$"):
        parameters(names, 2)


def test_several_stand_for_all_that_are_there() -> None:
    names = ("clamp_angles", "marker_offsets", "rest_curvature[1][0]")
    found = [p.name for p in parameters(names, 1, FREE)]
    assert found == [
        *[f"clamp_angles[0][{d}]" for d in (0, 1)],
        *[f"marker_offsets[{i}][{d}]" for i in FREE for d in (0, 1)],
        "rest_curvature[1][0]",
    ]


def test_what_is_put_into_a_candidate_is_got_from_it() -> None:
    names = ("clamp_angles[1][0]", "marker_offsets[4][1]", "rest_curvature[2][0]", "turn", "drag", "length_ratio")
    cable = Cable(length=1.0, diameter=0.005, linear_density=0.05, bending_stiffness=1e-3)
    candidate = prepared(Candidate(cable=cable, environment=Environment()), names, 2, 6)
    for k, p in enumerate(parameters(names, 2, FREE)):
        changed = p.put(candidate, 0.3 + 0.1 * k)
        np.testing.assert_equal(p.get(changed), 0.3 + 0.1 * k)
        assert p.get(candidate) != p.get(changed)


def test_the_help_of_the_command_names_every_parameter(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        parser().parse_args(["identify", "--help"])
    told = "".join(capsys.readouterr().out.split())
    assert f"(default:{','.join(DEFAULT[:-1])}and{DEFAULT[-1]})" in told
    for name in (*SCALARS, "clamp_angles", "marker_offsets", "rest_curvature"):
        assert name in told, name
