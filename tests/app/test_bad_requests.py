"""Every kind of wrong request is answered by a problem document that names the field."""

import asyncio
import gzip
import json
import re
import threading
import tracemalloc
from typing import Any

import pytest
from fastapi.testclient import TestClient
from pydantic import ValidationError
from starlette.types import Message

from app.http.fields import bad_fields
from app.routes import body as bodies
from app.schemas.base import MAX_NAMES, MAX_REPORTED
from app.schemas.identify import IdentifyRequest
from app.schemas.request import PredictionRequest
from tests.app.conftest import ABSENT, contract_scene, paper_scene, put

PAPER = paper_scene()
HANGING = put(put(contract_scene("two-grippers-hanging"), "primitives.0.hold", "point"), "primitives.1.hold", "point")
POINTS = put(PAPER, "shape", {"kind": "points", "points": [[0, 0, 0], [0.3, 0, 0], [0.7, 0, 0], [1, 0, 0]]})
WAYPOINTS = put(
    PAPER,
    "primitives.0.path",
    {"kind": "waypoints", "times": [0, 0.5, 1], "positions": [[0.25, 0, 0], [0.25, 0.1, 0], [0.25, 0.2, 0]]},
)
LOADED = put(PAPER, "loads", [{"u": 1.0, "force": {"times": [0, 1], "values": [[0, 0, 0], [0, 0.1, 0]]}}])
OBSTACLES: list[dict[str, Any]] = [
    {"kind": "cylinder", "center": [0.5, 0.9, 0], "axis": [0, 0, 1], "radius": 0.02, "height": 0.1, "friction": 0.3},
    {"kind": "box", "center": [0.7, 0.9, 0], "size": [0.1, 0.1, 0.1], "orientation": [1, 0, 0, 0]},
    {"kind": "sphere", "center": [0.9, 0.9, 0], "radius": 0.02},
    {"kind": "capsule", "start": [1.1, 0.9, 0], "end": [1.2, 0.9, 0], "radius": 0.02},
]
OBSTRUCTED = put(PAPER, "environment.obstacles", OBSTACLES)
NET = put(PAPER, "shape", {"kind": "control_points", "control_points": [[x, 0, 0, 0] for x in (0, 0.3, 0.7, 1)]})

