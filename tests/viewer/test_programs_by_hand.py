"""Several moves of one gripper, put together in the scene."""

from collections.abc import Iterator

import httpx
import numpy as np
import pytest
from protocol_client import NOTHING_STORED, SceneClient, connected
from scipy.spatial.transform import Rotation

from app.schemas import PredictionRequest, to_scene
from app.viewer import grips, programs, report
from app.viewer.draft import Draft, start_draft
from app.viewer.shapes import scaled
from dlocore import Waypoints

MOVE = {"kind": "move", "displacement": [0.0, 0.5, 0.0], "duration": 1.6, "profile": "cubic"}
BEGIN = np.array([0.25, 0.0, 0.0])


def two_moves() -> Draft:
    draft = start_draft().put(("primitives", 0, "path"), MOVE)
    return grips.with_target(grips.with_next_move(draft, BEGIN), BEGIN, np.array([0.4, 0.3, 0.0]))


def test_a_move_more_begins_where_the_last_one_ends_and_takes_as_long() -> None:
    draft = two_moves()
    assert draft.primitives[0]["path"] == {
        "kind": "waypoints", "times": [0.0, 1.6, 3.2], "profile": "cubic",
        "positions": [[0.25, 0.0, 0.0], [0.25, 0.5, 0.0], [0.4, 0.3, 0.0]],
    }  # fmt: skip
    (grasp,) = draft.scene(NOTHING_STORED).grasps
    assert isinstance(grasp.path, Waypoints)
    assert grips.motion(draft) == "moves"
    assert grips.moves(draft) == 2


def test_target_duration_and_profile_are_those_of_the_last_move() -> None:
    draft = grips.path_changed(grips.with_duration(two_moves(), 0.7), "profile", "linear")
    assert draft.primitives[0]["path"]["times"] == [0.0, 1.6, 2.3]
    assert draft.primitives[0]["path"]["profile"] == "linear"
    assert grips.duration(draft) == 0.7
    np.testing.assert_array_equal(grips.target(draft, BEGIN), [0.4, 0.3, 0.0])


def test_without_the_second_move_the_first_is_what_it_was() -> None:
    assert grips.without_last_move(two_moves()).primitives[0]["path"] == MOVE
    once = start_draft().put(("primitives", 0, "path"), MOVE)
    assert grips.without_last_move(once) == once
    three = grips.with_next_move(two_moves(), BEGIN)
    assert grips.without_last_move(three) == two_moves()


def test_moves_that_turn() -> None:
    draft = grips.with_turn(
        grips.with_hold(start_draft().put(("primitives", 0, "path"), MOVE), "tangent"), np.array([0, 0, 0.5])
    )
    further = grips.with_next_move(draft, BEGIN)
    assert grips.can_turn(further)
    np.testing.assert_allclose(grips.turn(further), [0, 0, 0.5], atol=1e-6)  # it stays turned
    further = grips.with_turn(further, np.array([0.0, 0.0, -0.25]))
    orientations = further.primitives[0]["path"]["orientations"]
    turns = Rotation.from_quat(np.roll(orientations, -1, axis=1)).as_rotvec()
    np.testing.assert_allclose(turns, [[0, 0, 0], [0, 0, 0.5], [0, 0, -0.25]], atol=1e-8)
    further.scene(NOTHING_STORED)
    assert grips.without_last_move(further).primitives[0]["path"] == {**MOVE, "rotation": [0.0, 0.0, 0.5]}
    assert "orientations" not in grips.with_hold(further, "point").primitives[0]["path"]
    whole = grips.with_turn(draft, np.array([0.0, 0.0, 2.0 * np.pi]))
    assert grips.with_next_move(whole, BEGIN) == whole  # two orientations can't express a full turn


