"""A recording read back: entities, timelines, and values equal to the answer's."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

pytest.importorskip("rerun")
import rerun as rr

LOGS = ("update", "residual")
ENTITIES = {
    "update": "/convergence/update",
    "residual": "/convergence/residual",
    "energy": "/energy/elastic",
    "damping": "/step/damping",
    "step_length": "/step/length",
}


@pytest.fixture(scope="module")
def chunks(client: TestClient, answer: dict[str, Any], tmp_path_factory: pytest.TempPathFactory) -> list[Any]:
    path = tmp_path_factory.mktemp("rrd") / "run.rrd"
    response = client.get(answer["links"]["recording"])
    assert response.status_code == 200
    path.write_bytes(response.content)
    reader = rr.chunk.RrdReader(path)
    (store,) = reader.recordings()
    assert store.application_id == "dlo"
    assert store.recording_id == answer["id"]
    return list(reader.stream(store=store).to_chunks())


def rows(chunks: list[Any], entity: str, component: str, timeline: str) -> tuple[list[Any], list[Any]]:
    """Return the times and the values of a component over a timeline; durations in seconds."""
    times: list[Any] = []
    values: list[Any] = []
    for chunk in chunks:
        if chunk.entity_path != entity or chunk.is_static:
            continue
        batch = chunk.to_record_batch()
        column = next(name for name in batch.schema.names if name.endswith(f":{component}"))
        whole = batch.column(timeline).cast("int64").to_pylist()  # nanoseconds, or a sequence
        times += whole if timeline == "iteration" else [1e-9 * t for t in whole]
        values += batch.column(column).to_pylist()
    return times, values


@pytest.mark.parametrize("field", ENTITIES)
def test_scalars_are_those_of_the_iterations(chunks: list[Any], answer: dict[str, Any], field: str) -> None:
    numbers, values = rows(chunks, ENTITIES[field], "scalars", "iteration")
    shown = {i["number"]: i[field] for i in answer["iterations"] if i[field] is not None}
    if field in LOGS:  # a zero has no logarithm and no row
        shown = {number: value for number, value in shown.items() if value > 0}
    assert numbers == list(shown)
    for number, (value,) in zip(numbers, values, strict=True):
        expected = math.log10(shown[number]) if field in LOGS else shown[number]
        assert value == pytest.approx(expected, rel=1e-12)


def test_the_solver_time_is_that_of_the_iterations(chunks: list[Any], answer: dict[str, Any]) -> None:
    times, _ = rows(chunks, "/energy/elastic", "scalars", "solver_time")
    assert times == pytest.approx([i["wall_time"] for i in answer["iterations"]], abs=2e-9)  # whole nanoseconds


def test_every_iterate_is_drawn_with_its_net(chunks: list[Any], answer: dict[str, Any]) -> None:
    numbers, shapes = rows(chunks, "/iterate/shape", "strips", "iteration")
    _, nets = rows(chunks, "/iterate/net", "positions", "iteration")
    assert numbers == [i["number"] for i in answer["iterations"]]
    assert [len(net) for net in nets] == [i["n_u"] * i["n_t"] for i in answer["iterations"]]
    last = np.array(answer["control_points"])[..., :3].reshape(-1, 3)
    np.testing.assert_allclose(nets[-1], last, rtol=0, atol=1e-6)  # single precision
    end = np.array(shapes[-1][-1])  # the last of the strips over time is the shape at the end
    np.testing.assert_allclose(end[[0, -1]], np.array(answer["surface"]["positions"])[-1, [0, -1]], rtol=0, atol=1e-6)


def test_the_motion_is_that_of_the_surface(chunks: list[Any], answer: dict[str, Any]) -> None:
    times, strips = rows(chunks, "/motion/cable", "strips", "motion")
    assert times == pytest.approx(answer["surface"]["t"], abs=2e-9)
    drawn = np.array([strip for (strip,) in strips])
    np.testing.assert_allclose(drawn, answer["surface"]["positions"], rtol=0, atol=1e-6)


def test_grasps_and_their_forces_move_along(chunks: list[Any], answer: dict[str, Any]) -> None:
    _, held = rows(chunks, "/motion/grasps/0", "positions", "motion")
    np.testing.assert_allclose([p for (p,) in held], np.array(answer["surface"]["positions"])[:, 25], rtol=0, atol=1e-6)
    _, arrows = rows(chunks, "/motion/reactions/0", "vectors", "motion")
    drawn, forces = np.array([a for (a,) in arrows]), np.array(answer["grasps"][0]["reaction"])
    largest = np.linalg.norm(forces, axis=1).max()
    assert np.linalg.norm(drawn, axis=1).max() == pytest.approx(0.25, rel=1e-5)  # a quarter of the cable's length
    np.testing.assert_allclose(drawn, forces * 0.25 / largest, rtol=0, atol=1e-6)


def test_the_report_has_status_effects_and_scene(chunks: list[Any], answer: dict[str, Any]) -> None:
    (chunk,) = [chunk for chunk in chunks if chunk.entity_path == "/report"]
    batch = chunk.to_record_batch().to_pydict()
    ((text,),) = next(values for name, values in batch.items() if name.endswith(":text"))
    assert answer["status"] in text
    assert answer["message"] in text
    assert answer["accuracy"]["method"] in text
    for effect in answer["effects"]:
        assert effect["name"] in text
    assert '"bending_stiffness": 0.001' in text


def test_a_recording_is_written_once_and_kept(client: TestClient, answer: dict[str, Any]) -> None:
    first = client.get(answer["links"]["recording"])
    assert client.get(answer["links"]["recording"]).content == first.content


def test_the_layout_is_for_these_recordings(client: TestClient, tmp_path: Path) -> None:
    path = tmp_path / "layout.rbl"
    path.write_bytes(client.get("/rerun/layout.rbl").content)
    (store,) = rr.chunk.RrdReader(path).blueprints()
    assert store.application_id == "dlo"


def test_the_viewer_link_opens_layout_and_recording_from_this_service(
    client: TestClient, answer: dict[str, Any]
) -> None:
    response = client.get(answer["links"]["viewer"], follow_redirects=False)
    assert response.status_code == 307
    address = response.headers["location"]
    assert address.startswith("/rerun/?")
    assert f"url=http://testserver{answer['links']['recording']}" in address
    assert "url=http://testserver/rerun/layout.rbl" in address
    page = client.get(address)
    assert "re_viewer.js" in page.text
    assert "connect-src 'self'" in page.headers["content-security-policy"]
    wasm = client.get("/rerun/re_viewer_bg.wasm")
    assert wasm.headers["content-type"] == "application/wasm"
    assert wasm.content[:4] == b"\0asm"
    assert client.get("/rerun/../settings").status_code == 404
