"""The doors to identification: the command line, the page, the service with its course of events."""

import asyncio
import json
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

from app.cli import main
from app.http.fields import BadField
from app.http.problems import ProblemError
from app.routes import identify as routes
from app.schemas.identify import IdentifyRequest
from app.service import searches
from app.service.worker import Worker
from benchmarks.simulated_recordings import CABLE, DRAG, Tracking, simulated
from dlocore import Cancelled, PointMass, SceneError
from dlocore.recordings import save_recording
from tests.app.test_bad_requests import the_problem

ADDRESS = "/v1/cables:identify"
KNOWN = {
    "length": 1.0,
    "diameter": 0.006,
    "linear_density": 0.05,
    "bending_stiffness": 3e-3,
    "bending_damping": 2e-4,
}


@pytest.fixture(scope="module")
def asked() -> dict[str, Any]:
    recording = simulated(6, 1.5, cable=CABLE, environment=DRAG)
    markers = np.asarray(recording.markers)
    return {
        "recordings": [
            {
                "times": np.asarray(recording.times).tolist(),
                "markers": [[None if np.isnan(m[0]) else m.tolist() for m in frame] for frame in markers],
                "u": np.asarray(recording.u).tolist(),
                "held": list(recording.held),
                "length": 1.0,
                "linear_density": 0.05,
                "name": "shaken",
            }
        ],
        "parameters": ["bending_stiffness", "drag", "bending_damping"],
    }


def test_the_service_identifies_a_cable_that_a_scene_takes(client: TestClient, asked: dict[str, Any]) -> None:
    response = client.post(ADDRESS, json=asked)
    assert response.status_code == 200, response.text
    answer = response.json()
    stiffness = answer["parameters"][0]
    assert stiffness["name"] == "bending_stiffness"
    # one and a half seconds of badly tracked motion on 13 control points; benchmarks/identification.py tells more
    assert stiffness["value"] == pytest.approx(3e-3, rel=0.2)
    scene = {
        "cable": answer["cable"],
        "shape": {"kind": "straight"},
        "primitives": [{"u": 0.0, "path": {"kind": "move", "displacement": [0, 0.1, 0], "duration": 1}}],
        "environment": answer["environment"],
    }
    explained = client.post("/v1/scenes:explain", json=scene)
    assert explained.status_code == 200, explained.text


def test_what_is_known_of_the_cable_is_kept_where_it_is_not_sought(client: TestClient, asked: dict[str, Any]) -> None:
    answer = client.post(ADDRESS, json={**asked, "cable": KNOWN, "parameters": ["drag"]}).json()
    assert {name: answer["cable"][name] for name in KNOWN} == KNOWN
    assert "kept at an assumed value: bending" not in answer["message"]
    assert answer["parameters"][0]["value"] == pytest.approx(DRAG.drag, rel=0.3)


def test_a_recording_tells_what_hangs_on_the_cable(asked: dict[str, Any]) -> None:
    told = {**asked["recordings"][0], "point_masses": [{"u": 1.0, "mass": 0.02}]}
    (recording,) = routes._recordings(IdentifyRequest.model_validate({**asked, "recordings": [told]}))
    assert recording.point_masses == (PointMass(u=1.0, mass=0.02),)