# scene, path of the change, new value, the field that the answer names
CASES: list[tuple[dict[str, Any], str, Any, str]] = [
    # missing
    (PAPER, "cable", ABSENT, "cable"),
    (PAPER, "shape", ABSENT, "shape"),
    (PAPER, "shape.kind", ABSENT, "shape.kind"),
    (PAPER, "cable.length", ABSENT, "cable.length"),
    (PAPER, "cable.diameter", ABSENT, "cable.diameter"),
    (PAPER, "cable.linear_density", ABSENT, "cable.linear_density"),
    (PAPER, "cable.bending_stiffness", ABSENT, "cable.bending_stiffness"),
    (PAPER, "primitives.0.u", ABSENT, "primitives[0].u"),
    (PAPER, "primitives.0.path", ABSENT, "primitives[0].path"),
    (PAPER, "primitives.0.path.kind", ABSENT, "primitives[0].path.kind"),
    (PAPER, "primitives.0.path.duration", ABSENT, "primitives[0].path.duration"),
    (PAPER, "primitives", [], "horizon"),
    # wrong kind of value
    (PAPER, "cable", [], "cable"),
    (PAPER, "cable.length", "1.0", "cable.length"),
    (PAPER, "cable.length", True, "cable.length"),
    (PAPER, "cable.length", None, "cable.length"),
    (PAPER, "cable.length", [1.0], "cable.length"),
    (PAPER, "primitives.0.u", False, "primitives[0].u"),
    (PAPER, "primitives.0.path.displacement", [0, "0.5", 0], "primitives[0].path.displacement[1]"),
    (PAPER, "shape.settle", "yes", "shape.settle"),
    (PAPER, "quality", {"n_u": 9.5, "n_t": 13}, "quality.n_u"),
    (PAPER, "quality", {"n_u": "9", "n_t": 13}, "quality.n_u"),
    (PAPER, "output.samples_u", True, "output.samples_u"),
    (PAPER, "primitives", {}, "primitives"),
    (PAPER, "cable.rest_shape", 3, "cable.rest_shape"),
    (PAPER, "quality", [None], "quality"),
    (PAPER, "effects", [], "effects"),
    (PAPER, "cable.rest_shape", {}, "cable.rest_shape"),
    (PAPER, "name", 5, "name"),
    (PAPER, "name", "x" * 201, "name"),
    (LOADED, "loads.0.force", "much", "loads[0].force"),
    (POINTS, "shape.points.1", 0.5, "shape.points[1]"),
    (POINTS, "shape.points.2.1", True, "shape.points[2][1]"),
    # wrong length
    (PAPER, "shape.start", [0, 0], "shape.start"),
    (PAPER, "environment.gravity", [0, 0, -9.81, 0], "environment.gravity"),
    (POINTS, "shape.points", [[0, 0, 0], [0.5, 0, 0], [1, 0, 0]], "shape.points"),
    (POINTS, "shape.points.1", [0.3], "shape.points[1]"),
    (POINTS, "shape.points.1", [0.3, 0], "shape.points[1]"),
    (PAPER, "cable.rest_shape", [[0, 0], [0.3, 0], [0.6, 0], [1, 0, 0]], "cable.rest_shape[3]"),
    (POINTS, "shape.points", [[0.1, 0.2, 0]] * 5, "shape.points"),
    (WAYPOINTS, "primitives.0.path.times", [0, 1], "primitives[0].path.positions"),
    (LOADED, "loads.0.force.values", [[0, 0, 0]], "loads[0].force.values"),
    # out of range
    (PAPER, "cable.length", 0, "cable.length"),
    (PAPER, "cable.length", -1, "cable.length"),
    (PAPER, "cable.length", 10**400, "cable.length"),
    (PAPER, "cable.diameter", 0.0, "cable.diameter"),
    (PAPER, "cable.diameter", 0.9, "cable.diameter"),
    (PAPER, "cable.bending_stiffness", -1e-3, "cable.bending_stiffness"),
    (PAPER, "cable.bending_damping", -1, "cable.bending_damping"),
    (PAPER, "cable.axial_damping", -1, "cable.axial_damping"),
    (PAPER, "environment.drag", -0.1, "environment.drag"),
    (PAPER, "environment.gravity", [0, 0, -1e5], "environment.gravity"),
    (PAPER, "primitives.0.path.duration", 0, "primitives[0].path.duration"),
    (PAPER, "horizon", 0, "horizon"),
    (PAPER, "quality", {"n_u": 4, "n_t": 13}, "quality.n_u"),
    (PAPER, "quality", {"n_u": 9, "n_t": 1000}, "quality.n_t"),
    (PAPER, "quality", {"target_error": 0}, "quality.target_error"),
    (PAPER, "quality", {"time_budget": -1}, "quality.time_budget"),
    (PAPER, "output.samples_t", 1, "output.samples_t"),
    (PAPER, "output.samples_u", 10**6, "output.samples_u"),
    (PAPER, "shape.direction", [0, 0, 0], "shape.direction"),
    (PAPER, "cable.torsional_damping", -1, "cable.torsional_damping"),
    (PAPER, "cable.yield_strain", 0, "cable.yield_strain"),
    (PAPER, "cable.memory_rate", -1, "cable.memory_rate"),
    (PAPER, "cable.hardening", 1.5, "cable.hardening"),
    (PAPER, "environment.table.friction", -0.1, "environment.table.friction"),
    (OBSTRUCTED, "environment.obstacles.0.radius", -0.02, "environment.obstacles[0].radius"),
    (OBSTRUCTED, "environment.obstacles.0.friction", 11, "environment.obstacles[0].friction"),
    (OBSTRUCTED, "environment.obstacles.1.size", [0.1, 0, 0.1], "environment.obstacles[1].size[1]"),
    (PAPER, "environment.obstacles", OBSTACLES[:1] * 101, "environment.obstacles"),
    # not a choice
    (PAPER, "shape.kind", "circle", "shape.kind"),
    (PAPER, "shape.kind", 3, "shape.kind"),
    (PAPER, "primitives.0.hold", "glue", "primitives[0].hold"),
    (PAPER, "primitives.0.path.kind", "fly", "primitives[0].path.kind"),
    (PAPER, "primitives.0.path.profile", "bang", "primitives[0].path.profile"),
    (PAPER, "quality", "best", "quality"),
    (PAPER, "quality", {"method": "magic"}, "quality.method"),
    (PAPER, "effects", "all", "effects"),
    (PAPER, "effects", {"bend": "maybe"}, "effects.bend"),
    (PAPER, "cable.preset", "spaghetti", "cable.preset"),
    (PAPER, "cable.rest_shape", "bent", "cable.rest_shape"),
    (PAPER, "environment.obstacles", [{"kind": "cone"}], "environment.obstacles[0].kind"),
    (OBSTRUCTED, "environment.obstacles.2.height", 0.1, "environment.obstacles[2].height"),
    # no such field
    (PAPER, "solver", "fast", "solver"),
    (PAPER, "cable.colour", "red", "cable.colour"),
    (PAPER, "primitives.0.path.speed", 1, "primitives[0].path.speed"),
    (PAPER, "effects", {"magnetism": "on"}, "effects.magnetism"),
    (PAPER, "quality", {"n_x": 3}, "quality.n_x"),
    (PAPER, "environment.table.height_m", 0, "environment.table.height_m"),
    (LOADED, "loads.0.force.unit", "N", "loads[0].force.unit"),
    # parts that contradict each other
    (PAPER, "primitives.0.u", 1.5, "primitives[0].u"),
    (LOADED, "loads.0.u", 1.5, "loads[0].u"),
    (PAPER, "primitives.1", PAPER["primitives"][0], "primitives[1].u"),
    (PAPER, "primitives.0.release_time", 0.0, "primitives[0].release_time"),
    (PAPER, "primitives.0.path.rotation", [0, 0, 1], "primitives[0].path.rotation"),
    (PAPER, "quality", {"n_u": 9}, "quality.n_t"),
    (PAPER, "quality", {"target_error": 1e-3, "time_budget": 1}, "quality.time_budget"),
    (PAPER, "quality", {"target_error": 1e-3, "delta": 1e-5}, "quality.delta"),
    (PAPER, "cable.shear_modulus", 7e6, "cable.shear_modulus"),
    (PAPER, "shape.velocity", {"kind": "control_points", "control_points": [[0, 0, 0]] * 4}, "shape.velocity.kind"),
    (PAPER, "shape.velocity", [0, 1], "shape.velocity"),
    (PAPER, "shape.velocity", {"kind": "wind"}, "shape.velocity.kind"),
    (POINTS, "shape.velocity", [[0, 0, 0]] * 5, "shape.velocity"),
    (WAYPOINTS, "primitives.0.path.times", [0, 1, 0.5], "primitives[0].path.times[2]"),
    (WAYPOINTS, "primitives.0.path.times", [0, 0.5, 0.5], "primitives[0].path.times[2]"),
    (WAYPOINTS, "primitives.0.path.orientations", [[2, 0, 0, 0]] * 3, "primitives[0].path.orientations[0]"),
    (LOADED, "loads.0.force.times", [1, 0], "loads[0].force.times"),
    (LOADED, "loads.0.force", {"times": [1, 1, 1], "values": [[0, 0, 0]] * 3}, "loads[0].force.times"),
    (PAPER, "shape", {"kind": "prediction", "id": "../../etc/passwd"}, "shape.id"),
    (PAPER, "shape", {"kind": "prediction", "id": "0" * 28}, "shape.id"),
    (PAPER, "effects", {"stretch": "off"}, "effects.stretch"),
    (PAPER, "cable.memory_rate", 50.0, "cable.yield_strain"),
    (PAPER, "cable.yield_strain", 0.01, "cable.memory_rate"),
    (PAPER, "cable.yield_twist", 0.01, "cable.memory_rate"),
    (PAPER, "cable.yield_stretch", 0.01, "cable.memory_rate"),
    (OBSTRUCTED, "environment.obstacles.0.axis", [0, 0, 0], "environment.obstacles[0].axis"),
    (OBSTRUCTED, "environment.obstacles.1.orientation", [2, 0, 0, 0], "environment.obstacles[1].orientation"),
    (OBSTRUCTED, "environment.obstacles.3.end", [1.1, 0.9, 0], "environment.obstacles[3].end"),
    (
        NET,
        "shape.velocity",
        {"kind": "control_points", "control_points": [[0, 0, 0]] * 3 + [[0, 0, 0, 0.1]]},
        "shape.velocity.control_points[3]",
    ),
    (NET, "shape.strain", [0, 0, 0, 0.6], "shape.strain[3]"),
    (NET, "shape.strain", [0, 0, 0], "shape.strain"),
    # the reference chooses its own rods and steps
    (PAPER, "quality", {"method": "reference", "n_u": 9, "n_t": 13}, "quality.n_u"),
]


