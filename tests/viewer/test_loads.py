"""Known forces of a scene: arrows while they act, a row among the largest forces, and a form."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from protocol_client import NOTHING_STORED, connected

from app.viewer import load_edits
from app.viewer.arrows import ARROW_LENGTH
from app.viewer.draft import start_draft
from app.viewer.load_edits import Pull
from app.viewer.loads import LoadsPicture, forces_over
from dlocore import Cable, Grasp, Load, Quality, Scene, Straight, predict

LOAD = {"u": 0.5, "force": [0.0, 0.5, 0.0]}


def loaded(*loads) -> load_edits.Draft:
    return start_draft().put(("loads",), list(loads))


@pytest.mark.parametrize("pull", [Pull(force=(0.1, 0.2, 0.3), start=s, end=e) for s in (0, 0.3) for e in (0, 0.9)])
def test_a_force_that_acts_for_a_while_is_read_as_it_was_written(pull):
    draft = load_edits.changed(loaded(LOAD), 0, force=pull.force, start=pull.start, end=pull.end)
    assert load_edits.pull(load_edits.loads(draft)[0]) == pull
    (load,) = draft.scene(NOTHING_STORED).loads
    acts = np.array([pull.start <= t <= (pull.end or 9.0) for t in (0.1, 0.4, 1.2)])
    np.testing.assert_allclose(load.at(np.array([0.1, 0.4, 1.2])), np.outer(acts, pull.force))


def test_a_force_of_nothing_keeps_its_times():
    draft = load_edits.changed(loaded(LOAD), 0, end=0.9)
    draft = load_edits.changed(draft, 0, force=(0.0, 0.0, 0.0))
    assert load_edits.pull(load_edits.loads(draft)[0]) == Pull(force=(0.0, 0.0, 0.0), end=0.9)


def test_a_force_that_changes_otherwise_is_moved_but_not_written_anew():
    force = {"times": [0, 0.5, 1.0], "values": [[0, 0, 0], [0, 1, 0], [0, 0, 0]]}
    draft = loaded({"u": 0.5, "force": force})
    assert load_edits.changed(draft, 0, start=0.2) == draft
    assert load_edits.loads(load_edits.placed(draft, 0, 0.7)) == [{"u": 0.7, "force": force}]


def test_a_force_that_jumps_is_shown_before_and_after_the_jump():
    load = Load(u=0.5, force=[[0, 0, 0], [0, 3, 0], [0, 1, 0], [0, 0, 0]], times=[0.0, 0.5, 0.5, 1.0])
    times, forces = forces_over(load, 2.0)
    np.testing.assert_array_equal(times, [0.0, 0.5, 0.5, 1.0, 1.0, 2.0])
    np.testing.assert_array_equal(forces[:, 1], [0, 3, 1, 0, 0, 0])


@pytest.mark.parametrize(("before", "after"), [(0.1, 15.0), (0.1, 0.0), (0.0, 15.0)], ids=["rises", "ends", "begins"])
def test_a_force_that_jumps_as_the_motion_ends_is_drawn_as_before_it(before, after):
    """The force after the jump used to be drawn 3e12 m long, at a scale that left it out."""
    hanging = Scene(
        cable=Cable(length=0.5, diameter=0.005, linear_density=0.05, bending_stiffness=1e-3),
        shape=Straight(direction=(0, 0, -1)),
        grasps=[Grasp(u=0)],
        loads=[Load(u=0.5, force=[[0, 0.1, 0], [0, before, 0], [0, after, 0]], times=[0.0, 0.1, 0.1])],
        horizon=0.1,
        quality=Quality(n_u=9, n_t=9, keep_grid=True),
    )
    arrow = SimpleNamespace(visible=False, points=None)
    picture = LoadsPicture(SimpleNamespace(add_arrows=lambda *_, **__: arrow), 0.005, 0.5)
    picture.take(predict(hanging))
    picture.pose(0.1)
    assert arrow.visible == (before > 0.0)
    if arrow.visible:
        start, end = arrow.points[0]
        np.testing.assert_allclose(end - start, [0.0, ARROW_LENGTH * 0.5, 0.0], atol=1e-6)


def test_a_new_force_acts_where_no_gripper_is():
    held = start_draft().primitives[0]
    draft = start_draft().put(("primitives",), [{**held, "u": 0.0}, {**held, "u": 1.0}])
    assert load_edits.loads(load_edits.added(draft))[0]["u"] == 0.5


def test_known_forces_are_drawn_while_they_act_and_listed(service):
    draft = load_edits.changed(loaded(LOAD), 0, end=0.8).put(("quality",), "auto")
    with connected(service) as client:
        client.upload("Open a file …", "scene.json", json.dumps(draft.document).encode())
        client.wait_for(lambda: "known force, u = 0.50 m: at most 0.5 N" in client.html("known force, u"))
        client.press("Pause")
        client.set("Time [s]", 0.4)
        client.wait_for(lambda: client.visible.get("/loads"))
        client.listen(0.3)
        start, end = client.nodes["/loads"]["points"].reshape(2, 3)
        middle = 0.5 * (client.cable[59] + client.cable[60])  # at u = 0.5 m
        assert np.linalg.norm(start[:2] - middle[:2]) < 1e-3
        assert (end - start)[1] == pytest.approx(ARROW_LENGTH, abs=1e-4)  # of the largest, on a cable of 1 m
        assert (end - start)[[0, 2]] == pytest.approx([0.0, 0.0], abs=1e-6)
        client.set("Forces", False)
        client.wait_for(lambda: not client.visible["/loads"])
        client.set("Forces", True)
        client.wait_for(lambda: client.visible["/loads"])
        client.set("Time [s]", 1.2)
        client.wait_for(lambda: not client.visible["/loads"])


def test_known_forces_are_chosen_and_removed(service):
    over_time = {"times": [0, 0.5, 1.0], "values": [[0, 0, 0], [0, 1, 0], [0, 0, 0]]}
    with connected(service) as client:
        draft = loaded(LOAD, {"u": 0.7, "force": over_time})
        client.upload("Open a file …", "scene.json", json.dumps(draft.document).encode())
        client.wait_for(lambda: client.control("Force")[1]["options"] == ["1: at 0.5 m", "2: at 0.7 m"])
        assert client.control("Force [N]")[1]["visible"]
        client.set("Force", "2: at 0.7 m")
        client.wait_for(lambda: not client.control("Force [N]")[1]["visible"])
        client.press("Remove force")
        client.wait_for(lambda: client.control("Force [N]")[1]["visible"])
        assert client.document["loads"] == [LOAD]
        client.press("Remove force")
        client.wait_for(lambda: not client.control("Force")[1]["visible"])
        assert "loads" not in client.document
