"""Studies over HTTP: taken up, followed, stopped, stored, read; and on the command line."""

import errno
import json
import os
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from app import cli
from app.routes.studies import store_of
from app.schemas.calibration import MeasurementResponse
from app.schemas.ids import new_id
from app.schemas.study import StudyList, StudyResponse
from app.store import studies
from dlocore.study import record
from tests.app.conftest import SCENES, paper_scene
from tests.app.test_bad_requests import the_problem
from tests.app.test_jobs import parsed

ADDRESS = "/v1/studies"
QUICK = {
    "scenes": {"a quarter": paper_scene()},
    "grids": [{"n_u": 9, "n_t": 13}, {"n_u": 13, "n_t": 19}],
    "methods": ["march"],
    "repeats": 1,
}
LONG = {"repeats": 100}


def test_a_study_is_followed_to_its_end_and_then_read(client: TestClient) -> None:
    response = client.post(ADDRESS, json=QUICK, headers={"accept": "text/event-stream"})
    assert response.status_code == 200
    events = parsed(response.text)
    assert [kind for kind, _, _ in events if kind != "progress"] == ["state", "state", "done"][-len(events) :]
    news = [data for kind, _, data in events if kind == "progress"]
    assert news[-1]["done"] == news[-1]["total"]
    address = response.headers["location"]
    document = client.get(address).json()
    assert document == events[-1][2]
    StudyResponse.model_validate(document, strict=True)
    assert document["state"] == "done"
    assert document["created"][:19] <= document["measured_at"][:19]
    assert [(run["n_u"], run["method"]) for run in document["runs"]] == [(9, "march"), (13, "march")]
    assert document["runs"][0]["error"] > document["runs"][1]["error"] > 0
    summary = StudyList.model_validate(client.get(ADDRESS).json(), strict=True).studies[0]
    assert (summary.id, summary.created, summary.state) == (document["id"], document["created"], "done")
    assert (summary.links.self, summary.size) == (address, len(client.get(address).content))
    seen = {"last-event-id": events[-1][1] or ""}
    assert client.get(f"{address}/events", headers=seen).status_code == 204  # so that an EventSource stops
    assert client.delete(address).status_code == 204
    the_problem(client.get(address), 404)
    the_problem(client.delete(address), 404)
    the_problem(client.get(f"{address}/events"), 404)


def test_a_study_of_an_earlier_life_of_the_service_is_told_once(client: TestClient) -> None:
    id = new_id()
    store_of(client.app.state.service).save(id, b'{"state":"done"}')  # type: ignore[attr-defined]
    address = f"{ADDRESS}/{id}/events"
    for seen in ("", "12"):  # of the progress, after which it ended
        told = parsed(client.get(address, headers={"last-event-id": seen}).text)
        assert [kind for kind, _, _ in told] == ["state", "done"]
        assert told[-1][2] == {"state": "done"}
    assert client.get(address, headers={"last-event-id": told[-1][1] or ""}).status_code == 204
    client.delete(f"{ADDRESS}/{id}")


