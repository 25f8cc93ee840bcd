"""Taking back a change or a solve that lasts too long; and the looks of a scene without an answer."""

import numpy as np
import pytest
from protocol_client import NOTHING_STORED, SceneClient, connected

from app.viewer.camera import extent
from app.viewer.draft import start_draft
from app.viewer.history import JOINED, MOST, History
from app.viewer.palette import OBSTACLE, WARNING
from dlocore import predict

DRAG = ("environment", "drag")
DRAFTS = [start_draft().put(DRAG, 0.01 * (k + 1)) for k in range(MOST + 2)]


def test_changes_are_taken_back_one_by_one_and_made_again():
    history = History()
    assert history.steps == (False, False)
    assert history.back(DRAFTS[0]) is DRAFTS[0]
    history.changed(DRAFTS[0], 0.0)
    history.changed(DRAFTS[1], JOINED)
    assert history.back(DRAFTS[2]) == DRAFTS[1]
    assert history.back(DRAFTS[1]) == DRAFTS[0]
    assert history.steps == (False, True)
    assert history.forward(DRAFTS[0]) == DRAFTS[1]
    assert history.forward(DRAFTS[1]) == DRAFTS[2]
    assert history.steps == (True, False)


def test_what_a_hand_changes_in_one_go_is_one_step():
    history = History()
    for k in range(100):
        history.changed(DRAFTS[k], 0.05 * k)
    assert history.back(DRAFTS[100]) == DRAFTS[0]
    assert history.steps == (False, True)


def test_a_change_after_a_step_back_ends_what_was_ahead_and_is_a_step_of_its_own():
    history = History()
    history.changed(DRAFTS[0], 0.0)
    history.changed(DRAFTS[1], 5.0)
    history.back(DRAFTS[2])
    history.changed(DRAFTS[1], 5.1)
    assert history.steps == (True, False)
    assert history.back(DRAFTS[3]) == DRAFTS[1]


def test_the_oldest_of_many_steps_are_forgotten():
    history = History()
    for k in range(MOST + 1):
        history.changed(DRAFTS[k], 10.0 * k)
    found = DRAFTS[MOST + 1]
    while history.steps[0]:
        found = history.back(found)
    assert found == DRAFTS[1]


def drag_of(client: SceneClient) -> float:
    return client.document["environment"]["drag"]


def test_undo_and_redo_are_on_the_panel(service):
    with connected(service) as client:
        client.refined()
        before = drag_of(client)
        assert client.control("Changes")[1]["visible"]
        client.set("Changes", "Undo")
        client.wait_for(lambda: client.notifications == ["There is nothing to undo"])
        client.set("Drag [N s/m²]", 0.2)
        assert drag_of(client) == 0.2
        client.set("Changes", "Undo")
        client.wait_for(lambda: client.control("Drag [N s/m²]")[1]["value"] == f"{before}")
        assert drag_of(client) == before
        client.set("Changes", "Redo")
        client.wait_for(lambda: client.control("Drag [N s/m²]")[1]["value"] == "0.2")
        client.refined()


def test_undo_comes_back_from_another_scene(service):
    with connected(service) as client:
        client.refined()
        before = client.document
        client.set("Example", "peg-with-friction")
        client.wait_for(lambda: client.document != before)
        client.set("Changes", "Undo")
        client.wait_for(lambda: client.document == before)


def begin_a_long_solve(client: SceneClient) -> None:
    client.set("Ask for", "target error")
    client.set("Method", "reference")
    client.set("Target error [mm]", 0.001)
    client.wait_for(lambda: client.control("Stop")[1]["visible"])


def test_a_long_solve_can_be_stopped_and_begun_again(service):
    with connected(service) as client:
        client.refined()
        assert not client.control("Stop")[1]["visible"]
        begin_a_long_solve(client)
        client.press("Stop")
        client.wait_for(lambda: 'data-status="stopped"' in client.card)
        assert not client.control("Stop")[1]["visible"]
        client.listen(1.5)
        assert 'data-status="stopped"' in client.card
        assert "data-stale" in client.html('data-plot="accuracy"')
        client.press("Solve it")
        client.wait_for(lambda: client.control("Stop")[1]["visible"])
        client.press("Stop")
        client.wait_for(lambda: client.control("Solve it")[1]["visible"])
        client.set("Ask for", "automatic")
        client.set("Method", "automatic")
        client.refined()
        assert not client.control("Solve it")[1]["visible"]
        assert "data-stale" not in client.html('data-plot="accuracy"')


