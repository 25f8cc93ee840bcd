"""Predictions under way: taken up, followed, cancelled, kept or not."""

import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import anyio
import httpx
import numpy as np
import pytest
from fastapi.testclient import TestClient

from app.main import create_app
from app.schemas import PredictionList
from app.service import jobs
from app.service.service import Service
from app.settings import Settings
from tests.app.conftest import SLOW, paper_scene, start
from tests.app.live import Live, serving
from tests.app.test_bad_requests import the_problem

ASYNC = {"prefer": "respond-async"}
EVENTS = {"accept": "text/event-stream"}


@pytest.fixture(scope="module")
def live(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Live]:
    with serving(tmp_path_factory.mktemp("live"), workers="1") as service:
        yield service


def until(client: Any, address: str, *states: str) -> dict[str, Any]:
    give_up = time.monotonic() + 60
    while True:
        document: dict[str, Any] = client.get(address).json()
        if document["state"] in states:
            return document
        assert time.monotonic() < give_up
        time.sleep(0.02)


def parsed(text: str) -> list[tuple[str, str | None, dict[str, Any]]]:
    """Return name, id and data of server-sent events."""
    found = []
    for block in text.strip().split("\n\n"):
        fields = dict(line.split(": ", 1) for line in block.split("\n") if not line.startswith(":"))
        if fields:
            found.append((fields["event"], fields.get("id"), json.loads(fields["data"])))
    return found


def test_an_asynchronous_prediction_is_taken_up_and_then_there(client: TestClient) -> None:
    taken = client.post("/v1/predictions", json=SLOW, headers=ASYNC)
    assert taken.status_code == 202
    assert taken.headers["preference-applied"] == "respond-async"
    address = taken.headers["location"]
    document = taken.json()
    assert document["links"]["self"] == address == f"/v1/predictions/{document['id']}"
    assert document["state"] in ("queued", "running")
    found = PredictionList.model_validate(client.get("/v1/predictions").json(), strict=True).under_way
    assert (address, document["created"]) in {(item.links.self, item.created) for item in found}
    the_problem(client.get(f"{address}/surface.npz"), 409)
    the_problem(client.get(address, headers={"accept": "application/x-npz"}), 409)
    done = until(client, address, "done")
    assert done["status"] == "converged"
    assert (done["id"], done["created"]) == (document["id"], document["created"])
    assert document["id"] in {run["id"] for run in client.get("/v1/predictions").json()["predictions"]}
    assert client.get(f"{address}/scene.json").json() == SLOW


def test_one_may_wait_for_it_a_while(client: TestClient) -> None:
    quick = client.post("/v1/predictions", json=paper_scene(), headers={"prefer": "respond-async, wait=20"})
    assert quick.status_code == 201
    assert quick.json()["state"] == "done"
    slow = client.post("/v1/predictions", json=SLOW, headers={"prefer": "respond-async, wait=0"})
    assert slow.status_code == 202
    until(client, slow.headers["location"], "done")


def test_a_prediction_that_is_not_to_be_stored_is_not(client: TestClient) -> None:
    before = client.get("/v1/predictions").json()["total"]
    direct = client.post("/v1/predictions?store=false", json=paper_scene())
    assert direct.status_code == 200
    assert "location" not in direct.headers
    assert direct.json()["links"] is None
    the_problem(client.get(f"/v1/predictions/{direct.json()['id']}"), 404)

    taken = client.post("/v1/predictions?store=false", json=paper_scene(), headers=ASYNC)
    done = until(client, taken.headers["location"], "done")
    same = (done["surface"]["positions"], direct.json()["surface"]["positions"])
    np.testing.assert_allclose(*same, rtol=0, atol=1e-12)  # m: but for the order of additions
    assert client.get("/v1/predictions").json()["total"] == before
    assert client.delete(taken.headers["location"]).status_code == 204
    the_problem(client.get(taken.headers["location"]), 404)


