"""From a request to the solver's scene: presets, forms of the same field, and continuing from a stored run."""

from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

from app.schemas import PredictionRequest, to_scene
from app.schemas.shape import ControlPointsShape
from dlocore import PRESETS, Box, Cable, Capsule, ControlPoints, Cylinder, Points, Scene, Sphere, Table
from dlocore.problem.notes import scene_notes
from tests.app.conftest import contract_scene, paper_scene, put

POINTS = [[0.02, 0.01], [0.3, 0.05], [0.6, 0.02], [0.9, 0.0]]


def scene_of(request: dict[str, Any]) -> Scene:
    return to_scene(PredictionRequest.model_validate(request), lambda id: None)


def test_fields_beside_a_preset_override_it() -> None:
    cable = scene_of(paper_scene(cable={"preset": "black-wire", "length": 0.7})).cable
    assert cable.length == 0.7
    assert cable.bending_stiffness == PRESETS["black-wire"].values["bending_stiffness"]


def test_a_preset_is_not_overridden_by_defaults() -> None:
    for name in PRESETS:
        cable = scene_of(paper_scene(cable={"preset": name})).cable
        assert {key: getattr(cable, key) for key in PRESETS[name].values} == PRESETS[name].values


def test_points_may_be_2d() -> None:
    shape = scene_of(paper_scene(shape={"kind": "points", "points": POINTS})).shape
    assert isinstance(shape, Points)
    np.testing.assert_array_equal(shape.points, [[x, y, 0.0] for x, y in POINTS])


@pytest.mark.parametrize(
    ("velocity", "expected"),
    [
        ([0, 0.1, 0], [0, 0.1, 0]),
        ([[0, 0.1 * k, 0] for k in range(4)], [[0, 0.1 * k, 0] for k in range(4)]),
        ({"kind": "points", "points": [[0, 0.1 * k, 0] for k in range(4)]}, [[0, 0.1 * k, 0] for k in range(4)]),
    ],
)
def test_a_velocity_may_have_any_form_of_the_contract(velocity: Any, expected: Any) -> None:
    shape = scene_of(paper_scene(shape={"kind": "points", "points": POINTS, "velocity": velocity})).shape
    np.testing.assert_array_equal(shape.velocity, expected)


def test_the_velocity_of_control_points_is_given_by_control_points() -> None:
    net = [[x, 0, 0, 0] for x in (0, 0.3, 0.7, 1)]
    rates = [[0, 0.1 * k, 0, 0.2 * k] for k in range(4)]
    for columns in (3, 4):
        given = [rate[:columns] for rate in rates]
        velocity = {"kind": "control_points", "control_points": given}
        request = {"kind": "control_points", "control_points": net, "velocity": velocity, "strain": [0, 0.001, 0, 0]}
        shape = scene_of(paper_scene(shape=request)).shape
        assert isinstance(shape, ControlPoints)
        np.testing.assert_array_equal(shape.velocity, given)
        np.testing.assert_array_equal(shape.strain, [0, 0.001, 0, 0])


def test_the_example_of_control_points_starts_without_a_note() -> None:
    (net,) = ControlPointsShape.model_fields["control_points"].examples or []
    assert scene_notes(scene_of(paper_scene(shape={"kind": "control_points", "control_points": net}))) == []


def test_a_load_is_constant_or_over_time() -> None:
    over_time = {"u": 1.0, "force": {"times": [0, 1], "values": [[0, 0, 0], [0, 0.2, 0]]}}
    constant, varying = scene_of(paper_scene(loads=[{"u": 0.5, "force": [0, 0, 0.1]}, over_time])).loads
    np.testing.assert_allclose(constant.at(np.array([0.0, 5.0])), [[0, 0, 0.1]] * 2)
    np.testing.assert_allclose(varying.at(np.array([0.0, 0.5, 1.0])), [[0, 0, 0], [0, 0.1, 0], [0, 0.2, 0]])


@pytest.mark.parametrize("t", [None, 0.8])
def test_a_scene_continues_from_a_stored_prediction(
    client: TestClient, answer: dict[str, Any], t: float | None
) -> None:
    shape = {"kind": "prediction", "id": answer["id"]} | ({} if t is None else {"t": t})
    still = [{"u": 0.25, "hold": "point", "path": {"kind": "still"}}]
    if t is not None:  # let go in the middle of the move: no grasp contradicts the velocity
        still = []
    request = paper_scene(shape=shape, primitives=still, horizon=0.4)
    response = client.post("/v1/predictions", json=request)
    assert response.status_code == 201, response.text
    follow = response.json()
    before = np.array(answer["surface"]["positions"])
    at = -1 if t is None else 16  # of 33 samples over 1.6 s
    # the start is the stored spline itself, seen through the grid of the new solve: 0.2 % of the length
    np.testing.assert_allclose(follow["surface"]["positions"][0], before[at], rtol=0, atol=2e-3)
    if t is not None:
        dt, dt_before = 0.4 / 32, 1.6 / 32
        speed = (np.array(follow["surface"]["positions"][1]) - follow["surface"]["positions"][0]) / dt
        speed_before = (before[17] - before[15]) / (2 * dt_before)
        assert np.abs(speed_before).max() > 0.3  # m/s: the cable was moving
        # it goes on as fast as it was: within 10 % for one-sided differences of a motion that slows down
        np.testing.assert_allclose(speed, speed_before, rtol=0, atol=0.1 * np.abs(speed_before).max())