def test_a_search_has_the_control_points_that_are_asked_for(
    client: TestClient, asked: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    taken: dict[str, Any] = {}

    def search(*_: object, **options: Any) -> None:
        taken.update(options)
        raise SceneError("recordings", "none", "what is sought in earnest")

    monkeypatch.setattr(searches, "identify", search)
    the_problem(client.post(ADDRESS, json={**asked, "n_u": 21}), 422)
    assert taken["resolution"].n_u == 21
    assert taken["names"] == tuple(asked["parameters"])


def test_the_course_of_an_identification_is_told_as_events(client: TestClient, asked: dict[str, Any]) -> None:
    response = client.post(ADDRESS, json=asked, headers={"Accept": "text/event-stream"})
    events = [block.split("\n") for block in response.text.strip().split("\n\n")]
    kinds = [lines[0].removeprefix("event: ") for lines in events]
    assert kinds[-1] == "done"
    assert set(kinds[:-1]) == {"iteration"}
    assert json.loads(events[-1][1].removeprefix("data: "))["status"] == "converged"


def test_a_recording_is_not_read_on_the_event_loop(
    client: TestClient, asked: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
    def read(*_: object) -> None:
        with pytest.raises(RuntimeError, match="no running event loop"):
            asyncio.get_running_loop()
        raise SceneError("times", "these", "others")

    monkeypatch.setattr(routes, "recording_of", read)
    response = client.post(ADDRESS, json=asked)
    assert response.status_code == 422
    assert response.json()["errors"][0]["field"] == "recordings[0].times"


def test_no_search_takes_longer_than_the_service_allows(client: TestClient, asked: dict[str, Any]) -> None:
    worker: Worker = client.app.state.service.worker  # type: ignore[attr-defined]
    limit, worker.time_limit = worker.time_limit, 1e-3
    try:
        the_problem(client.post(ADDRESS, json=asked), 504)
    finally:
        worker.time_limit = limit


def test_searches_run_one_at_a_time_few_wait_and_all_can_be_stopped(monkeypatch: pytest.MonkeyPatch) -> None:
    begun: list[int] = []
    running = threading.Lock()

    def search(numbers: list[int], cancelled: Callable[[], bool]) -> None:
        with running:
            begun.append(numbers[0])
            while not cancelled():
                time.sleep(0.01)
            assert running.locked()
        raise Cancelled

    async def crowd() -> None:
        worker = Worker(workers=1, queue_size=0, time_limit=60.0)
        shared, stopped = searches.Searches(worker), [threading.Event() for _ in range(searches.WAITING + 1)]
        tasks = [
            asyncio.create_task(shared.identify([k], event.is_set))  # type: ignore[list-item]
            for k, event in enumerate(stopped)
        ]
        while len(begun) < 1:
            await asyncio.sleep(0.01)
        with pytest.raises(ProblemError) as refusal:
            shared.check_room()
        assert refusal.value.status == 429
        stopped[0].set()
        while len(begun) < 2:
            await asyncio.sleep(0.01)
        shared.check_room()
        worker.cancel_all()
        ended = await asyncio.gather(*tasks, return_exceptions=True)
        assert [getattr(end, "status", end) for end in ended] == [503] * len(tasks)

    monkeypatch.setattr(searches, "identify", search)
    asyncio.run(crowd())


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"parameters": ["colour"]}, "parameters"),
        ({"recordings": []}, "recordings"),
        ({"colour": 1}, "colour"),
        ({"cable": {"length": 1.0, "diameter": 0.005}}, "cable.linear_density"),
        ({"cable": {"length": -1.0, "diameter": 0.005, "linear_density": 0.05}}, "cable.length"),
    ],
)
def test_what_is_wrong_is_named(client: TestClient, asked: dict[str, Any], change: dict[str, Any], field: str) -> None:
    response = client.post(ADDRESS, json=asked | change)
    assert response.status_code == 422
    assert response.json()["errors"][0]["field"].startswith(field)


def test_frames_with_other_numbers_of_markers_are_named(client: TestClient, asked: dict[str, Any]) -> None:
    recording = dict(asked["recordings"][0])
    recording["markers"] = [*recording["markers"][:5], recording["markers"][5][:4], *recording["markers"][6:]]
    response = client.post(ADDRESS, json=asked | {"recordings": [recording]})
    assert response.status_code == 422
    assert response.json()["errors"][0]["field"] == "recordings[0].markers[5]"


@pytest.mark.parametrize(
    ("change", "field", "given"),
    [
        ({"held": []}, "recordings[1].held", "[]"),
        ({"held": [1, 1]}, "recordings[1].held", "[1, 1]"),
        ({"u": [0.0, 0.5]}, "recordings[1].u", "2 numbers"),
        ({"times": [0.0, 0.1]}, "recordings[1].markers", "{frames} frames"),
        ({"length": 3.0}, "recordings[1].length", "3 m"),
        ({"name": "shaken"}, "recordings[1].name", "shaken"),
        ({}, "recordings[1]", "times and markers of 'shaken' again"),
    ],
)
def test_what_is_wrong_with_a_recording_is_named_by_its_number_in_words_of_json(
    client: TestClient, asked: dict[str, Any], change: dict[str, Any], field: str, given: str
) -> None:
    first = asked["recordings"][0]
    second = {name: value for name, value in first.items() if name != "name"} | change
    moved = second["markers"] if change == {} else second["markers"][::-1]
    response = client.post(ADDRESS, json=asked | {"recordings": [first, {**second, "markers": moved}]})
    (error,) = the_problem(response, 422)["errors"]
    assert (error["field"], error["given"]) == (field, given.format(frames=len(first["markers"])))


