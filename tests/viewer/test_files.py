"""Scenes and points are opened from files, edited by hand and saved again."""

import contextlib
import io
import json
import tracemalloc
from collections.abc import Iterator
from types import SimpleNamespace

import numpy as np
import pytest
from protocol_client import NOTHING_STORED, SceneClient, connected, wait_for
from viser import ClientHandle

from app.schemas import PredictionRequest, to_scene
from app.schemas.request import EXAMPLES, TWO_GRIPPERS
from app.viewer import host, shapes, transfers, uploads
from app.viewer.draft import Draft, start_draft
from app.viewer.gateway import KEY_HEADER
from app.viewer.outbox import file_name
from dlocore import SceneError

ROUNDING = 1e-6  # m: shapes are drawn in single precision
FITTED = 2e-3  # m: points are fitted within the noise that few points may have, docs/model.md
ARC = np.column_stack([np.sin(np.linspace(0, 1, 21)), 1 - np.cos(np.linspace(0, 1, 21))])  # of 1 m


def npz(**arrays) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


def csv(points) -> bytes:
    return "\n".join(["x,y", *(",".join(f"{x:.6f}" for x in row) for row in points)]).encode()


@pytest.mark.parametrize("name", list(EXAMPLES))
def test_every_example_of_the_api_comes_back_as_it_was_opened(service, name):
    given = {key: part for key, part in EXAMPLES[name]["value"].items() if key != "output"}
    with connected(service) as client:
        client.upload("Open a file …", "scene.json", json.dumps(given).encode())
        client.wait_for(lambda: "was opened" in client.html("scene.json"))
        assert client.document == given


def test_an_opened_scene_is_predicted_and_can_be_sent_to_the_api(service):
    with connected(service) as client:
        client.upload("Open a file …", "hanging.json", json.dumps(TWO_GRIPPERS).encode())
        client.wait_for(lambda: "/gripper/1" in client.nodes and client.final_shape[:, 2].min() < -0.1, timeout=60)
        to_scene(PredictionRequest.model_validate(client.document), NOTHING_STORED)


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("points.csv", csv(ARC)),
        ("points.txt", csv(ARC).replace(b",", b" ")),
        ("points.json", json.dumps(ARC.tolist()).encode()),
        ("named.json", json.dumps({"points": ARC.tolist()}).encode()),
        ("points.npz", npz(points=ARC)),
        ("motion.npz", npz(positions=np.array([0 * ARC, ARC]), u=np.arange(3))),
    ],
)
def test_points_of_a_cable_become_its_start_shape(name, content):
    draft = uploads.opened(start_draft(), name, content)
    start = draft.start(NOTHING_STORED)
    assert np.abs(start(np.linspace(0, 1, 21))[:, :2] - ARC).max() < FITTED
    assert draft.length == 1.0


def test_points_of_a_longer_cable_give_it_their_length():
    draft = uploads.opened(start_draft(), "long.csv", csv(2.0 * ARC))
    assert draft.length == pytest.approx(2.0, rel=1e-3)  # the measured length of a curve through 21 points
    assert np.abs(draft.start(NOTHING_STORED)([2.0])[0, :2] - 2.0 * ARC[-1]).max() < 2 * FITTED


def test_two_points_are_a_straight_cable_between_them():
    draft = uploads.opened(start_draft(), "line.csv", b"0,0\n1,1")
    assert draft.length == pytest.approx(np.sqrt(2.0), abs=1e-6)
    ends = draft.start(NOTHING_STORED)([0.0, draft.length])
    np.testing.assert_allclose(ends, [[0, 0, 0], [1, 1, 0]], rtol=0, atol=1e-4)  # the direction has 5 digits
    settling = uploads.opened(shapes.with_settling(start_draft(), True), "line.csv", b"0,0.1,0.2\n1,0.1,0.2")
    assert settling.document["shape"] == {
        "kind": "straight",
        "start": [0, 0.1, 0.2],
        "direction": [1, 0, 0],
        "settle": True,
    }
    assert settling.length == 1.0
    settling.scene(NOTHING_STORED)


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("scene.xml", b"<scene/>", "a .json scene"),
        ("scene.json", b"{", "JSON"),
        ("scene.json", b'{"a": 1}', '"points"'),
        ("scene.json", json.dumps({"cable": {"length": -1}, "shape": {"kind": "straight"}}).encode(), "cable.length"),
        (
            "scene.json",
            json.dumps({"cable": {"preset": "rope"}, "shape": {"kind": "straight"}}).encode(),
            "cable.preset",
        ),
        ("scene.json", json.dumps({"cable": {}, "shape": {}, "primitives": [3]}).encode(), "shape"),
        ("points.csv", b"1,2\n3,4\nfive,6", "line 3"),
        ("points.csv", b"1,2,3,4", "line 1"),
        ("points.csv", b"", "points"),
        ("points.csv", b"\xff\xfe\x00", "UTF-8"),
        ("points.npz", b"no zip", "numpy.save"),
        ("points.npz", npz(a=ARC, b=ARC), "points"),
        ("points.npz", npz(points=np.array(["x"])), "numbers"),
        ("points.csv", b"0,0\n0,0\n0,0\n0,0", "points"),
        ("points.csv", b"0,0\n0,0", "two points 0 m apart"),
        ("points.csv", b"0,0\n1e300,1e300", "two points"),
        ("points.csv", b"0,0\n1,1\n2,2", "3 points along the cable"),
        ("points.csv", b"0,0\n1e200,0\n2,3e200\n4e200,0\n5e200,1", "points"),
    ],
)
def test_a_file_that_is_none_is_refused_in_words(name, content, words):
    with pytest.raises(SceneError, match=words.replace(".", r"\.")):
        uploads.opened(start_draft(), name, content)