def test_a_continued_cable_keeps_its_length(client: TestClient, answer: dict[str, Any]) -> None:
    request = put(paper_scene(shape={"kind": "prediction", "id": answer["id"]}), "cable.length", 0.9)
    problem = client.post("/v1/predictions", json=request).json()
    assert problem["errors"][0]["field"] == "cable.length"


def test_a_time_after_the_stored_prediction_is_refused(client: TestClient, answer: dict[str, Any]) -> None:
    request = paper_scene(shape={"kind": "prediction", "id": answer["id"], "t": 1.7})
    problem = client.post("/v1/predictions", json=request).json()
    assert problem["errors"][0]["field"] == "shape.t"
    assert "1.6" in problem["errors"][0]["allowed"]


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({"kind": "sphere", "center": [0.5, 0.2, 0], "radius": 0.05}, Sphere(center=(0.5, 0.2, 0), radius=0.05)),
        (
            {"kind": "capsule", "start": [0.5, 0, 0], "end": [0.5, 0.2, 0], "radius": 0.02, "friction": 0.4},
            Capsule(start=(0.5, 0, 0), end=(0.5, 0.2, 0), radius=0.02, friction=0.4),
        ),
        (
            {"kind": "cylinder", "center": [0.5, 0, 0], "axis": [1, 1, 0], "radius": 0.02, "height": 0.1},
            Cylinder(center=(0.5, 0, 0), axis=(1, 1, 0), radius=0.02, height=0.1),
        ),
        (
            {"kind": "cylinder", "center": [0.5, 0, 0], "radius": 0.02, "height": 0.1},
            Cylinder(center=(0.5, 0, 0), radius=0.02, height=0.1),
        ),
        (
            {"kind": "box", "center": [0, 0, 1], "size": [0.1, 0.2, 0.3], "orientation": [0.6, 0, 0.8, 0]},
            Box(center=(0, 0, 1), size=(0.1, 0.2, 0.3), orientation=(0.6, 0, 0.8, 0)),
        ),
    ],
    ids=["sphere", "capsule", "cylinder", "upright cylinder", "box"],
)
def test_an_obstacle_is_that_of_the_solver(given: dict[str, Any], expected: Any) -> None:
    (obstacle,) = scene_of(put(paper_scene(), "environment.obstacles", [given])).environment.obstacles
    assert type(obstacle) is type(expected)
    np.testing.assert_array_equal(obstacle.row(), expected.row())


def test_a_cable_yields_and_remembers_as_it_is_given() -> None:
    values = {
        "yield_strain": 0.01,
        "yield_twist": 0.02,
        "yield_stretch": 0.005,
        "memory_rate": 50.0,
        "hardening": 0.2,
        "torsional_damping": 1e-4,
    }
    cable = scene_of(paper_scene(cable={"preset": "paper", **values})).cable
    assert {name: getattr(cable, name) for name in values} == values
    assert scene_of(paper_scene()).cable.memory_rate is None
    assert scene_of(paper_scene()).cable.hardening == Cable.preset("paper").hardening


@pytest.mark.parametrize("name", ["paper-fig1", "table-with-friction", "two-grippers-hanging"])
def test_the_scenes_of_the_contract_are_taken_whole(name: str) -> None:
    request = contract_scene(name)
    scene = scene_of(request)
    assert [grasp.hold for grasp in scene.grasps] == [primitive["hold"] for primitive in request["primitives"]]
    assert scene.cable.yield_strain == request["cable"].get("yield_strain")
    assert scene.cable.memory_rate == request["cable"].get("memory_rate")
    table = request["environment"]["table"]
    assert (scene.environment.table is None) == (table is None)
    if table is not None:
        assert scene.environment.table == Table(**table)
    assert len(scene.environment.obstacles) == len(request["environment"].get("obstacles", []))


def test_the_fourth_column_of_control_points_turns_the_sections() -> None:
    net = [[x, 0, 0, angle] for x, angle in zip((0, 0.3, 0.7, 1), (0, 0.1, 0.4, 0.9), strict=True)]
    shape = scene_of(paper_scene(shape={"kind": "control_points", "control_points": net})).shape
    assert isinstance(shape, ControlPoints)
    np.testing.assert_array_equal(shape.control_points, net)