def test_recordings_without_names_are_told_apart(asked: dict[str, Any]) -> None:
    unnamed = {name: value for name, value in asked["recordings"][0].items() if name != "name"}
    found = routes._recordings(IdentifyRequest.model_validate({"recordings": [unnamed, unnamed]}))
    assert [recording.name for recording in found] == ["recordings[0]", "recordings[1]"]


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("(0, 0)", "[0, 0]"),
        ("()", "[]"),
        ("None", "null"),
        ("True", "true"),
        ("1e-05", "1e-05"),
        ("a cable", "a cable"),
        ("[...]", "[...]"),  # a value of Python, which JSON has no word for
        ("(1j,)", "(1j,)"),
    ],
)
def test_a_value_of_python_is_shown_as_json_has_it(text: str, shown: str) -> None:
    field = BadField.from_scene_error(SceneError("x", text, "others"))
    assert field.given == shown
    assert field.message == f"Got {shown}. Allowed: others."


def test_the_command_line_writes_the_cable_and_a_page(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    recording = simulated(6, 1.5, cable=CABLE, environment=DRAG)
    save_recording(recording, tmp_path / "shaken.npz")
    command = ["identify", str(tmp_path / "shaken.npz"), "-o", str(tmp_path / "cable.json")]
    command += ["--report", str(tmp_path / "page.html"), "--parameters", "bending_stiffness,drag,bending_damping"]
    assert main(command) == 0
    cable = json.loads((tmp_path / "cable.json").read_text())
    assert cable["cable"]["bending_stiffness"] == pytest.approx(3e-3, rel=0.2)
    page = (tmp_path / "page.html").read_text()
    assert page.count("<svg") == 2
    assert "http" not in page  # it needs nothing from elsewhere
    assert "bending_damping" in capsys.readouterr().err


def test_the_command_line_begins_with_what_is_known_of_the_cable(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    save_recording(simulated(6, 1.5, cable=CABLE, environment=DRAG), tmp_path / "shaken.npz")
    file = tmp_path / "known.json"
    command = ["identify", str(tmp_path / "shaken.npz"), "-o", str(tmp_path / "cable.json"), "--parameters", "drag"]
    for document in (KNOWN, {"cable": KNOWN, "status": "converged"}):
        file.write_text(json.dumps(document))
        assert main([*command, "--cable", str(file)]) == 0
        cable = json.loads((tmp_path / "cable.json").read_text())["cable"]
        assert {name: cable[name] for name in KNOWN} == KNOWN
    for wrong, told in (
        ("{", "not JSON"),
        ("[]", "object"),
        (json.dumps({**KNOWN, "colour": 1}), "colour"),
        (json.dumps({**KNOWN, "diameter": -1.0}), "diameter: Got -1.0"),
        (json.dumps({"length": 1.0, "diameter": 0.005}), "linear_density"),
    ):
        file.write_text(wrong)
        capsys.readouterr()
        assert main([*command, "--cable", str(file)]) == 2
        said = capsys.readouterr().err
        assert "known.json" in said
        assert told in said
    assert main([*command[:3], str(file), "--cable", str(file)]) == 2  # it would be written over


def test_the_command_line_names_what_is_wrong(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "a.npz").write_bytes(b"nothing")
    assert main(["identify", str(tmp_path / "a.npz")]) == 2
    assert main(["identify", str(tmp_path / "missing.npz")]) == 2
    assert main(["validate", str(tmp_path / "missing")]) == 2
    assert "missing" in capsys.readouterr().err


def test_a_cable_is_validated_from_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    clean = Tracking(noise=2e-5, held=2e-5, outliers=0.0, lost=0.0)
    windows = [simulated(k, 1.0, cable=CABLE, environment=DRAG, tracking=clean) for k in (3, 4, 5)]
    np.savez(tmp_path / "cable_train.npz", markers=np.array([np.asarray(w.markers)[::2] for w in windows]))
    (tmp_path / "cable_train.json").write_text(
        json.dumps({"held_markers": [0, 1, -2, -1], "nominal_linear_density": 0.05})
    )
    numbers, plots = tmp_path / "numbers.json", tmp_path / "plots"
    asked = ["validate", str(tmp_path / "cable_train.npz"), "--fit", "1", "--models", "scalars"]
    assert main([*asked, "--json", str(numbers), "--plots", str(plots)]) == 0
    assert "cable   scalars" in capsys.readouterr().out
    found = json.loads(numbers.read_text())[0]
    assert len(found["windows"]) == 2
    # the cable is one that the model describes; what is left is that its length is told by chords, not arcs
    assert max(found["windows"].values()) < 2e-3
    for name in ("validation-windows.svg", "validation-time.svg"):
        assert (plots / name).read_text().startswith("<svg")
