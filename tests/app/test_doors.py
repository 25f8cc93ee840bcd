"""The same scene through every door gives the same surface, as the contract lays it out."""

import io
import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

from app.archive import surface_npz
from app.schemas import EXAMPLES, PredictionRequest, PredictionResponse, to_scene
from dlocore import predict
from tests.app.conftest import ROOT, contract_scene, paper_scene, put

# of each gripper, in JSON and in arrays
GIVEN = (
    "reaction",
    "moment",
    "reaction_error",
    "moment_error",
    "peak_force",
    "peak_force_time",
    "peak_moment",
    "peak_moment_time",
)
SAME = {"rtol": 0.0, "atol": 1e-12}  # m: the same compiled code on the same numbers, but for the order of additions


def arrays(content: bytes) -> dict[str, np.ndarray]:
    with np.load(io.BytesIO(content), allow_pickle=False) as archive:
        return dict(archive)


def nothing_stored(id: str) -> None:
    return None


def test_http_answers_with_the_surface_that_python_predicts(answer: dict[str, Any]) -> None:
    prediction = predict(to_scene(PredictionRequest.model_validate(paper_scene()), nothing_stored))
    u, t, q = prediction.surface.sample(101, 33)
    np.testing.assert_allclose(answer["surface"]["u"], u, **SAME)
    np.testing.assert_allclose(answer["surface"]["t"], t, **SAME)
    np.testing.assert_allclose(answer["surface"]["positions"], q[..., :3], **SAME)
    np.testing.assert_allclose(answer["surface"]["twist"], q[..., 3], **SAME)
    np.testing.assert_allclose(answer["control_points"], prediction.surface.control_points, **SAME)
    assert np.ptp(q[..., 1]) > 0.3  # m: the cable has moved, so equal surfaces mean something


def test_the_command_line_writes_the_surface_that_http_answers_with(answer: dict[str, Any], tmp_path: Path) -> None:
    scene, npz, full = tmp_path / "scene.json", tmp_path / "out.npz", tmp_path / "out.json"
    scene.write_text(json.dumps(paper_scene()))
    command = [sys.executable, "-m", "app.cli", "predict", str(scene), "-o", str(npz), "--json", str(full)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=240, cwd=ROOT)
    assert done.returncode == 0, done.stderr
    written, document = arrays(npz.read_bytes()), json.loads(full.read_text())
    for name in ("u", "t", "positions", "twist"):
        np.testing.assert_allclose(written[name], answer["surface"][name], **SAME)
        np.testing.assert_allclose(document["surface"][name], answer["surface"][name], **SAME)
    np.testing.assert_allclose(written["control_points"], answer["control_points"], **SAME)


def test_npz_holds_what_json_holds(client: TestClient, answer: dict[str, Any]) -> None:
    by_link = arrays(client.get(answer["links"]["surface"]).content)
    negotiated = client.get(answer["links"]["self"], headers={"accept": "application/x-npz"})
    assert negotiated.headers["content-type"] == "application/x-npz"
    by_accept = arrays(negotiated.content)
    for npz in (by_link, by_accept):
        for name in ("u", "t", "positions", "twist"):
            np.testing.assert_array_equal(npz[name], answer["surface"][name])
        for name in ("control_points", "knots_u", "knots_t", "degree"):
            np.testing.assert_array_equal(npz[name], answer[name])
        np.testing.assert_array_equal(npz["grasp_u"], [grasp["u"] for grasp in answer["grasps"]])
        for name in GIVEN:
            np.testing.assert_array_equal(npz[name], [grasp[name] for grasp in answer["grasps"]])


def test_the_peaks_of_what_a_gripper_gives_are_those_of_the_whole_motion(client: TestClient) -> None:
    scene = put(paper_scene(output={"samples_u": 2, "samples_t": 2}), "primitives.0.hold", "tangent")
    (grasp,) = predict(to_scene(PredictionRequest.model_validate(scene), nothing_stored)).grasps
    (shown,) = client.post("/v1/predictions?store=false", json=scene).json()["grasps"]
    for name, values, sampled in (
        ("peak_force", grasp.reaction, shown["reaction"]),
        ("peak_moment", grasp.moment, shown["moment"]),
    ):
        sizes = np.linalg.norm(values, axis=1)
        np.testing.assert_allclose(shown[name], sizes.max(), **SAME)
        assert shown[f"{name}_time"] == grasp.times[sizes.argmax()]
        assert shown[name] > 1.5 * np.linalg.norm(sampled, axis=1).max()


