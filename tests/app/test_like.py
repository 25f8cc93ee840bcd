"""Predictions that go on from others: by address, in batches, and where there is nothing to go on from."""

import json
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

from app.schemas import PredictionRequest, to_scene
from app.service.jobs import Job, State
from app.service.service import Service
from app.store.recent import Recent, size_of
from dlocore import Prediction, predict, sensitivities
from tests.app.conftest import paper_scene
from tests.app.test_bad_requests import the_problem
from tests.examples.test_api_guide import section
from tests.solver.scenes import march
from tests.solver.scenes import paper_scene as solver_scene

TARGET = {"target_error": 0.001}
KEPT = "On the grid of a motion"
AFRESH = "Solved from the beginning"
SERVED = "http://127.0.0.1:8000"


def moved(by: float) -> dict[str, Any]:
    scene = paper_scene(quality=TARGET)
    scene["primitives"][0]["path"]["displacement"] = [0.0, 0.5 + by, 0.0]
    return scene


def test_a_prediction_goes_on_from_another_stored_or_not(client: TestClient) -> None:
    for store in ("true", "false"):
        first = client.post(f"/v1/predictions?store={store}", json=moved(0.0)).json()
        found = client.post(f"/v1/predictions?like={first['id']}", json=moved(0.01))
        assert found.status_code == 201, found.text
        document = found.json()
        assert KEPT in document["message"]
        assert document["accuracy"]["n_u"] == first["accuracy"]["n_u"]
        assert len(document["iterations"]) == 1 < len(first["iterations"])
        further = client.post(f"/v1/predictions?like={document['id']}&store=false", json=moved(0.02)).json()
        assert KEPT in further["message"]


def test_a_batch_goes_on_from_one(client: TestClient) -> None:
    first = client.post("/v1/predictions", json=moved(0.0)).json()
    body = {"scenes": [moved(0.005), moved(0.01)], "like": first["id"]}
    lines = client.post("/v1/predictions:batch", json=body).text.splitlines()
    assert all(KEPT in json.loads(line)["result"]["message"] for line in lines)
    assert len(lines) == 2


def test_the_guides_difference_of_two_motions_is_the_derivative(client: TestClient) -> None:
    scene = {
        "cable": {"preset": "paper"},
        "shape": {"kind": "straight"},
        "primitives": [{"u": 0.25, "path": {"kind": "move", "displacement": [0, 0.5, 0], "duration": 1.6}}],
        "environment": {"drag": 0.05, "table": {}},
    }
    run = client.post("/v1/predictions?store=false", json=scene).json()
    sent = SimpleNamespace(post=lambda url, json, timeout: client.post(url.removeprefix(SERVED), json=json))
    names: dict[str, Any] = {"httpx": sent, "json": json, "np": np, "scene": scene, "run": run}
    exec(section("Derivatives of a motion"), names)
    known = predict(to_scene(PredictionRequest.model_validate(scene), lambda id: None))
    u, t = (np.array(run["surface"][name]) for name in "ut")
    exact = sensitivities(known, ["grasps[0].path.displacement[1]"])(u, t)[0]
    assert np.abs(names["slope"] - exact).max() < 2e-6 * np.abs(exact).max()


def test_what_is_forgotten_is_solved_from_the_beginning_and_says_so(client: TestClient) -> None:
    service: Service = client.app.state.service  # type: ignore[attr-defined]
    first = client.post("/v1/predictions", json=moved(0.0)).json()
    service.recent.forget(first["id"])
    found = client.post(f"/v1/predictions?like={first['id']}", json=moved(0.01)).json()
    assert found["status"] == "converged"
    assert f"{AFRESH}: The previous prediction is no longer in memory." in found["message"]


def test_an_id_that_is_none_is_refused(client: TestClient) -> None:
    gone = client.post("/v1/predictions", json=moved(0.0)).json()["id"]
    assert client.delete(f"/v1/predictions/{gone}").status_code == 204
    for like, status in ((gone, 404), ("0" * 28, 404), ("", 422), ("../../etc", 422), ("x" * 28, 422)):
        the_problem(client.post("/v1/predictions", params={"like": like}, json=moved(0.0)), status)
        body = {"scenes": [moved(0.0)], "like": like}
        the_problem(client.post("/v1/predictions:batch", json=body), status)


def job_in(client: TestClient, state: State) -> Job:
    """Return a prediction that is not stored and has no answer, in this state."""

    def put() -> Job:
        job = Job(store=False)
        client.app.state.service.jobs.add(job)  # type: ignore[attr-defined]
        job.begin()
        if state != "running":
            job.end(state)
        return job

    assert client.portal is not None
    return client.portal.call(put)


@pytest.mark.parametrize(("state", "wait"), [("running", "1"), ("cancelled", None)])
def test_one_without_an_answer_is_refused_with_its_state(client: TestClient, state: State, wait: str | None) -> None:
    id = job_in(client, state).id
    body = {"scenes": [moved(0.0)], "like": id}
    for path, query, sent in (("", {"like": id}, moved(0.0)), (":batch", {}, body)):
        response = client.post(f"/v1/predictions{path}", params=query, json=sent)
        told = the_problem(response, 409)["detail"]
        assert told == f"like: The prediction is {state}; only one that is done can be reused."
        assert response.headers.get("retry-after") == wait


@pytest.mark.parametrize(
    ("state", "told"), [("running", "running"), ("cancelled", "cancelled"), ("done", "not stored")]
)
def test_a_start_from_one_that_is_not_stored_is_refused_with_its_state(
    client: TestClient, state: State, told: str
) -> None:
    scene = paper_scene(shape={"kind": "prediction", "id": job_in(client, state).id})
    for path in ("/v1/predictions", "/v1/scenes:explain"):
        (error,) = the_problem(client.post(path, json=scene), 422)["errors"]
        assert error["message"].startswith(f"That prediction is {told}.")
    assert f"That prediction is {told}." in client.post("/v1/predictions:batch", json={"scenes": [scene]}).text


def test_the_oldest_are_forgotten_when_there_are_too_many() -> None:
    prediction: Prediction = predict(solver_scene(0.25, quality=march(9, 13)))
    room = Recent(most=int(2.5 * size_of(prediction)))
    for id in ("a", "b", "c"):
        room.add(id, prediction)
    assert room.get("c") is prediction
    assert room.get("a") is None
    for _ in range(100):  # one that is added again takes its place only once
        room.add("c", prediction)
    assert room.get("b") is prediction
    room.forget("c")
    room.forget("c")
    assert room.get("c") is None


def test_what_an_answer_took_its_error_estimate_from_counts_with_it() -> None:
    before: Prediction = predict(solver_scene(0.25, quality=march(9, 13)))
    again = predict(solver_scene(0.25, quality=march(9, 13)), like=before)
    assert again.judged is before
    assert again.level is not None
    assert size_of(again) > size_of(before) + again.level.motion.states.nbytes