@pytest.mark.parametrize("profile", [None, "spline"])
def test_recorded_waypoints_are_no_program(profile: str | None) -> None:
    path = {"kind": "waypoints", "times": [0, 1, 2], "positions": [[0.25, 0, 0], [0.25, 0.3, 0], [0.25, 0.4, 0]]}
    draft = start_draft().put(("primitives", 0, "path"), path if profile is None else {**path, "profile": profile})
    assert not programs.is_program(draft.primitives[0]["path"])
    assert grips.motion(draft) == "follows waypoints"
    assert grips.moves(draft) == 0
    assert grips.with_next_move(draft, BEGIN) == grips.without_last_move(draft) == draft


def test_a_program_goes_with_the_place_that_its_gripper_holds() -> None:
    before = two_moves()
    start = before.start(NOTHING_STORED)
    moved = grips.changed(before, "u", 0.35)
    carried = grips.carried(moved, start, before, start)
    np.testing.assert_allclose(
        carried.primitives[0]["path"]["positions"],
        [np.add(place, [0.1, 0, 0]) for place in before.primitives[0]["path"]["positions"]],
    )
    longer = scaled(grips.changed(before, "u", 1.0), 1.5)
    end = grips.carried(longer, longer.start(NOTHING_STORED), grips.changed(before, "u", 1.0), start)
    assert end.primitives[0]["path"]["positions"][0] == [0.75, 0.0, 0.0]  # 0.5 m farther, as the end of the cable is
    assert grips.carried(before, start, before, start) is before
    late = grips.changed(moved, "grasp_time", 0.5)  # begins where the cable is by then: no start curve knows that
    assert grips.carried(late, start, before, start) == late


def test_waypoints_are_listed_with_how_long_they_take() -> None:
    path = two_moves().primitives[0]["path"]
    listed = report.waypoints(path)
    assert "3 waypoints in 3.2 s" in listed
    assert f"<div>1.6 s: {', '.join(f'{x:g}' for x in path['positions'][1])}</div>" in listed
    many = {**path, "times": list(range(60)), "positions": [[0.25, 0.0, 0.0]] * 60}
    assert "and 10 more" in report.waypoints(many)
    assert report.waypoints(MOVE) == ""


@pytest.fixture
def client(service: httpx.URL) -> Iterator[SceneClient]:
    with connected(service) as client:
        yield client


def test_moves_are_added_dragged_and_taken_away_on_the_panel(client: SceneClient) -> None:
    client.wait_for(lambda: "converged" in client.card)
    client.set("Moves: 1", "Add")
    client.wait_for(lambda: any(state.get("label") == "Moves: 2" for state in client.controls.values()))
    client.set("Target [m]", [0.4, 0.3, 0.0])
    client.set("Duration [s]", 0.8)
    path = client.wait_for(lambda: _path_that_ends_at(client, [0.4, 0.3, 0.0], 2.4))
    assert "3 waypoints in 2.4 s" in client.html("waypoints in")
    assert path["positions"][:2] == [[0.25, 0.0, 0.0], [0.25, 0.5, 0.0]]
    client.set("Grasp u [m]", 0.3)  # the held point starts elsewhere, and so do the moves
    path = client.wait_for(lambda: _path_that_ends_at(client, [0.45, 0.3, 0.0], 2.4))
    assert path["positions"][0] == [0.3, 0.0, 0.0]
    to_scene(PredictionRequest.model_validate(client.document), NOTHING_STORED)
    client.wait_for(lambda: "converged" in client.card and "scene before" not in client.card)
    client.set("Moves: 2", "Remove last")
    client.wait_for(lambda: client.document["primitives"][0]["path"]["kind"] == "move")
    client.set("Moves: 1", "Remove last")
    client.wait_for(lambda: any("One move is left" in shown for shown in client.notifications))
    assert client.document["primitives"][0]["path"]["displacement"] == [0.0, 0.5, 0.0]


def _path_that_ends_at(client: SceneClient, place: list[float], time: float) -> dict | None:
    path = client.document["primitives"][0]["path"]
    reached = path["kind"] == "waypoints" and path["positions"][-1] == place and path["times"][-1] == time
    return path if reached else None