def test_the_errors_of_what_a_gripper_gives_are_those_at_the_times_of_the_surface(client: TestClient) -> None:
    scene = paper_scene(output={"samples_u": 2, "samples_t": 9})
    (grasp,) = predict(to_scene(PredictionRequest.model_validate(scene), nothing_stored)).grasps
    answer = client.post("/v1/predictions?store=false", json=scene).json()
    for name, errors in (("reaction_error", grasp.reaction_error), ("moment_error", grasp.moment_error)):
        assert errors is not None
        np.testing.assert_allclose(
            answer["grasps"][0][name], np.interp(answer["surface"]["t"], grasp.times, errors), **SAME
        )


def test_what_table_and_obstacles_give_is_what_python_finds(client: TestClient) -> None:
    peg = {"kind": "cylinder", "center": [0.6, 0.08, 0.0], "radius": 0.02, "height": 0.1, "friction": 0.3}
    scene = put(paper_scene(output={"samples_u": 2, "samples_t": 17}), "environment.obstacles", [peg])
    found = predict(to_scene(PredictionRequest.model_validate(scene), nothing_stored)).contacts
    answer = client.post("/v1/predictions?store=false", json=scene).json()
    assert [contact["name"] for contact in answer["contacts"]] == ["table", "obstacles[0]"]
    t, npz = answer["surface"]["t"], arrays(surface_npz(answer, None))
    assert npz["contact"].tolist() == ["table", "obstacles[0]"]
    for k, (own, shown) in enumerate(zip(found, answer["contacts"], strict=True)):
        assert own.force_error is not None
        assert own.friction_error is not None
        for name, values in (
            ("force", np.column_stack([np.interp(t, own.times, own.force[:, d]) for d in range(3)])),
            ("friction", np.column_stack([np.interp(t, own.times, own.friction[:, d]) for d in range(3)])),
            ("pressed", np.interp(t, own.times, own.pressed)),
            ("force_error", np.interp(t, own.times, own.force_error)),
            ("friction_error", np.interp(t, own.times, own.friction_error)),
        ):
            np.testing.assert_allclose(shown[name], values, **SAME)
            np.testing.assert_array_equal(npz[f"contact_{name}"][k], shown[name])
    assert np.array(answer["contacts"][1]["pressed"]).max() > 1e-3  # N: it was met, so equal forces mean something
    assert np.abs(answer["contacts"][1]["friction"]).max() > 3e-4


def test_a_run_that_was_stored_before_friction_was_noted_still_gives_its_arrays(client: TestClient) -> None:
    answer = client.post("/v1/predictions?store=false", json=paper_scene()).json()
    before = [{name: one[name] for name in ("name", "force", "pressed", "force_error")} for one in answer["contacts"]]
    npz = arrays(surface_npz({**answer, "contacts": before}, None))
    np.testing.assert_array_equal(npz["contact_force"], [one["force"] for one in before])
    assert npz["contact_friction"].shape == npz["contact_force"].shape
    assert np.isnan(npz["contact_friction"]).all()
    assert np.isnan(npz["contact_friction_error"]).all()


def test_where_no_error_was_estimated_there_is_none_of_the_forces(client: TestClient) -> None:
    scene = paper_scene(quality={"n_u": 7, "n_t": 9, "method": "paper"})
    answer = client.post("/v1/predictions?store=false", json=scene).json()
    assert answer["grasps"][0]["reaction_error"] is None
    assert np.isnan(arrays(surface_npz(answer, None))["reaction_error"]).all()


def test_a_run_that_was_stored_before_peaks_were_noted_still_gives_its_arrays(answer: dict[str, Any]) -> None:
    before = [{name: grasp[name] for name in ("u", "reaction", "moment")} for grasp in answer["grasps"]]
    npz = arrays(surface_npz({**answer, "grasps": before}, None))
    np.testing.assert_array_equal(npz["reaction"], [grasp["reaction"] for grasp in before])
    np.testing.assert_array_equal(npz["peak_force"], [np.nan])
    assert npz["moment_error"].shape == (1, len(answer["surface"]["t"]))
    assert np.isnan(npz["moment_error"]).all()
    without = {name: value for name, value in answer.items() if name != "contacts"}
    assert arrays(surface_npz(without, None))["contact_force"].shape == (0, len(answer["surface"]["t"]), 3)