def the_problem(response: Any, status: int) -> dict[str, Any]:
    assert response.status_code == status, response.text
    assert response.headers["content-type"] == "application/problem+json"
    problem: dict[str, Any] = response.json()
    assert problem["status"] == status
    assert problem["type"].startswith("urn:dlo:problem:")
    assert problem["title"]
    assert problem["detail"]
    assert "Traceback" not in response.text
    return problem


@pytest.mark.parametrize(("scene", "path", "value", "field"), CASES, ids=[f"{c[1]}={str(c[2])[:24]}" for c in CASES])
def test_a_wrong_field_is_named_with_what_is_allowed(
    client: TestClient, scene: dict[str, Any], path: str, value: Any, field: str
) -> None:
    problem = the_problem(client.post("/v1/predictions", json=put(scene, path, value)), 422)
    assert problem["title"] == "Unprocessable Content"  # as RFC 9110 has it; Python before 3.13 has an older phrase
    assert [error["field"] for error in problem["errors"]] == [field]
    (error,) = problem["errors"]
    assert set(error) == {"field", "given", "allowed", "message"}
    assert error["allowed"]
    assert not error["allowed"].endswith("one of ")
    assert problem["detail"] == f"{field}: {error['message']}"


@pytest.mark.parametrize("scene", [PAPER, HANGING, POINTS, WAYPOINTS, LOADED, OBSTRUCTED, NET], ids=range(7))
def test_the_scenes_that_the_cases_are_made_of_are_right(client: TestClient, scene: dict[str, Any]) -> None:
    assert client.post("/v1/predictions", json=scene).status_code == 201


