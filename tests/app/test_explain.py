"""A scene is explained without solving it, and everything that is wrong with it is named."""

import pytest
from fastapi.testclient import TestClient

from app.schemas.plan import PlanResponse
from tests.app.conftest import contract_scene, paper_scene, put
from tests.app.test_bad_requests import the_problem

EXPLAIN = "/v1/scenes:explain"


def test_what_is_explained_is_what_is_then_done(client: TestClient) -> None:
    scene = contract_scene("paper-fig1")
    before = client.get("/v1/predictions").json()["total"]
    response = client.post(EXPLAIN, json=scene)
    assert response.status_code == 200, response.text
    plan = response.json()
    PlanResponse.model_validate(plan, strict=True)
    assert client.get("/v1/predictions").json()["total"] == before
    document = client.post("/v1/predictions", json=scene).json()
    done = document["accuracy"]
    assert [plan[name] for name in ("method", "dimensions", "n_u", "n_t")] == [
        done[name] for name in ("method", "dimensions", "n_u", "n_t")
    ]
    assert plan["reason"]
    active = {effect["name"] for effect in document["effects"] if effect["active"]}
    assert {effect["name"] for effect in plan["effects"] if effect["active"]} == active
    assert 0 < plan["expected_time"] < 60


def test_everything_that_is_wrong_is_named_at_once(client: TestClient) -> None:
    scene = put(paper_scene(), "cable.diameter", 0.9)
    scene = put(scene, "primitives.0.path.rotation", [0, 0, 1])
    post = {"kind": "cylinder", "center": [0.5, 0.9, 0], "axis": [0, 0, 0], "radius": 0.02, "height": 0.1}
    ball = {"kind": "capsule", "start": [0.5, 0.9, 0], "end": [0.5, 0.9, 0], "radius": 0.02}
    scene = put(scene, "environment.obstacles", [post, ball])
    scene = put(scene, "quality", {"n_u": 9})
    problem = the_problem(client.post(EXPLAIN, json=scene), 422)
    assert {error["field"] for error in problem["errors"]} == {
        "cable.diameter",
        "primitives[0].path.rotation",
        "environment.obstacles[0].axis",
        "environment.obstacles[1].end",
        "quality.n_t",
    }


@pytest.mark.parametrize(("path", "value"), [("cable.length", "x"), ("primitives.0.u", 1.5), ("solver", 1)])
def test_a_wrong_scene_is_refused_as_it_would_be_for_solving(client: TestClient, path: str, value: object) -> None:
    scene = put(paper_scene(), path, value)
    assert client.post(EXPLAIN, json=scene).json() == client.post("/v1/predictions", json=scene).json()
