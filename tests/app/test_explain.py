"""A scene is explained without solving it, and everything that is wrong with it is named."""

from typing import Any

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


MOVE = {"kind": "move", "displacement": [0, 0.5, 0], "duration": 1.6}
BALL = {"kind": "sphere", "radius": 0.02}
FAR, IN_CABLE = {**BALL, "center": [0.5, -0.9, 0]}, {**BALL, "center": [0.9, 0, 0]}


@pytest.mark.parametrize(
    ("parts", "wrong"),
    [
        (
            {"primitives": [{"u": u, "path": MOVE} for u in (2, 0.3, 3)]},
            {"primitives[0].u": "Got 2.0.", "primitives[2].u": "Got 3.0."},
        ),
        (
            {"environment": {"table": {"height": 0.1}, "obstacles": [FAR, IN_CABLE, FAR, IN_CABLE]}},
            {
                "environment.table.height": "Got 0.1.",
                "environment.obstacles[1]": "The cable starts",
                "environment.obstacles[3]": "The cable starts",
            },
        ),
        (
            # the only path of some length is left out, which must not call for a horizon
            {
                "primitives": [{"u": 0.5, "path": {"kind": "still"}}, {"u": 2, "path": MOVE}],
                "loads": [{"u": 1.5, "force": [0, 0, 1]}],
                "environment": {"obstacles": [IN_CABLE]},
            },
            {"primitives[1].u": "Got 2.0.", "loads[0].u": "Got 1.5.", "environment.obstacles[0]": "The cable starts"},
        ),
        (
            # the last is held at the place of the second, and told of by the numbers of the request
            {"primitives": [{"u": u, "path": {"kind": "still"}} for u in (2, 0.3, 0.3)], "horizon": 1.0},
            {"primitives[0].u": "Got 2.0.", "primitives[2].u": "primitives[1] holds it at 0.3 m at the same time."},
        ),
        (
            # of the points there is no curve, so that nothing can be outside of it; the rest is still looked at
            {
                "shape": {"kind": "points", "points": [[0, 0], [1, 0], [2, 0], [3, 0]]},
                "environment": {"obstacles": [{**BALL, "kind": "capsule", "start": [0, 1, 0], "end": [0, 1, 0]}]},
            },
            {"shape.points": "Got a curve 3 m long.", "environment.obstacles[0].end": "Got [0.0, 1.0, 0.0]."},
        ),
        ({"effects": {"stretch": "off"}}, {"effects.stretch": "Got off."}),
    ],
)
def test_parts_that_contradict_the_rest_are_named_at_once(
    client: TestClient, parts: dict[str, Any], wrong: dict[str, str]
) -> None:
    problem = the_problem(client.post(EXPLAIN, json=paper_scene(**parts)), 422)
    assert {error["field"] for error in problem["errors"]} == set(wrong)
    for error in problem["errors"]:
        assert wrong[error["field"]] in error["message"]


def test_a_scene_with_very_many_faults_does_not_give_an_endless_answer(client: TestClient) -> None:
    scene = paper_scene(loads=[{"u": 2, "force": [0, 0, 1]}] * 100)
    assert len(the_problem(client.post(EXPLAIN, json=scene), 422)["errors"]) == 50


@pytest.mark.parametrize(("path", "value"), [("cable.length", "x"), ("primitives.0.u", 1.5), ("solver", 1)])
def test_a_wrong_scene_is_refused_as_it_would_be_for_solving(client: TestClient, path: str, value: object) -> None:
    scene = put(paper_scene(), path, value)
    assert client.post(EXPLAIN, json=scene).json() == client.post("/v1/predictions", json=scene).json()