def test_one_item_is_said_in_the_singular(client: TestClient) -> None:
    short = put(PAPER, "primitives.0.path.displacement", [0.1])
    error = the_problem(client.post("/v1/predictions", json=short), 422)["errors"][0]
    assert error["message"].startswith("Got 1 item. Allowed: "), error["message"]
    error = the_problem(client.post("/v1/predictions:batch", json={"scenes": []}), 422)["errors"][0]
    assert error["message"] == "Got 0 items. Allowed: at least 1 item."


def test_what_is_allowed_is_said_with_what_the_field_is_and_no_more(client: TestClient) -> None:
    problem = the_problem(client.post("/v1/predictions", json=put(PAPER, "quality", {"n_u": 500, "n_t": 13})), 422)
    assert problem["errors"][0]["allowed"] == "an integer at least 5 at most 129 (Control points along the cable)"


@pytest.mark.parametrize(
    ("path", "needed"),
    [
        ("cable", "an object with some of preset, length, diameter, "),
        ("shape", "an object whose kind is one of control_points, points, prediction, straight (Where the cable is"),
        ("primitives.0.u", "a finite number at least 0 at most 1000 (Material coordinate [m]"),
        ("primitives.0.path.displacement", "a list of 3 items (Displacement [m])"),
        ("loads.0.force", "a list of 3 items or an object with times, values (Force [N]"),
        ("environment.obstacles.0.radius", "a finite number above 0 "),
    ],
)
def test_of_a_field_that_is_missing_it_is_said_what_it_has_to_be(path: str, needed: str) -> None:
    body = put(put(LOADED, "environment.obstacles", OBSTACLES), path, ABSENT)
    with pytest.raises(ValidationError) as caught:
        PredictionRequest.model_validate(body)
    (bad,) = bad_fields(caught.value.errors(), body)
    assert bad.allowed.startswith(needed)
    assert bad.message == f"It is missing. Got nothing. Allowed: {bad.allowed}."