@pytest.mark.parametrize("store", [True, False], ids=["stored", "not stored"])
def test_an_answer_that_comes_while_one_looks_for_it_is_given(
    client: TestClient, monkeypatch: pytest.MonkeyPatch, store: bool
) -> None:
    service: Service = client.app.state.service  # type: ignore[attr-defined]
    read = service.document

    def late(id: str) -> bytes | None:
        """Find nothing yet, and be done with it only when the answer is there."""
        found = read(id)
        give_up = time.monotonic() + 60
        while found is None and unfinished(id):
            assert time.monotonic() < give_up
            time.sleep(0.01)
        return found

    def unfinished(id: str) -> bool:
        job = service.jobs.get(id)
        return not (read(id) if job is None else job.finished.is_set())

    address = client.post(f"/v1/predictions?store={store}", json=SLOW, headers=ASYNC).headers["location"]
    monkeypatch.setattr(service, "document", late)
    found = client.get(address)
    assert found.status_code == 200
    assert found.json()["status"] == "converged"
    assert client.delete(address).status_code == 204


def test_a_running_solve_is_cancelled_at_once_and_then_removed(
    client: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(jobs, "CANCEL_TIME", 30.0)  # [s], on a machine that is busy with other things
    address = client.post("/v1/predictions", json=SLOW, headers=ASYNC).headers["location"]
    until(client, address, "running")
    cancelled = client.delete(address)
    assert cancelled.status_code == 200
    assert cancelled.json()["state"] == "cancelled"
    assert cancelled.json()["problem"]["type"] == "urn:dlo:problem:cancelled"
    assert client.get(address).json() == cancelled.json()
    assert client.delete(address).status_code == 204
    the_problem(client.get(address), 404)
    the_problem(client.delete(address), 404)


def test_a_solve_that_is_slow_to_stop_is_said_to_be_stopping(
    client: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(jobs, "CANCEL_TIME", 0.0)
    address = client.post("/v1/predictions", json=SLOW, headers=ASYNC).headers["location"]
    until(client, address, "running")
    stopping = client.delete(address)
    assert stopping.status_code == 202
    assert stopping.json()["state"] == "running"
    until(client, address, "cancelled")


def test_a_waiting_solve_is_cancelled_without_a_worker(tmp_path: Path) -> None:
    with TestClient(create_app(Settings(data_dir=tmp_path, workers=1))) as client:
        start(client)
        first, second = (client.post("/v1/predictions", json=SLOW, headers=ASYNC).headers["location"] for _ in range(2))
        assert client.get(second).json()["state"] == "queued"
        assert client.delete(second).json()["state"] == "cancelled"
        assert client.get(first).json()["state"] == "running"
        until(client, first, "done")
        assert client.post("/v1/predictions", json=paper_scene()).status_code == 201  # the place is free again


def test_an_impossible_scene_fails_with_its_problem_where_only_the_solver_finds_out(client: TestClient) -> None:
    scene = paper_scene(quality={"n_u": 9, "n_t": 5, "method": "march"})
    path = {"kind": "waypoints", "times": [0.0, 0.5, 1.0], "positions": [[0.25, 0, 0], [0.25, 0.1, 0], [0.25, 0.2, 0]]}
    scene["primitives"] = [
        {"u": 0.25, "path": path, "release_time": 0.3},
        {"u": 0.75, "path": {"kind": "still"}, "grasp_time": 0.5, "release_time": 0.7},
    ]
    direct = the_problem(client.post("/v1/predictions", json=scene), 422)
    address = client.post("/v1/predictions", json=scene, headers=ASYNC).headers["location"]
    assert until(client, address, "failed")["problem"] == direct
    (_, *_, last) = parsed(client.get(f"{address}/events").text)
    assert last == ("error", "0", direct)


def test_a_direct_prediction_is_followed_to_its_end(client: TestClient) -> None:
    response = client.post("/v1/predictions", json=paper_scene(), headers=EVENTS)
    assert response.headers["content-type"].startswith("text/event-stream")
    events = parsed(response.text)
    names = [name for name, _, _ in events]
    count = names.count("iteration")
    assert count >= 2
    first = names.index("iteration")
    assert names == [*["state"] * first, *["iteration"] * count, "done"]
    # a quick worker has begun before the answer does
    assert [event[2]["state"] for event in events[:first]] in (["queued", "running"], ["running"])
    assert [event[1] for event in events[first:]] == [str(i) for i in range(count + 1)]
    document = events[-1][2]
    assert [data for _, _, data in events[first:-1]] == document["iterations"]
    assert client.get(response.headers["location"]).json() == document


def test_a_solve_that_begins_while_its_state_is_told_is_told_running_before_its_iterations() -> None:
    async def course() -> list[Any]:
        job, told = jobs.Job(store=False), []
        async for news in job.progress():
            told.append(news)
            if news == "queued":  # the worker is quicker than the follower
                job.begin()
                job.add({"number": 0})
                job.end("done")
        return told

    # its end came with the first news, so no running is told any more
    assert anyio.run(course) == ["queued", {"number": 0}]

    async def slower() -> list[Any]:
        job, told = jobs.Job(store=False), []
        async for news in job.progress():
            told.append(news)
            if news == "queued":
                job.begin()
                job.add({"number": 0})
            else:
                job.end("done")
        return told

    assert anyio.run(slower) == ["queued", "running", {"number": 0}]


def test_who_comes_late_gets_the_same_events_first(client: TestClient) -> None:
    direct = client.post("/v1/predictions", json=paper_scene(), headers=EVENTS)
    address = f"{direct.headers['location']}/events"
    events = parsed(client.get(address, headers=EVENTS).text)
    assert events[1:] == [event for event in parsed(direct.text) if event[0] != "state"]
    assert events[0][2]["state"] == "done"
    resumed = parsed(client.get(address, headers={**EVENTS, "last-event-id": "0"}).text)
    assert resumed[1:] == events[2:]
    over = client.get(address, headers={**EVENTS, "last-event-id": events[-1][1] or ""})
    assert over.status_code == 204  # so that an EventSource stops connecting again
    the_problem(client.get(f"/v1/predictions/{'0' * 28}/events"), 404)


def test_two_clients_follow_one_solve_while_it_runs(live: Live) -> None:
    with httpx.Client(base_url=live.url, timeout=60) as http, httpx.Client(base_url=live.url, timeout=60) as other:
        address = http.post("/v1/predictions", json=SLOW, headers=ASYNC).headers["location"]
        with (
            http.stream("GET", f"{address}/events", headers=EVENTS) as first,
            other.stream("GET", f"{address}/events", headers=EVENTS) as second,
        ):
            texts = ["".join(stream.iter_text()) for stream in (first, second)]
        one, two = (parsed(text) for text in texts)
        assert [event for event in one if event[0] != "state"] == [event for event in two if event[0] != "state"]
        assert one[-1][0] == "done"
        assert one[0][2]["state"] in ("queued", "running")  # they came before its end


def test_a_follower_that_leaves_cancels_what_is_its_own_and_nothing_else(live: Live) -> None:
    with httpx.Client(base_url=live.url, timeout=60) as http:
        with http.stream("POST", "/v1/predictions", json=SLOW, headers=EVENTS) as stream:
            own = stream.headers["location"]
            next(stream.iter_text())
        assert until(http, own, "cancelled", "done")["state"] == "cancelled"
        shared = http.post("/v1/predictions", json=SLOW, headers=ASYNC).headers["location"]
        with http.stream("GET", f"{shared}/events", headers=EVENTS) as stream:
            next(stream.iter_text())
        assert until(http, shared, "cancelled", "done")["state"] == "done"


def test_the_health_is_answered_while_solves_run(live: Live) -> None:
    with httpx.Client(base_url=live.url, timeout=60) as http:
        address = http.post("/v1/predictions", json=SLOW, headers=ASYNC).headers["location"]
        assert http.get("/health").json()["status"] == "ok"
        assert http.get(address).json()["state"] != "done"
        until(http, address, "done")
