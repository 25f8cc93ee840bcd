"""Many predictions in one request."""

import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
from fastapi.testclient import TestClient

from app.main import create_app
from app.schemas import PredictionResponse
from app.settings import Settings
from tests.app.conftest import SLOW, paper_scene, put, start
from tests.app.live import Live, serving
from tests.app.test_bad_requests import the_problem

BATCH = "/v1/predictions:batch"


def lines(text: str) -> list[dict[str, Any]]:
    return [json.loads(line) for line in text.splitlines()]


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Live]:
    with serving(tmp_path_factory.mktemp("live"), workers="2") as service:
        yield service


def test_a_bad_scene_is_a_line_of_its_own_and_spoils_no_other(client: TestClient, answer: dict[str, Any]) -> None:
    before = client.get("/v1/predictions").json()["total"]
    scenes = [paper_scene(), put(paper_scene(), "primitives.0.u", 1.5), "scene", put(paper_scene(), "solver", 1), None]
    response = client.post(BATCH, json={"scenes": [*scenes, paper_scene()]})
    assert response.status_code == 200
    assert response.headers["content-type"] == "application/jsonl"
    found = lines(response.text)
    assert [line["index"] for line in found] == list(range(6))
    assert [line["status"] for line in found] == ["converged", *["failed"] * 4, "converged"]
    for line, scene in zip(found[1:5], scenes[1:], strict=True):
        assert set(line) == {"index", "status", "problem"}
        if isinstance(scene, dict):
            assert line["problem"] == the_problem(client.post("/v1/predictions", json=scene), 422)
        else:
            assert [error["field"] for error in line["problem"]["errors"]] == ["body"]
    for line in (found[0], found[5]):
        PredictionResponse.model_validate(line["result"], strict=True)
        np.testing.assert_allclose(line["result"]["surface"]["positions"], answer["surface"]["positions"], atol=1e-12)
        assert line["result"]["links"] is None
    assert client.get("/v1/predictions").json()["total"] == before


def test_half_a_surrogate_pair_spoils_no_other_line(client: TestClient) -> None:
    wrong = [paper_scene(name="\ud800"), {**paper_scene(), "\ud800": 1}, "\ud800"]
    body = json.dumps({"scenes": [paper_scene(), *wrong, paper_scene()], "store": True, "fields": []})
    found = lines(client.post(BATCH, content=body, headers={"content-type": "application/json"}).text)
    assert [line["status"] for line in found] == ["converged", *["failed"] * 3, "converged"]
    fields = [error["field"] for line in found[1:4] for error in line["problem"]["errors"]]
    assert fields == ["name", "body", "body"]


def test_one_scene_is_moved_in_many_ways_and_stored_where_asked(client: TestClient) -> None:
    ways = [put(paper_scene(), "primitives.0.path.displacement", [0, y, 0])["primitives"] for y in (0.1, 0.2, 0.3)]
    response = client.post(BATCH, json={"scene": paper_scene(name="sweep"), "primitives": ways, "store": True})
    for line, y in zip(lines(response.text), (0.1, 0.2, 0.3), strict=True):
        assert line["result"]["surface"]["positions"][-1][25][1] == pytest.approx(y, abs=1e-9)
        links = line["result"]["links"]
        assert client.get(links["self"]).json() == line["result"]
        assert client.get(links["scene"]).json()["primitives"] == ways[line["index"]]
    assert client.get("/v1/predictions?name=SWEEP").json()["total"] == 3


@pytest.mark.parametrize("fields", [[], ["surface", "grasps"]])
@pytest.mark.parametrize("store", [False, True])
def test_a_result_has_the_fields_that_are_asked_for_and_a_stored_run_all(
    client: TestClient, answer: dict[str, Any], fields: list[str], store: bool
) -> None:
    batch = {"scenes": [paper_scene()], "fields": fields, "store": store}
    (line,) = lines(client.post(BATCH, json=batch).text)
    result = line["result"]
    always = {"id", "state", "created", "status", "message", "accuracy", "links"}
    assert set(result) == always | set(fields)
    for name in fields:
        assert result[name] == answer[name]
    if store:
        stored = client.get(result["links"]["self"]).json()
        assert {name: stored[name] for name in result} == result
        PredictionResponse.model_validate(stored, strict=True)