def test_a_whole_number_with_a_point_is_an_integer(client: TestClient) -> None:
    scene = {**PAPER, "quality": {"n_u": 9.0, "n_t": 1.3e1}, "output": {"samples_u": 3.0, "samples_t": 2}}
    answer = client.post("/v1/predictions?store=false", json=scene)
    assert answer.status_code == 200
    assert len(answer.json()["surface"]["u"]) == 3


def test_grasps_farther_apart_than_the_cable_between_them_are_refused_in_those_words(client: TestClient) -> None:
    scene = put(HANGING, "primitives.1.path.displacement", [0.6, 0.2, 0.1])
    problem = the_problem(client.post("/v1/predictions", json=scene), 422)
    assert problem["errors"][0]["field"].startswith("primitives")
    assert "apart" in problem["detail"]


def posted(client: TestClient, address: str, body: str) -> Any:
    return client.post(address, content=body.encode(), headers={"content-type": "application/json"})


@pytest.mark.parametrize(
    ("address", "body", "name"),
    [
        ("/v1/predictions", json.dumps(PAPER)[:-1] + ', "cable": {}}', "cable"),
        ("/v1/predictions", json.dumps(PAPER).replace('"u": 0.25', '"u": 0.25, "u" : 0.5'), "u"),
        ("/v1/predictions", json.dumps({"name": 'a "{" \\'} | PAPER)[:-1] + ', "name": "b"}', "name"),
        ("/v1/scenes:explain", json.dumps(PAPER).replace('"drag"', '"Lücke": 0, "Lücke": 0, "drag"'), "Lücke"),
        ("/v1/predictions:batch", json.dumps({"scenes": [PAPER]})[:-1] + ', "scenes": []}', "scenes"),
    ],
)
def test_a_name_that_is_given_twice_is_refused(client: TestClient, address: str, body: str, name: str) -> None:
    (error,) = the_problem(posted(client, address, body), 422)["errors"]
    assert error["field"] == "body"
    assert f'"{name}" appears twice in one object' in error["message"]
    assert error["given"].count(name) >= 1


def test_a_name_in_two_objects_or_in_a_text_is_no_name_twice(client: TestClient) -> None:
    scene = {**HANGING, "name": 'two "grasps": {"u": 1, "u": 2} \\'}
    assert posted(client, "/v1/predictions?store=false", json.dumps(scene)).status_code == 200


@pytest.mark.parametrize("literal", ["NaN", "Infinity", "-Infinity", "1e999"])
def test_a_number_that_is_not_finite_is_refused_by_the_name_of_its_field(client: TestClient, literal: str) -> None:
    body = json.dumps(put(PAPER, "environment.drag", 0.05)).replace('"drag": 0.05', f'"drag": {literal}')
    assert literal in body
    problem = the_problem(
        client.post("/v1/predictions", content=body, headers={"content-type": "application/json"}), 422
    )
    assert [error["field"] for error in problem["errors"]] == ["environment.drag"]


