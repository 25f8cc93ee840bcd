import json
import threading
import time
import xml.etree.ElementTree as ET

import httpx
import numpy as np
import pytest
from protocol_client import NOTHING_STORED, connected

from app.viewer import report
from app.viewer.draft import start_draft
from app.viewer.playback import Playback
from dlocore import predict


def solver_threads() -> list[str]:
    return [thread.name for thread in threading.enumerate() if thread.name.startswith("viewer-solver")]


def test_a_new_client_sees_the_papers_case_predicted(service):
    with connected(service) as client:
        expected = predict(start_draft().scene(NOTHING_STORED)).surface
        final = client.final_shape
        points = expected.positions(np.linspace(0, 1, 49), [1.6])[0]
        assert np.abs(final[:, :2] - points[:, :2]).max() < 1e-6  # single precision on the wire
        assert "spacetime, 9 × 13 control points" in client.card


def test_the_swept_surface_and_the_shapes_follow_a_short_move_in_a_long_time(service):
    path = {"kind": "waypoints", "times": [0.0, 0.4, 0.8], "positions": [[0, 0.5, 0], [0.5, 0.5, 0], [0, 0.5, 0]]}
    scene = start_draft().put(("primitives", 0, "path"), path).put(("horizon",), 24.0).put(("quality",), "auto")
    scene = scene.put(("shape", "start"), [-0.25, 0.5, 0.0])
    with connected(service) as client:
        client.upload("Open a file …", "scene.json", json.dumps(scene.document).encode())
        client.wait_for(lambda: "Preview" not in client.card and client.control("Time [s]")[1]["max"] == 24.0)
        strips = [client.nodes[f"/surface/{k}"]["vertices"].reshape(-1, 49, 3) for k in range(8)]
        held = np.concatenate([strip[:, 12, :2] for strip in strips])  # at u = 0.25 m
        assert held[:, 0].max() > 0.49  # where it turned back
        assert np.linalg.norm(np.diff(held, axis=0), axis=1).max() < 0.1
        ghosts = client.nodes["/ghosts"]["points"].reshape(9, -1, 2, 3)[:, 16, 0]
        assert (ghosts[:, 0] > 0.1).sum() >= 2
        colours = [tuple(client.nodes[f"/surface/{k}"]["color"]) for k in range(8)]
        assert np.linalg.norm(np.subtract(colours[0], colours[3])) < 20.0  # both in the first second of 24


def test_dragging_the_target_changes_the_prediction(service):
    with connected(service) as client:
        client.drag("start")
        for k in range(10):
            client.drag("update", 0.25 - 0.01 * k, 0.5 - 0.02 * k)
            client.listen(0.05)
        client.drag("end")
        draft = start_draft().put(("primitives", 0, "path", "displacement"), [-0.09, 0.32, 0.0])
        points = predict(draft.scene(NOTHING_STORED)).surface.positions(np.linspace(0, 1, 49), [1.6])[0]
        client.wait_for(lambda: np.abs(client.final_shape[:, :2] - points[:, :2]).max() < 1e-6)
        assert 'data-status="converged"' in client.card
        assert "Preview" not in client.card


def test_previews_follow_the_hand_before_it_stops(service):
    with connected(service) as client:
        client.drag("start")
        client.drag("update", 0.30, 0.40)
        client.wait_for(lambda: "Preview" in client.card)
        # the gripped point lies at the target at the end of every prediction
        gripped = client.final_shape[12]
        assert np.hypot(gripped[0] - 0.30, gripped[1] - 0.40) < 2e-3
        client.drag("end")


def test_the_newest_target_wins_over_a_flood_of_older_ones(service):
    with connected(service) as client:
        client.drag("start")
        for k in range(400):
            client.drag("update", 0.25, 0.1 + 0.001 * k)
        client.drag("update", 0.25, -0.3)
        shapes = []

        def reached():
            shapes.append(client.final_shape[12, 1])
            return abs(shapes[-1] + 0.3) < 2e-3

        client.wait_for(reached)
        assert len(set(shapes)) < 200  # queued up, all 401 targets would have been solved and drawn
        client.drag("end")


def test_two_clients_have_their_own_scenes(service):
    with connected(service) as one, connected(service) as other:
        before = other.final_shape.copy()
        one.drag("start")
        one.drag("update", 0.4, 0.2)
        one.drag("end")
        one.wait_for(lambda: abs(one.final_shape[12, 1] - 0.2) < 2e-3)
        other.listen(0.5)
        assert np.array_equal(other.final_shape, before)


def test_a_closed_tab_frees_its_solver_thread(service):
    give_up = time.monotonic() + 30
    while solver_threads():
        assert time.monotonic() < give_up
        time.sleep(0.02)
    with connected(service), connected(service):
        assert len(solver_threads()) == 2
    give_up = time.monotonic() + 30
    while solver_threads():
        assert time.monotonic() < give_up, "a solver thread outlives its tab"
        time.sleep(0.02)