def test_a_prediction_can_be_asked_for_as_npz(client: TestClient, answer: dict[str, Any]) -> None:
    headers = {"accept": "application/json;q=0.5, application/x-npz"}
    response = client.post("/v1/predictions", json=paper_scene(), headers=headers)
    assert response.status_code == 201
    assert response.headers["location"].startswith("/v1/predictions/")
    np.testing.assert_allclose(arrays(response.content)["positions"], answer["surface"]["positions"], **SAME)


def test_the_answer_is_that_of_the_contract(answer: dict[str, Any]) -> None:
    PredictionResponse.model_validate(answer, strict=True)
    surface = answer["surface"]
    assert np.shape(surface["positions"]) == (33, 101, 3)
    assert np.shape(surface["twist"]) == (33, 101)
    n_t, n_u, columns = np.shape(answer["control_points"])
    assert columns == 4
    assert answer["degree"] == 3
    assert len(answer["knots_u"]) == n_u + 4
    assert len(answer["knots_t"]) == n_t + 4
    assert answer["knots_u"][-1] == 1.0
    assert answer["knots_t"][-1] == 1.6
    (grasp,) = answer["grasps"]
    assert grasp["u"] == 0.25
    assert np.shape(grasp["reaction"]) == np.shape(grasp["moment"]) == (33, 3)
    assert answer["status"] == "converged"
    assert set(answer["links"]) >= {"self", "recording", "surface"}
    assert answer["accuracy"]["error_estimate"] > 0
    assert all(set(effect) == {"name", "active", "reason", "magnitude", "unit"} for effect in answer["effects"])
    assert {"update", "residual", "energy", "wall_time"} <= set(answer["iterations"][0])


def test_the_grasp_follows_its_path(answer: dict[str, Any]) -> None:
    t = np.array(answer["surface"]["t"])
    s = t / 1.6
    path = 0.5 * s**3 * (10 - 15 * s + 6 * s**2)
    held = np.array(answer["surface"]["positions"])[:, 25]  # u = 0.25 m
    # the grasp is imposed exactly on the spline, which takes its minimum jerk up to the grid in time: 1e-4 of 0.5 m
    np.testing.assert_allclose(held[:, 1], path, rtol=0, atol=5e-5)
    np.testing.assert_allclose(held[:, [0, 2]], [[0.25, 0.0]] * len(t), rtol=0, atol=1e-9)


def test_a_null_stands_where_a_number_is_not_finite(client: TestClient, answer: dict[str, Any]) -> None:
    assert answer["iterations"][0]["update"] is None  # the first level of a march has nothing to differ from
    assert "NaN" not in client.get(answer["links"]["self"]).text


def test_output_sets_the_sampling(client: TestClient) -> None:
    response = client.post("/v1/predictions", json=paper_scene(output={"samples_u": 7, "samples_t": 5}))
    assert np.shape(response.json()["surface"]["positions"]) == (5, 7, 3)


def test_a_stored_request_can_be_sent_again(client: TestClient, answer: dict[str, Any]) -> None:
    stored = client.get(answer["links"]["scene"])
    assert stored.json() == paper_scene()
    again = client.post("/v1/predictions", content=stored.content, headers={"content-type": "application/json"}).json()
    np.testing.assert_allclose(again["surface"]["positions"], answer["surface"]["positions"], **SAME)


def test_a_given_grid_and_threshold_are_solved_over_the_whole_space_time(client: TestClient) -> None:
    response = client.post("/v1/predictions", json=contract_scene("paper-fig1"))
    assert response.status_code == 201, response.text
    document = response.json()
    assert document["accuracy"]["method"] == "spacetime"
    assert np.shape(document["control_points"]) == (13, 9, 4)
    assert document["status"] == "converged"
    assert document["iterations"][-1]["update"] < 1e-5


def test_two_grippers_hold_a_hanging_cable(client: TestClient) -> None:
    scene = contract_scene("two-grippers-hanging")
    for i in range(2):
        scene = put(scene, f"primitives.{i}.hold", "tangent")
    document = client.post("/v1/predictions", json=scene).json()
    assert document["status"] == "converged", document
    positions = np.array(document["surface"]["positions"])
    # the grasps are exact: the start fits its end points within their noise, the move is as asked
    np.testing.assert_allclose(positions[-1, -1] - positions[0, -1], [-0.2, 0.2, 0.1], rtol=0, atol=1e-6)
    assert positions[..., 2].min() < -0.25  # m: it hangs
    assert [grasp["u"] for grasp in document["grasps"]] == [0.0, 1.0]