@pytest.mark.parametrize(
    ("address", "body", "field"),
    [
        ("/v1/predictions", {**PAPER, "name": "\ud800"}, "name"),
        ("/v1/predictions", {**PAPER, "\ud800": 1}, "body"),
        ("/v1/predictions", put(PAPER, "cable.preset", "a\udc00"), "cable.preset"),
        ("/v1/predictions", put(PAPER, "cable.length", {"\ud800": "\udc00"}), "cable.length"),
        ("/v1/predictions", put(PAPER, "shape", {"kind": "prediction", "id": "\ud800"}), "shape.id"),
        ("/v1/predictions", put(OBSTRUCTED, "environment.obstacles.2.\ud800", 1), "environment.obstacles[2]"),
        ("/v1/scenes:explain", put(PAPER, "shape.kind", "\ud800"), "shape.kind"),
        ("/v1/predictions:batch", {"scenes": [PAPER], "like": "\ud800"}, "like"),
        ("/v1/shapes:fit", {"points": [[0, 0]] * 4, "outliers": "\ud800"}, "outliers"),
        ("/v1/cables:identify", {"recordings": [{"name": "\ud800"}]}, "recordings[0].name"),
        ("/v1/studies", {"scenes": {"a": PAPER}, "judge": "\ud800"}, "judge"),
    ],
    ids=range(11),
)
def test_half_a_surrogate_pair_is_refused_by_the_name_of_its_field(
    client: TestClient, address: str, body: dict[str, Any], field: str
) -> None:
    problem = the_problem(posted(client, address, json.dumps(body)), 422)
    (error,) = (error for error in problem["errors"] if error["field"] == field)
    assert re.search(r"\\ud800|\\udc00", error["given"])  # by its escape


@pytest.mark.parametrize("encoding", ["utf-16", "utf-8-sig"])
def test_a_body_that_a_stored_run_could_not_be_read_from_is_refused(client: TestClient, encoding: str) -> None:
    body = json.dumps(PAPER).encode(encoding)
    problem = the_problem(
        client.post("/v1/predictions", content=body, headers={"content-type": "application/json"}), 422
    )
    assert problem["errors"][0]["field"] == "body"


@pytest.mark.parametrize(
    "body",
    [b"", b"{", b"null", b"[]", b"3", b'"scene"', b"\xff\xfe", b"[" * 100_000, b'{"a":' * 50_000, b"{'cable': 1}"],
    ids=range(10),
)
def test_a_body_that_is_not_a_json_object_is_refused_as_a_whole(client: TestClient, body: bytes) -> None:
    response = client.post("/v1/predictions", content=body, headers={"content-type": "application/json"})
    problem = the_problem(response, 422)
    assert problem["errors"][0]["field"] == "body"


def test_all_wrong_fields_are_named_at_once(client: TestClient) -> None:
    scene = put(put(put(PAPER, "cable.length", "x"), "primitives.0.u", None), "shape.kind", "circle")
    problem = the_problem(client.post("/v1/predictions", json=scene), 422)
    assert {error["field"] for error in problem["errors"]} == {"cable.length", "primitives[0].u", "shape.kind"}


def test_a_list_of_many_wrong_numbers_does_not_give_an_endless_answer(client: TestClient) -> None:
    problem = the_problem(
        client.post("/v1/predictions", json=put(POINTS, "shape.points", [["a", "b", "c"]] * 5000)), 422
    )
    assert len(problem["errors"]) == 50


def test_a_large_body_of_faults_is_refused_without_one_for_each(client: TestClient) -> None:
    frames = [[["", "", ""]] * 200] * 100
    recording = {"times": [""] * 1000, "markers": frames, "u": [""] * 1000}
    with pytest.raises(ValidationError) as found:
        IdentifyRequest.model_validate({"recordings": [recording]})
    assert found.value.error_count() == 1 + 3 * 200 + 1
    path = {"kind": "waypoints", "times": [""] * 1000, "positions": [["", "", ""]] * 1000}
    load = {"u": 0.5, "force": {"times": [""] * 1000, "values": [["", "", ""]] * 1000}}
    shape = {"kind": "straight", "velocity": [["", "", ""]] * 1000}
    scene = {**PAPER, "shape": shape, "primitives": [{"u": 0.5, "path": path}], "loads": [load]}
    problem = the_problem(client.post("/v1/predictions", json=scene), 422)
    assert len(problem["errors"]) == 3 * (1 + 3) - 1


def test_an_object_of_too_many_names_is_refused_before_each_is_a_fault(client: TestClient) -> None:
    body = json.dumps({"scenes": [{str(i): 1 for i in range(MAX_NAMES + 1)}]})
    (error,) = the_problem(posted(client, "/v1/predictions:batch", body), 422)["errors"]
    assert error["field"] == "body"
    assert "an object has too many names" in error["message"]
    assert error["allowed"].endswith(f"and at most {MAX_NAMES} names")
    assert f'"{MAX_NAMES}"' in error["given"]
    scene = {**PAPER, **{str(i): 1 for i in range(MAX_NAMES - len(PAPER))}}
    assert len(the_problem(client.post("/v1/predictions", json=scene), 422)["errors"]) == MAX_REPORTED