def test_a_study_that_cant_be_stored_can_be_read(client: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(studies, "write_whole", full)
    response = client.post(ADDRESS, json=QUICK, headers={"accept": "text/event-stream"})
    (*_, (kind, _, document)) = parsed(response.text)
    assert kind == "done"
    assert client.get(response.headers["location"]).json() == document
    assert client.delete(response.headers["location"]).status_code == 204


def test_a_study_under_way_is_read_as_its_state_and_can_be_stopped(client: TestClient) -> None:
    taken = client.post(ADDRESS, json=LONG)
    assert taken.status_code == 202
    MeasurementResponse.model_validate(taken.json(), strict=True)
    address = taken.headers["location"]
    assert client.get(address).status_code == 202
    waiting = client.post(ADDRESS, json=LONG)
    newest = client.get(ADDRESS).json()["studies"][:2]
    assert [study["links"]["self"] for study in newest] == [waiting.headers["location"], address]
    assert [study["created"] for study in newest] == [waiting.json()["created"], taken.json()["created"]]
    assert {study["state"] for study in newest} <= {"queued", "running"}
    assert client.delete(waiting.headers["location"]).json()["state"] == "cancelled"
    assert client.delete(address).status_code in (200, 202)
    _, number, problem = parsed(client.get(f"{address}/events").text)[-1]
    assert problem["type"] == "urn:dlo:problem:cancelled"
    assert client.get(f"{address}/events", headers={"last-event-id": number or ""}).status_code == 204
    assert client.get(address).json()["state"] == "cancelled"
    assert [study["state"] for study in client.get(ADDRESS).json()["studies"][:2]] == ["cancelled"] * 2


def test_effects_are_compared_and_impossible_scenes_are_refused_by_name(client: TestClient) -> None:
    sets = {"chosen": {}, "no drag": {"drag": "off"}}
    response = client.post(ADDRESS, json={**QUICK, "effects": sets}, headers={"accept": "text/event-stream"})
    runs = parsed(response.text)[-1][2]["runs"]
    assert {(run["effects"], "drag" in run["active"]) for run in runs} == {("chosen", True), ("no drag", False)}
    far = paper_scene(primitives=[{**paper_scene()["primitives"][0], "u": 1.5}])
    problem = the_problem(client.post(ADDRESS, json={"scenes": {"far": far}}), 422)
    assert problem["errors"][0]["field"] == "scenes.far.primitives[0].u"
    problem = the_problem(client.post(ADDRESS, json={**QUICK, "effects": {"x": {"stretch": "off"}}}), 422)
    assert problem["errors"][0]["field"] == "effects.stretch"


@pytest.mark.parametrize(
    "wrong", [{"grids": []}, {"grids": [{"n_u": 3, "n_t": 13}]}, {"repeats": 0}, {"methods": ["guess"]}, {"judge": 1}]
)
def test_a_wrong_study_is_refused(client: TestClient, wrong: dict[str, Any]) -> None:
    the_problem(client.post(ADDRESS, json=wrong), 422)


def test_what_is_wrong_under_a_name_is_told_what_is_allowed(client: TestClient) -> None:
    alone = the_problem(client.post("/v1/predictions", json=paper_scene(effects={"foo": "on"})), 422)["errors"][0]
    asked = {"effects": {"x": {"foo": "on"}}, "scenes": {"a": paper_scene(effects={"foo": "on"}, horizon=-1)}}
    problem = the_problem(client.post(ADDRESS, json=asked), 422)
    allowed = {error["field"]: error["allowed"] for error in problem["errors"]}
    assert "self_contact" in alone["allowed"]
    assert allowed["effects.x.foo"] == allowed["scenes.a.effects.foo"] == alone["allowed"]
    assert allowed["scenes.a.horizon"].startswith("a finite number above 0")


@pytest.mark.parametrize(
    ("field", "values"),
    [
        ("methods", ["march", "march"]),
        ("parts", ["runs", "runs"]),
        ("deltas", [1e-5, 1e-5]),
        ("grids", [{"n_u": 9, "n_t": 13}] * 2),
    ],
)
def test_what_is_to_be_measured_twice_is_refused(client: TestClient, field: str, values: list[Any]) -> None:
    problem = the_problem(client.post(ADDRESS, json={**QUICK, field: values}), 422)
    assert [(error["field"], error["allowed"]) for error in problem["errors"]] == [(field, "each once")]


@pytest.mark.parametrize("id", ["0" * 28, "..", "x"])
def test_an_id_that_is_none_is_not_found(client: TestClient, id: str) -> None:
    assert client.get(f"{ADDRESS}/{id}").status_code == 404


def command(*arguments: str) -> int:
    quick = ["--grids", "9x13", "13x19", "--methods", "march", "--parts", "runs", "--repeats", "1"]
    return cli.main(["study", str(SCENES / "paper-fig1.json"), *quick, *arguments])


def test_the_command_measures_writes_draws_and_compares(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first = tmp_path / "first.json"
    assert command("-o", str(first)) == 0
    assert "paper-fig1" in capsys.readouterr().out
    study = json.loads(first.read_text())
    for run in study["runs"]:
        run["error"] /= 2  # it was better then
    before = tmp_path / "before.json"
    before.write_text(json.dumps(study))
    assert command("--compare", str(before), "--plots", str(tmp_path / "plots")) == 4
    printed = capsys.readouterr().out
    assert "2 runs compared" in printed
    assert "worse  error" in printed
    pytest.importorskip("matplotlib")
    assert {file.name for file in (tmp_path / "plots").iterdir()} == {"work-precision.png", "phases.png"}


def test_the_table_tells_thresholds_apart_and_has_the_estimates(capsys: pytest.CaptureFixture[str]) -> None:
    quick = ["--grids", "9x13", "--parts", "runs", "--repeats", "1"]
    assert cli.main(["study", str(SCENES / "paper-fig1.json"), *quick, "--deltas", "1e-5", "1e-3", "--estimate"]) == 0
    head, *rows = capsys.readouterr().out.splitlines()
    assert "delta [m]" in head
    assert "estimate [mm]" in head
    assert [row.split()[6] for row in rows] == ["1e-05", "1e-05", "0.001"]
    assert all(float(row.split()[9]) > 0.0 for row in rows)
    assert cli.main(["study", str(SCENES / "paper-fig1.json"), *quick, "--methods", "march"]) == 0
    plain = capsys.readouterr().out
    assert "delta" not in plain
    assert "estimate" not in plain


def test_costs_by_size_and_by_effect_are_printed_too(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    scaling = tuple(
        record.Scaled(variable="n_u", value=9.0, method=method, wall_time=2e-3, spread=0.0)
        for method in ("march", "spacetime")
    )
    found = record.Study(
        machine={}, source="", measured_at="", duration=1.0, judge="march", runs=(), scaling=scaling,
        effects=(record.EffectCost(effect="drag", present=3e-3, absent=1e-3),),
    )  # fmt: skip
    monkeypatch.setattr("dlocore.study.running.run_study", lambda plan, **options: found)
    assert cli.main(["study", "--parts", "scaling", "effects"]) == 0
    assert capsys.readouterr().out.splitlines() == [
        "cost against n_u = 9: march takes 2 ms",
        "cost against n_u = 9: one iteration of spacetime takes 2 ms",
        "cost of drag: a march with it takes 3 ms, without it 1 ms",
    ]


def test_a_study_of_the_service_can_be_compared_on_the_command_line(client: TestClient, tmp_path: Path) -> None:
    response = client.post(ADDRESS, json=QUICK, headers={"accept": "text/event-stream"})
    document = client.get(response.headers["location"]).content
    (tmp_path / "study.json").write_bytes(document)
    assert len(record.load(tmp_path / "study.json").runs) == 2


@pytest.mark.parametrize(
    ("arguments", "word"),
    [
        (["--grids", "9by13"], "9by13"),
        (["--n-u", "9"], "--n-t"),
        (["--methods", "guess"], "guess"),
        (["--effects", "drag"], "drag=on"),
        (["--effects", "wind=on"], "wind"),
        (["--repeats", "0"], "repeats"),
        (["--compare", "nowhere.json"], "nowhere.json"),
        (["nowhere.json"], "nowhere.json"),
    ],
)
def test_a_wrong_command_says_what_is_wrong(
    arguments: list[str], word: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["study", *arguments]) == 2
    assert word in capsys.readouterr().err