def test_an_obstacle_that_is_refused_is_seen_where_it_stands(service):
    with connected(service) as client:
        client.refined()
        client.set("Add", "Sphere")
        client.wait_for(lambda: "/obstacle/0" in client.nodes)
        client.refined()
        assert tuple(client.nodes["/obstacle/0"]["color"]) == OBSTACLE
        client.set("Centre [m]", (0.5, 0.0, 0.0))
        client.wait_for(lambda: 'data-status="impossible"' in client.card)
        client.wait_for(lambda: tuple(client.nodes["/obstacle/0"]["color"]) == WARNING)
        np.testing.assert_allclose(client.positions["/obstacle/0"], (0.5, 0.0, 0.0))
        client.set("Centre [m]", (0.5, -0.5, 0.0))
        client.wait_for(lambda: tuple(client.nodes["/obstacle/0"]["color"]) == OBSTACLE)


def test_the_obstacles_are_of_the_colour_of_sound_ones_where_another_thing_is_refused(service):
    with connected(service) as client:
        client.set("Add", "Sphere")
        client.wait_for(lambda: "/obstacle/0" in client.nodes)
        client.refined()
        client.set("Diameter [mm]", 900.0)
        client.wait_for(lambda: 'data-status="impossible"' in client.card)
        assert tuple(client.nodes["/obstacle/0"]["color"]) == OBSTACLE


def test_the_camera_goes_to_where_a_longer_cable_is_seen(service):
    with connected(service) as client:
        client.refined()
        near = np.linalg.norm(client.camera)
        client.set("Length [m]", 1.5)
        client.wait_for(lambda: '"length": 1.5' in client.markdown("```json"))
        assert np.linalg.norm(client.camera) == near  # where the user has placed it
        client.set("Length [m]", 300.0)
        client.wait_for(lambda: np.linalg.norm(client.camera) > 100.0 * near)


def test_a_page_that_is_loaded_again_finds_its_scene_and_the_steps_before(service):
    with connected(service, tab="mine") as client:
        client.refined()
        before = drag_of(client)
        client.set("Drag [N s/m²]", 0.2)
        client.wait_for(lambda: drag_of(client) == 0.2)
    with connected(service, tab="another") as client:
        assert drag_of(client) == before
    with connected(service, tab="mine") as client:
        assert drag_of(client) == 0.2
        client.set("Changes", "Undo")
        client.wait_for(lambda: drag_of(client) == before)


def test_a_tab_that_is_opened_beside_another_is_a_copy_of_it(service):
    with connected(service, tab="twice") as one:
        one.set("Drag [N s/m²]", 0.3)
        one.wait_for(lambda: drag_of(one) == 0.3)
        with connected(service, tab="twice") as other:
            assert drag_of(other) == 0.3
            other.set("Drag [N s/m²]", 0.4)
            other.wait_for(lambda: drag_of(other) == 0.4)
        assert drag_of(one) == 0.3


def test_the_whole_scene_is_seen_with_a_target_and_a_motion_that_left_the_view(service):
    with connected(service) as client:
        client.refined()
        near = list(client.camera)
        client.set("Length [m]", 1.9)  # not so much longer that the camera would move by itself
        client.set("Target [m]", [0.5, 6.0, 0.0])
        client.refined()
        client.wait_for(lambda: client.final_shape[:, 1].max() > 5.9)
        client.press("Show the whole scene")
        client.wait_for(lambda: np.linalg.norm(np.subtract(client.camera, near)) > 4.0)


def test_what_is_to_be_seen_of_a_motion_is_all_of_its_way():
    draft = start_draft().put(("environment", "table"), None).put(("quality",), "auto")
    start = draft.start(NOTHING_STORED)
    surface = predict(draft.scene(NOTHING_STORED)).surface
    falls = surface.sample()[2][..., 2].min()
    assert falls < -0.3
    assert extent(draft, start)[:, 2].min() == 0.0
    assert extent(draft, start, surface)[:, 2].min() == pytest.approx(falls, abs=0.01)