def test_an_impossible_target_is_said_and_the_last_good_prediction_stays(service, caplog):
    with connected(service) as client:
        client.set("Ask for", "automatic")
        client.set("Grippers", "Add")
        client.wait_for(lambda: np.abs(client.final_shape[-1, :2] - (1, 0)).max() < 1e-6)
        client.set("Gripper", "1 at 0.25 m")
        client.wait_for(lambda: "control points" in client.card and "Preview" not in client.card)
        client.listen(0.2)
        good = client.final_shape.copy()
        client.drag("start")
        client.drag("update", 0.25, 0.9)
        client.wait_for(lambda: 'data-status="impossible"' in client.card)
        assert "farther apart than the cable between them" in client.card
        client.wait_for(lambda: client.visible.get("/warning"))
        label = " ".join(client.nodes["/warning"]["text"].split())
        assert label.startswith("Not possible. No cable can follow: the two grasps are farther apart")
        assert "got 1.172 m from gripper 1 at 0.25 m at 1.6 s, allowed: at most 0.75 m" in label
        assert np.array_equal(client.final_shape, good)
        client.drag("update", 0.5, 0.2)
        client.drag("end")
        client.wait_for(lambda: "control points" in client.card and "Preview" not in client.card)
        assert client.visible["/warning"] is False
        assert not np.array_equal(client.final_shape, good)
    assert not [record for record in caplog.records if record.levelname == "ERROR"]


def test_the_label_in_the_picture_tells_the_value_and_what_is_allowed():
    label = report.problem_label("quality.n_u", "quality.n_u: got 900, allowed: an integer, 5 to 129.", [])
    assert " ".join(label.split()) == "Not possible. Points along n_u: got 900, allowed: an integer, 5 to 129."
    assert max(len(line) for line in label.splitlines()) <= report.LABEL_WIDTH


def test_long_notes_on_an_answer_are_folded_and_short_ones_are_not():
    prediction = predict(start_draft().scene(NOTHING_STORED))
    for notes, folded in (((), False), (("short",), False), (("long " * 40, "a <b>"), True)):
        vars(prediction)["notes"] = notes
        card = ET.fromstring(report.status_card(prediction, preview=False))
        assert (card.find("details") is not None) == folded


def test_the_card_names_a_field_once():
    details = "cable.diameter: got 10.0, allowed: at most 0.5 [m]."
    card = report.problem_card("cable.diameter", details, [])
    assert "</b> Diameter: got 10.0, allowed: at most 0.5 [m].<div" in card
    assert card.count("Diameter") == 1
    card = report.problem_card("Two grasps meet", details, [])
    assert "</b> Two grasps meet.<div" in card
    assert "Diameter: got 10.0, allowed: at most 0.5 [m]." in card


def test_an_answer_that_is_no_success_is_told_in_the_picture(service):
    with connected(service) as client:
        client.refined()
        assert not client.visible.get("/warning")
        client.set("Ask for", "time budget")
        client.set("Time budget [ms]", 0.1)  # too short to solve any grid to 1 %
        client.wait_for(lambda: 'data-status="time_limit"' in client.card and "Preview" not in client.card)
        client.wait_for(lambda: client.visible.get("/warning"))
        assert client.nodes["/warning"]["text"] == "Out of time: see the panel."


def test_a_long_solve_tells_how_long_it_has_taken(service):
    with connected(service) as client:
        client.refined()
        client.set("Ask for", "target error")
        client.set("Method", "reference")
        client.set("Target error [mm]", 0.001)
        for seconds in (2, 3):
            client.wait_for(lambda seconds=seconds: f"Solving, {seconds} s" in client.card)
        assert "at most 60 s" in client.card


def test_the_timeline_moves_the_cable(service):
    with connected(service) as client:
        client.press("Pause")
        client.wait_for(lambda: any(c.get("label") == "Play" for c in client.controls.values()))
        surface = predict(start_draft().scene(NOTHING_STORED)).surface
        u = np.linspace(0, 1, 121)
        for t in (0.4, 1.6):
            client.set("Time [s]", t)
            points = surface.positions(u, [t])[0]
            middle = 0.5 * (points[1:] + points[:-1])
            client.wait_for(lambda middle=middle: np.abs(client.cable - middle).max() < 1e-6)


def test_playback_moves_the_cable_at_30_frames_a_second_or_more(service):
    with connected(service) as client:
        client.set("Speed", "¼×")
        client.listen(0.3)
        seen, shapes = time.monotonic(), set()
        while time.monotonic() - seen < 1.0:
            client.listen(0.004)
            shapes.add(client.cable.tobytes())
        assert len(shapes) >= 30