@pytest.mark.parametrize("body", [b"{" * 500_000, b'{"a":' * 100_000], ids=range(2))
def test_a_body_of_objects_without_end_takes_no_memory_for_each(body: bytes) -> None:
    tracemalloc.start()
    try:
        with pytest.raises(json.JSONDecodeError):
            asyncio.run(_received(body).json())
        assert tracemalloc.get_traced_memory()[1] < 20 * len(body)  # an object's names take 200
    finally:
        tracemalloc.stop()


def test_a_large_body_is_read_beside_other_requests(monkeypatch: pytest.MonkeyPatch) -> None:
    threads: list[threading.Thread] = []
    monkeypatch.setattr(bodies, "_check_names", lambda text: threads.append(threading.current_thread()))
    for size in (10, 1_000_000):
        assert asyncio.run(_received(b"[" + b" " * size + b"]").json()) == []
    assert [thread is threading.current_thread() for thread in threads] == [True, False]


def _received(content: bytes) -> bodies.JsonRequest:
    async def receive() -> Message:
        return {"type": "http.request", "body": content}

    return bodies.JsonRequest({"type": "http"}, receive)


@pytest.mark.parametrize("media", ["text/plain", "application/x-www-form-urlencoded", "application/xml", ""])
def test_another_content_type_is_refused(client: TestClient, media: str) -> None:
    body = json.dumps(PAPER).encode()
    the_problem(client.post("/v1/predictions", content=body, headers={"content-type": media}), 415)


@pytest.mark.parametrize(
    ("charset", "status"), [("utf-8", 200), ('"UTF-8"', 200), ("utf-16", 415), ("latin-1", 415), ("", 415)]
)
def test_a_body_in_another_charset_is_refused(client: TestClient, charset: str, status: int) -> None:
    headers = {"content-type": f"application/json; charset={charset}"}
    response = client.post("/v1/predictions?store=false", content=json.dumps(PAPER).encode(), headers=headers)
    assert response.status_code == status
    if status == 415:
        assert the_problem(response, 415)["detail"].startswith("Send the body in the charset utf-8")


@pytest.mark.parametrize("encoding", ["gzip", "GZIP", "br", "identity, gzip"])
@pytest.mark.parametrize("is_packed", [True, False], ids=["packed", "plain"])
def test_a_compressed_body_is_told_that_none_is_accepted(client: TestClient, encoding: str, is_packed: bool) -> None:
    body = json.dumps(PAPER).encode()
    headers = {"content-type": "application/json", "content-encoding": encoding}
    response = client.post("/v1/predictions", content=gzip.compress(body) if is_packed else body, headers=headers)
    assert "no encoding is accepted" in the_problem(response, 415)["detail"]
    assert response.headers["accept-encoding"] == "identity"


def test_a_body_that_is_declared_as_it_is_is_accepted(client: TestClient) -> None:
    headers = {"content-type": "application/json", "content-encoding": "identity"}
    response = client.post("/v1/predictions?store=false", content=json.dumps(PAPER), headers=headers)
    assert response.status_code == 200


def test_a_body_beyond_the_limit_is_refused_whether_it_says_so_or_not(client: TestClient) -> None:
    headers = {"content-type": "application/json"}
    large = b" " * 10_000_001
    problem = the_problem(client.post("/v1/predictions", content=large, headers=headers), 413)
    assert problem["title"] == "Content Too Large"
    chunks = (b" " * 1_000_000 for _ in range(11))
    assert the_problem(client.post("/v1/predictions", content=chunks, headers=headers), 413) == problem


