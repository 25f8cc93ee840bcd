"""Stored runs are found by what they are."""

from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from app.main import create_app
from app.settings import Settings
from tests.app.conftest import paper_scene, start
from tests.app.test_bad_requests import the_problem


def ids(client: TestClient, query: str) -> list[str]:
    response = client.get(f"/v1/predictions?{query}")
    assert response.status_code == 200, response.text
    return [run["id"] for run in response.json()["predictions"]]


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Any:
    settings = Settings(data_dir=tmp_path_factory.mktemp("data"))
    with TestClient(create_app(settings)) as client:
        start(client)
        spacetime = {"n_u": 9, "n_t": 13, "delta": 1e-5}
        scenes = [
            paper_scene(name="Along the wall"),
            paper_scene(name="along the floor", quality=spacetime),
            paper_scene(quality={"time_budget": 1e-4}),
        ]
        yield client, [client.post("/v1/predictions", json=scene).json() for scene in scenes]


def test_runs_are_filtered_by_status_method_and_name(stored: Any) -> None:
    client, (wall, floor, hurried) = stored
    assert hurried["status"] == "time_limit"
    assert ids(client, "status=time_limit") == [hurried["id"]]
    assert ids(client, "status=time_limit&status=converged") == [hurried["id"], floor["id"], wall["id"]]
    assert ids(client, "method=spacetime") == [floor["id"]]
    assert ids(client, "name=ALONG") == [floor["id"], wall["id"]]
    assert ids(client, "name=ALONG&method=march") == [wall["id"]]
    assert ids(client, "name=ceiling") == []


def test_runs_are_filtered_by_time(stored: Any) -> None:
    client, (wall, floor, hurried) = stored
    assert ids(client, f"since={floor['created']}") == [hurried["id"], floor["id"]]
    assert ids(client, f"before={floor['created']}") == [wall["id"]]
    assert ids(client, f"since={floor['created']}&before={hurried['created']}") == [floor["id"]]
    assert ids(client, "since=2999-01-01T00:00:00%2B01:00") == []
    assert len(ids(client, "since=0001-01-01T00:00:00%2B14:00&before=9999-12-31T23:59:59-14:00")) == 3


def test_pages_are_not_shifted_by_runs_that_come_or_go(stored: Any) -> None:
    client, runs = stored
    first = client.get("/v1/predictions?limit=1&name=along").json()
    assert first["total"] == 2
    newer = client.post("/v1/predictions", json=paper_scene(name="along the beam")).json()
    second = client.get(first["next"]).json()
    assert [run["id"] for run in second["predictions"]] == [runs[0]["id"]]
    assert second["next"] is None
    assert second["total"] == 3
    assert client.delete(newer["links"]["self"]).status_code == 204
    assert client.get(first["next"]).json()["total"] == 2


@pytest.mark.parametrize(
    ("query", "field"),
    [
        ("status=done", "status[0]"),
        ("method=magic", "method"),
        ("since=yesterday", "since"),
        ("since=1700000000", "since"),
        ("since=2026-01-31T12:00:00", "since"),
        ("before=2026-02-31T12:00:00Z", "before"),
        ("cursor=../x", "cursor"),
        ("cursor=", "cursor"),
        ("limit=0", "limit"),
        ("limit=1001", "limit"),
        ("limit=x", "limit"),
        ("offset=-1", "offset"),
        (f"name={'x' * 201}", "name"),
    ],
)
def test_a_wrong_query_parameter_is_named(client: TestClient, query: str, field: str) -> None:
    problem = the_problem(client.get(f"/v1/predictions?{query}"), 422)
    assert [error["field"] for error in problem["errors"]] == [field]


def test_an_unstored_run_is_never_listed_nor_found_after_a_restart(tmp_path: Path) -> None:
    settings = Settings(data_dir=tmp_path)
    with TestClient(create_app(settings)) as first:
        start(first)
        kept = first.post("/v1/predictions", json=paper_scene()).json()["id"]
        headers = {"prefer": "respond-async"}
        address = first.post("/v1/predictions?store=false", json=paper_scene(), headers=headers).headers["location"]
        assert ids(first, "") == [kept]
    with TestClient(create_app(settings)) as second:
        assert ids(second, "") == [kept]
        the_problem(second.get(address), 404)