@pytest.mark.parametrize("colour", ["time", "curvature", "speed", "twist", "axial strain", "reaction"])
def test_the_cable_can_be_coloured_by_each_quantity(service, colour):
    with connected(service) as client:
        client.set("Colour", colour)
        client.wait_for(lambda: f"<span>{colour} [" in client.html("linear-gradient"))
        client.press("Pause")
        client.set("Time [s]", 1.2)
        client.listen(0.3)
        colours = client.nodes["/cable"]["batched_colors"].reshape(-1, 3)
        # all points of a shape share one time, and a motion in the plane twists none of them
        assert (len(np.unique(colours, axis=0)) > 5) == (colour not in ("time", "twist"))


def test_the_surface_can_be_raised_and_hidden(service):
    with connected(service) as client:
        client.set("Surface", "raised with time")
        client.wait_for(lambda: client.final_shape[:, 2].min() > 0.4)
        client.set("Surface", "hidden")
        client.wait_for(lambda: client.visible.get("/surface/7") is False)
        client.set("Shapes at intervals", False)
        client.wait_for(lambda: client.visible.get("/ghosts") is False)


def test_a_kept_run_is_stored_with_its_scene(service):
    with connected(service) as client:
        client.press("Keep this run")
        html = client.wait_for(lambda: client.html("data-run"))
        run_id = html.split('data-run="')[1].split('"')[0]
        base = f"{service.address}/v1/predictions/{run_id}"
        stored, scene = httpx.get(base).json(), httpx.get(f"{base}/scene.json").json()
        assert scene == start_draft().document
        again = httpx.post(f"{service.address}/v1/predictions", json=scene).json()
        difference = np.subtract(stored["surface"]["positions"], again["surface"]["positions"])
        assert np.abs(difference).max() < 1e-9
        assert httpx.get(f"{base}/recording.rrd").content[:4] == b"RRF2"
        curl = next(c["_markdown"] for c in client.controls.values() if "curl -s" in c.get("_markdown", ""))
        assert f"curl -s {service.address}/v1/predictions " in curl


def test_an_impossible_scene_leaves_nothing_of_the_scene_before_as_its_own(service):
    with connected(service, "two-grippers") as client:
        client.refined()
        client.wait_for(lambda: client.html('data-effect="inertia"'))
        client.set("Target [m]", [5.0, 0.0, 0.0])
        client.wait_for(lambda: 'data-status="impossible"' in client.card)
        written = client.document
        client.wait_for(lambda: json.loads(client.markdown("```json").strip("`json\n")) == written)
        assert json.loads(client.markdown("curl -s").split(" -d '")[1].rsplit("'", 1)[0]) == written
        notes = [c["content"] for c in client.controls.values() if "data-effect" in c.get("content", "")]
        assert all("data-stale" in note for note in notes)
        assert sum(c.get("content", "").count("From the previous scene") for c in client.controls.values()) == 5
        client.press("Save playback.html")
        client.wait_for(lambda: client.notifications == ["No playback"])
        client.press("Save picture.png")
        client.wait_for(lambda: client.notifications == ["No playback", "No picture"])
        client.set("Changes", "Undo")
        client.refined()
        client.wait_for(lambda: not client.html("data-stale"))


def test_a_name_is_no_reason_to_solve_again(service, monkeypatch):
    with connected(service) as client:
        client.refined()
        solved = []
        monkeypatch.setattr(service.app.state.service.metrics, "solved", solved.append)
        client.set("Name", "my run")
        client.wait_for(lambda: '"name": "my run"' in client.markdown("```json"))
        client.listen(0.5)
        assert solved == []
        client.set("Table friction", 0.1)
        client.wait_for(lambda: solved)


@pytest.mark.parametrize("paused", [True, False])
def test_a_drag_leaves_the_playback_as_it_was(service, paused):
    with connected(service) as client:
        client.refined()
        if paused:
            client.press("Pause")
            client.set("Time [s]", 0.4)
            client.wait_for(lambda: any(c.get("label") == "Play" for c in client.controls.values()))
        client.drag("start")
        client.drag("update", 0.25, 0.4)
        client.wait_for(lambda: client.control("Time [s]")[1]["value"] == 1.6)
        client.drag("end")
        client.wait_for(lambda: client.control("Time [s]")[1]["value"] < 1.6)
        client.listen(0.3)
        assert any(c.get("label") == ("Play" if paused else "Pause") for c in client.controls.values())
        assert (client.control("Time [s]")[1]["value"] == 0.4) == paused


def test_a_playback_that_was_held_goes_on_as_before_unless_it_was_played_or_paused_since():
    clock = Playback(horizon=2.0, time=0.5)
    clock.hold(2.0)
    assert (clock.playing, clock.time) == (False, 2.0)
    clock.resume()
    assert clock.playing
    clock.pause()
    clock.seek(0.7)
    clock.hold(0.0)
    clock.resume()
    assert (clock.playing, clock.time) == (False, 0.7)
    clock.hold(0.0)
    clock.play()
    clock.seek(1.0)
    clock.resume()
    assert (clock.playing, clock.time) == (True, 1.0)