@pytest.fixture(scope="module", params=["paper-fig1", "table-with-friction", "two-grippers-hanging"])
def contract_answer(client: TestClient, request: pytest.FixtureRequest) -> tuple[dict[str, Any], dict[str, Any]]:
    """A scene of the contract and its answer."""
    scene = contract_scene(request.param)
    response = client.post("/v1/predictions", json=scene)
    assert response.status_code == 201, response.text
    return scene, response.json()


def test_every_scene_of_the_contract_is_answered(contract_answer: tuple[dict[str, Any], dict[str, Any]]) -> None:
    scene, document = contract_answer
    PredictionResponse.model_validate(document, strict=True)
    assert document["status"] == "converged", document["message"]
    active = {effect["name"] for effect in document["effects"] if effect["active"]}
    called_for = {
        "twist": any(primitive["hold"] == "clamp" for primitive in scene["primitives"]),
        "plasticity": "yield_strain" in scene["cable"],
        "friction": (scene["environment"]["table"] or {}).get("friction", 0.0) > 0.0,
        "obstacles": bool(scene["environment"].get("obstacles")),
    }
    assert {name for name, is_called_for in called_for.items() if is_called_for} <= active


def test_no_cable_of_the_contract_runs_through_an_obstacle(
    contract_answer: tuple[dict[str, Any], dict[str, Any]],
) -> None:
    scene, document = contract_answer
    positions = np.array(document["surface"]["positions"])
    for post in scene["environment"].get("obstacles", []):
        assert (post["kind"], post["axis"]) == ("cylinder", [0, 0, 1])
        nearest = np.linalg.norm(positions[..., :2] - post["center"][:2], axis=-1).min()
        # the contact is a stiff penalty: it gives way by a small part of the cable's radius
        assert nearest > post["radius"] + 0.45 * scene["cable"]["diameter"]


def test_clamps_are_turned_back_by_moments_along_the_cable(client: TestClient) -> None:
    turned = {"kind": "move", "displacement": [0, 0, 0], "rotation": [1.0, 0, 0], "duration": 1.0}
    scene = paper_scene(
        primitives=[{"u": 0.0, "hold": "clamp", "path": {"kind": "still"}}, {"u": 1.0, "hold": "clamp", "path": turned}]
    )
    scene = put(put(scene, "environment.table", None), "environment.gravity", [0, 0, 0])
    response = client.post("/v1/predictions", json=scene)
    assert response.status_code == 201, response.text
    document = response.json()
    twist = np.array(document["surface"]["twist"])
    # a straight cable without weight shares the turn of 1 rad evenly over its length of 1 m
    np.testing.assert_allclose(twist[-1] - twist[-1, 0], document["surface"]["u"], rtol=0, atol=1e-3)
    moments = [grasp["moment"][-1][0] for grasp in document["grasps"]]
    GJ = scene["cable"]["torsional_stiffness"]
    np.testing.assert_allclose(moments, [-GJ, GJ], rtol=1e-2)  # GJ times 1 rad/m, to 1 % of the auto quality


def test_npz_holds_what_the_cable_remembers_stored_or_not(client: TestClient) -> None:
    scene, headers = contract_scene("table-with-friction"), {"accept": "application/x-npz"}
    stored = client.post("/v1/predictions", json=scene, headers=headers)
    by_link = client.get(f"{stored.headers['location']}/surface.npz")
    unstored = client.post("/v1/predictions?store=false", json=scene, headers=headers)
    prediction = predict(to_scene(PredictionRequest.model_validate(scene), nothing_stored))
    assert prediction.material is not None
    for response in (stored, by_link, unstored):
        npz = arrays(response.content)
        for name, expected in vars(prediction.material).items():
            np.testing.assert_allclose(npz[f"material_{name}"], expected, **SAME)


def test_the_examples_of_the_docs_are_those_of_the_contract() -> None:
    shown = {name: example["value"] for name, example in EXAMPLES.items()}
    assert shown["paper"] == contract_scene("paper-fig1")
    assert shown["two-clamps"] == contract_scene("two-grippers-hanging")
    assert shown["friction"] == contract_scene("table-with-friction")