@pytest.mark.parametrize(
    "id", ["..", "%2e%2e", "..%2f..%2fetc%2fpasswd", "A" * 28, "0" * 28, "0" * 27, "x" * 10_000, "%00"]
)
@pytest.mark.parametrize("part", ["", "/surface.npz", "/recording.rrd", "/scene.json", "/viewer"])
def test_an_id_that_is_none_is_not_found(client: TestClient, id: str, part: str) -> None:
    response = client.get(f"/v1/predictions/{id}{part}", follow_redirects=False)
    the_problem(response, 404)


def test_a_wrong_address_is_a_problem_too(client: TestClient) -> None:
    the_problem(client.get("/v1/nothing"), 404)
    the_problem(client.get("/nothing"), 404)
    the_problem(client.delete("/v1/predictions/" + "0" * 28), 404)


@pytest.mark.parametrize(
    ("query", "allowed"),
    [
        ("?like=xyz", {"like": "the id of a run, 28 of the characters 0 to 9 and a to f"}),
        ("?stor=false&foo=1", {"stor": "one of store, like", "foo": "one of store, like"}),
        (":batch?store=false", {"store": "no query parameter"}),
        ("?store=false&store=true", {"store": "one value"}),
        ("?like=&like=&foo=1", {"foo": "one of store, like", "like": "one value"}),
    ],
)
def test_a_wrong_query_is_told_what_is_allowed_and_nothing_is_stored(
    client: TestClient, query: str, allowed: dict[str, str]
) -> None:
    before = client.get("/v1/predictions").json()["total"]
    body = {"scenes": [PAPER], "store": True} if query.startswith(":") else PAPER
    problem = the_problem(client.post(f"/v1/predictions{query}", json=body), 422)
    assert {error["field"]: error["allowed"] for error in problem["errors"]} == allowed
    assert client.get("/v1/predictions").json()["total"] == before


@pytest.mark.parametrize("address", ["/v1/examples", "/v1/cables", "/v1/studies", "/v1/predictions/" + "0" * 28])
def test_every_address_of_the_api_refuses_an_unknown_query(client: TestClient, address: str) -> None:
    problem = the_problem(client.get(f"{address}?page=2"), 422)
    assert [error["field"] for error in problem["errors"]] == ["page"]


def test_a_list_in_a_query_may_have_several_values(client: TestClient) -> None:
    assert client.get("/v1/predictions?status=converged&status=stalled").status_code == 200


@pytest.mark.parametrize("address", ["/v1/examples?token=x", "/health?now=1", "/?token=x", "/scene/?example=paper-25"])
def test_pages_probes_and_a_token_are_no_unknown_query(client: TestClient, address: str) -> None:
    assert client.get(address).status_code == 200


@pytest.mark.parametrize(
    ("path", "value", "allowed"),
    [
        ("quality", "best", "one of auto or an object with some of n_u, n_t,"),
        ("effects", "on", "one of auto or an object with some of inertia, drag,"),
        ("cable.rest_shape", "bent", "one of straight, initial or a list"),
        ("name", "x" * 5000, "at most 200 characters"),
    ],
)
def test_every_form_and_bound_of_a_text_is_told(client: TestClient, path: str, value: str, allowed: str) -> None:
    (error,) = the_problem(client.post("/v1/predictions", json=put(PAPER, path, value)), 422)["errors"]
    assert error["allowed"].startswith(allowed)


@pytest.mark.parametrize(
    ("method", "address", "allowed"),
    [
        ("PUT", "/v1/predictions", "GET, POST"),
        ("PATCH", "/v1/predictions/" + "0" * 28, "DELETE, GET"),
        ("GET", "/v1/predictions:batch", "POST"),
        ("PUT", "/v1/calibration", "DELETE, GET, POST"),
        ("POST", "/health", "GET, HEAD"),
        ("POST", "/docs", "GET, HEAD"),
        ("DELETE", "/scene/", "GET, HEAD"),
        ("PUT", "/", "GET, HEAD"),
        ("PUT", "/static-offline-docs/swagger-ui.css", "GET, HEAD"),
    ],
)
def test_a_wrong_method_is_told_which_ones_are_right(
    client: TestClient, method: str, address: str, allowed: str
) -> None:
    response = client.request(method, address)
    the_problem(response, 405)
    assert response.headers["allow"] == allowed