@pytest.mark.parametrize("ending", ["npz", "npy"])
@pytest.mark.parametrize("compressed", [True, False])
def test_a_damaged_file_of_arrays_is_refused_wherever_it_is_damaged(ending, compressed):
    buffer = io.BytesIO()
    if ending == "npy":
        np.save(buffer, ARC)
    else:
        (np.savez_compressed if compressed else np.savez)(buffer, points=ARC)
    good, rng = buffer.getvalue(), np.random.default_rng(1)
    cut = [good[:k] for k in range(0, len(good), 7)]
    changed = [good[:k] + bytes([rng.integers(256)]) + good[k + 1 :] for k in range(0, len(good), 3)]
    for content in (*cut, *changed):
        with contextlib.suppress(SceneError):  # otherwise it is opened: the damage does not matter
            uploads.opened(start_draft(), f"points.{ending}", content)


def test_only_the_array_that_is_used_is_unpacked_and_none_that_is_too_large():
    largest, buffer = uploads.LARGEST, io.BytesIO()
    np.savez_compressed(buffer, points=ARC, other=np.zeros(100 * largest, dtype=np.int8))
    assert len(buffer.getvalue()) < largest
    tracemalloc.start()
    uploads.opened(start_draft(), "points.npz", buffer.getvalue())
    assert tracemalloc.get_traced_memory()[1] < largest
    tracemalloc.stop()
    buffer = io.BytesIO()
    np.savez_compressed(buffer, points=np.zeros((largest // 24 + 1, 3)))
    with pytest.raises(SceneError, match=f"at most {largest} bytes"):
        uploads.opened(start_draft(), "points.npz", buffer.getvalue())


@pytest.fixture
def uploading(monkeypatch) -> Iterator[tuple[SceneClient, dict[str, bytes]]]:
    """A client that can only upload files of at most 1000 bytes, and the files that arrived."""
    files: dict[str, bytes] = {}

    def session(client: ClientHandle, *_: object) -> SimpleNamespace:
        button = client.gui.add_upload_button("Open")
        button.on_upload(lambda _: files.update({button.value.name: button.value.content}))
        transfers.limit_uploads(client, lambda name, error: client.add_notification(name, str(error)))
        return SimpleNamespace(tab="", close=lambda: None)

    monkeypatch.setattr(transfers, "LARGEST", 1000)
    monkeypatch.setattr(host, "Session", session)
    scenes = host.SceneHost(SimpleNamespace(runs=None), most=1)
    with SceneClient(f"ws://127.0.0.1:{scenes.port}", additional_headers={KEY_HEADER: scenes.key}) as client:
        client.wait_for(lambda: client.controls)
        yield client, files
    scenes.stop()


@pytest.mark.parametrize(("announced", "parts", "words"), [(1001, 0, "1001"), (8, 2, "1200")])
def test_a_file_that_is_too_large_is_dropped_while_it_is_uploaded(uploading, announced, parts, words):
    client, files = uploading
    transfer = client.begin_upload("Open", "large.json", announced, parts=3)
    for k in range(parts):
        client.send_part("Open", transfer, k, bytes(600))
    client.wait_for(lambda: client.notifications == ["large.json"] and client.arrived[transfer])
    assert client.notices == [f"file: got {words} bytes. Allowed: at most 1000 bytes."]
    client.upload("Open", "small.json", bytes(1000))
    wait_for(lambda: files)
    assert files == {"small.json": bytes(1000)}


def test_no_more_files_are_uploaded_at_once_than_the_page_has_buttons(uploading):
    client, files = uploading
    first = [client.begin_upload("Open", f"{k}.json", 10) for k in range(3)]
    client.wait_for(lambda: client.notifications == ["2.json"])
    assert client.notices == ["file: got 3 files at once. Allowed: at most 2."]
    for transfer in first:
        client.send_part("Open", transfer, 0, bytes(10))
    wait_for(lambda: len(files) == 2)
    client.listen(0.05)
    assert sorted(files) == ["0.json", "1.json"]


def test_a_refused_file_leaves_the_scene_as_it_was(service):
    with connected(service) as client:
        before = client.document
        client.upload("Open a file …", "scene.json", b"{")
        client.wait_for(lambda: "was not opened" in client.html("scene.json"))
        assert client.document == before


def test_a_dragged_bead_bends_the_start_shape_and_keeps_the_length_of_the_cable(service):
    with connected(service) as client:
        client.set("Drag its points", True)
        client.wait_for(lambda: "/start_shape" in client.nodes)
        end = [1.0, 0.0, 0.0]
        client.drag_node("start", "/start_shape", shapes.HANDLES - 1, end)
        client.drag_node("update", "/start_shape", shapes.HANDLES - 1, [0.9, -0.25, 0.0])
        client.drag_node("end", "/start_shape", shapes.HANDLES - 1, [0.9, -0.25, 0.0])
        document = client.wait_for(lambda: _bent(client.document))
        points = np.array(document["shape"]["points"])
        assert points[-1] == pytest.approx([0.9, -0.25, 0.0], abs=2e-5)  # points are written to 0.01 mm
        assert np.linalg.norm(np.diff(points, axis=0), axis=1).sum() == pytest.approx(1.0, abs=1e-3)
        client.refined()
        client.set("Drag its points", False)
        client.wait_for(lambda: "/start_shape" not in client.nodes)
        client.press("Make it straight")
        client.wait_for(lambda: client.document["shape"]["kind"] == "straight")


def _bent(document):
    return document if document["shape"]["kind"] == "points" else None


def test_a_chain_of_points_keeps_its_chords_when_one_is_dragged():
    points = shapes.handles(start_draft().start(NOTHING_STORED), 1.0)
    moved = shapes.dragged(points, 4, np.array([0.2, 0.3, 0.1]))
    chords = np.linalg.norm(np.diff(moved, axis=0), axis=1)
    np.testing.assert_allclose(chords, 1.0 / (shapes.HANDLES - 1), rtol=0, atol=1e-12)  # rounding
    np.testing.assert_array_equal(moved[4], [0.2, 0.3, 0.1])


@pytest.mark.parametrize("name", list(EXAMPLES))
def test_a_scene_can_be_given_another_length(name):
    draft = Draft.of({key: part for key, part in EXAMPLES[name]["value"].items() if key != "output"})
    before = draft.start(NOTHING_STORED)
    longer = shapes.scaled(draft, 1.5 * draft.length)
    scene = longer.scene(NOTHING_STORED)
    assert scene.cable.length == pytest.approx(1.5 * draft.length)
    given = [before(x * draft.length)[0] for x in (0.0, 1.0)]
    after = [longer.start(NOTHING_STORED)(x * longer.length)[0] for x in (0.0, 1.0)]
    assert np.linalg.norm(after[1] - after[0]) == pytest.approx(1.5 * np.linalg.norm(given[1] - given[0]), abs=FITTED)


def test_the_shell_line_asks_for_the_scene_on_show(service):
    with connected(service) as client:
        client.set("Table friction", 0.3)
        client.wait_for(lambda: '"friction":0.3' in client.markdown("curl -s"))
        line = client.markdown("curl -s")
        body = line.split(" -d '")[1].rsplit("'", 1)[0]
        assert json.loads(body) == client.document


def test_files_are_called_after_the_scene(service):
    with connected(service) as client:
        client.set("Name", "../An arc, 2 m")
        client.press("Download scene.json")
        client.wait_for(lambda: "An-arc-2-m-scene.json" in client.downloads)


@pytest.mark.parametrize(
    ("name", "expected"), [(None, "picture.png"), ("Schleife_3", "Schleife_3-picture.png"), ("/..", "picture.png")]
)
def test_a_name_makes_a_file_name_that_every_system_takes(name, expected):
    assert file_name(start_draft().put(("name",), name), "picture.png") == expected


def test_a_playback_is_saved_as_one_page_that_names_no_other_host(service):
    with connected(service) as client:
        client.press("Save playback.html")
        page = client.wait_for(lambda: client.downloads.get("playback.html"), timeout=60)
        assert page.startswith(b"<!")
        assert b"__VISER_EMBED_DATA__" in page