def test_lines_come_as_they_finish_where_asked(client: TestClient) -> None:
    scenes = [SLOW, *[paper_scene()] * 5]
    as_they_finish = lines(client.post(BATCH, json={"scenes": scenes, "order": "finished"}).text)
    assert sorted(line["index"] for line in as_they_finish) == list(range(6))
    if client.app.state.service.worker.workers > 1:  # type: ignore[attr-defined]
        assert as_they_finish[-1]["index"] == 0
    in_order = lines(client.post(BATCH, json={"scenes": scenes}).text)
    assert [line["index"] for line in in_order] == list(range(6))


@pytest.mark.parametrize(
    ("body", "field"),
    [
        ({}, "scenes"),
        ({"scenes": []}, "scenes"),
        ({"scenes": {}}, "scenes"),
        ({"scene": paper_scene()}, "primitives"),
        ({"scene": 3, "primitives": [[]]}, "scene"),
        ({"scenes": [1], "store": "yes"}, "store"),
        ({"scenes": [1], "order": "any"}, "order"),
        ({"scenes": [1], "fields": ["shape"]}, "fields[0]"),
        ([], "body"),
    ],
    ids=range(9),
)
def test_a_batch_that_is_none_is_refused_as_a_whole(client: TestClient, body: Any, field: str) -> None:
    problem = the_problem(client.post(BATCH, json=body), 422)
    assert [error["field"] for error in problem["errors"]] == [field]


@pytest.mark.parametrize("more", [{}, {"primitives": [[]]}], ids=["alone", "with-primitives"])
def test_a_batch_of_both_forms_is_told_that_one_is_wanted(client: TestClient, more: dict[str, Any]) -> None:
    body = {"scenes": [paper_scene()], "scene": paper_scene(), **more}
    (error,) = the_problem(client.post(BATCH, json=body), 422)["errors"]
    assert error["field"] == "body"
    assert error["message"] == "Got scene and scenes. Allowed: one of the two: scenes, or scene with primitives."


def test_a_batch_has_a_bound(tmp_path: Path) -> None:
    with TestClient(create_app(Settings(data_dir=tmp_path, max_batch=2))) as client:
        start(client)
        assert client.post(BATCH, json={"scenes": [paper_scene()] * 2}).status_code == 200
        problem = the_problem(client.post(BATCH, json={"scenes": [paper_scene()] * 3}), 413)
        assert problem["detail"].startswith("scenes: got 3. Allowed: at most 2")
        sweep = {"scene": paper_scene(), "primitives": [paper_scene()["primitives"]] * 4}
        problem = the_problem(client.post(BATCH, json=sweep), 413)
        assert problem["detail"].startswith("primitives: got 4. Allowed: at most 2")
        assert client.app.state.service.worker.admitted == 0  # type: ignore[attr-defined]


def test_all_workers_are_used_and_a_client_that_leaves_cancels_the_rest(live: Live) -> None:
    with httpx.Client(base_url=live.url, timeout=60) as http:
        with http.stream("POST", BATCH, json={"scenes": [SLOW] * 40}) as stream:
            give_up = time.monotonic() + 30
            while gauge(http, "dlo_running") < 2:
                assert time.monotonic() < give_up, "a worker stands idle"
                time.sleep(0.01)
            for line in stream.iter_lines():
                assert json.loads(line)["status"] == "converged"
                if json.loads(line)["index"] == 1:
                    break
        give_up = time.monotonic() + 30
        while gauge(http, "dlo_running") or gauge(http, "dlo_queue_depth"):
            assert time.monotonic() < give_up, "the rest of the batch went on"
            time.sleep(0.02)
        assert http.post("/v1/predictions", json=paper_scene()).status_code == 201


def gauge(http: httpx.Client, name: str) -> int:
    text = http.get("/metrics").text
    return int(float(next(line.split()[1] for line in text.splitlines() if line.startswith(f"{name} "))))
