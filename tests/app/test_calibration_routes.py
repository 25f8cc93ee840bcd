"""The calibration over HTTP and on the command line: none at first, measured on request, followed, stopped, read."""

import errno
import os
from collections.abc import Iterator
from pathlib import Path

import pytest
from fastapi.testclient import TestClient

from app import cli
from app.main import create_app
from app.schemas.calibration import CalibrationResponse, MeasurementResponse
from app.service.measurements import Tell
from app.settings import Settings
from dlocore import calibration
from dlocore.calibration import Calibration
from dlocore.study import calibrating
from tests.app.conftest import paper_scene, start
from tests.app.test_bad_requests import the_problem
from tests.app.test_jobs import parsed

ADDRESS = "/v1/calibration"


@pytest.fixture(scope="module")
def fresh(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    """A service that has not been calibrated and, when it is, takes few grids."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(calibrating, "GRIDS", {"march": ((9, 13), (13, 19), (17, 25)), "spacetime": ((9, 13), (13, 19))})
        app = create_app(Settings(data_dir=tmp_path_factory.mktemp("data")))
        with TestClient(app, raise_server_exceptions=False) as client:
            yield start(client)


def test_before_it_is_measured_there_is_none(fresh: TestClient) -> None:
    problem = the_problem(fresh.get(ADDRESS), 404)
    assert problem["type"] == "urn:dlo:problem:not-calibrated"
    the_problem(fresh.get(f"{ADDRESS}/events"), 404)
    the_problem(fresh.delete(ADDRESS), 404)


def test_it_is_measured_on_request_and_can_be_stopped(fresh: TestClient) -> None:
    taken = fresh.post(ADDRESS)
    assert taken.status_code == 202
    document = taken.json()
    MeasurementResponse.model_validate(document, strict=True)
    assert taken.headers["location"] == document["links"]["self"] == ADDRESS
    assert fresh.post(ADDRESS).json()["id"] == document["id"], "one at a time"
    stopped = fresh.delete(ADDRESS)
    assert stopped.status_code in (200, 202)
    last = parsed(fresh.get(f"{ADDRESS}/events").text)[-1]
    assert last[0] == "error"
    assert last[2]["type"] == "urn:dlo:problem:cancelled"
    the_problem(fresh.get(ADDRESS), 404)


def test_its_progress_ends_with_what_is_then_read(fresh: TestClient) -> None:
    response = fresh.post(ADDRESS, headers={"accept": "text/event-stream"})
    events = parsed(response.text)
    news = [data for kind, _, data in events if kind == "progress"]
    assert [n["number"] for n in news] == list(range(len(news)))
    assert news[0]["done"] == 0
    assert news[-1]["done"] == news[-1]["total"]
    kind, _, document = events[-1]
    assert kind == "done"
    plane = fresh.get(ADDRESS).json()
    assert plane == document
    CalibrationResponse.model_validate(plane, strict=True)
    assert plane["current"]
    assert {p["method"] for p in plane["points"]} == {"march", "spacetime"}
    assert len(plane["points"]) == 5
    assert all(0 <= i < 5 for i in plane["front"])
    assert plane["default"]["method"] == "auto"
    assert 0.0 < plane["default"]["error"] < 2e-3
    space = fresh.get(ADDRESS, params={"dimensions": 3}).json()
    assert space["dimensions"] == 3
    assert space["points"] != plane["points"]
    assert space["default"] != plane["default"]
    the_problem(fresh.get(ADDRESS, params={"dimensions": 4}), 422)
    again = parsed(fresh.get(f"{ADDRESS}/events", headers={"last-event-id": "2"}).text)
    assert [data["number"] for kind, _, data in again if kind == "progress"] == list(range(3, len(news)))
    nothing = fresh.get(f"{ADDRESS}/events", headers={"last-event-id": again[-1][1] or ""})
    assert nothing.status_code == 204
    assert (nothing.headers["cache-control"], nothing.headers["vary"]) == ("no-store", "Accept")


def test_the_next_one_is_told_whole_to_who_followed_the_last(
    fresh: TestClient, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It had nothing left to tell, or its beginning was swallowed: its events have the same numbers."""

    def measured(*, on_progress: Tell, **options: object) -> Calibration:
        on_progress(0, 1, "march")
        found = calibration.load(_file(fresh))
        assert found is not None
        return found

    monkeypatch.setattr(calibrating, "measure", measured)
    told = [parsed(fresh.post(ADDRESS, headers={"accept": "text/event-stream"}).text) for _ in range(2)]
    for _, id, _ in told[0]:
        if id is not None:
            again = fresh.get(f"{ADDRESS}/events", headers={"last-event-id": id})
            assert again.status_code == 200
            assert [kind for kind, _, _ in parsed(again.text)] == ["state", "progress", "done"]


def test_one_that_cant_be_written_is_told_of_with_507(fresh: TestClient, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(found: Calibration, file: Path) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(calibrating, "measure", lambda **options: calibration.load(_file(fresh)))
    monkeypatch.setattr(Calibration, "save", full)
    kind, _, problem = parsed(fresh.post(ADDRESS, headers={"accept": "text/event-stream"}).text)[-1]
    assert kind == "error"
    assert problem["status"] == 507
    assert problem["detail"] == "The calibration can't be written: No space left on device."


def _file(client: TestClient) -> Path:
    settings: Settings = client.app.state.settings  # type: ignore[attr-defined]
    return settings.calibration_file


def test_predictions_are_answered_while_it_is_measured(fresh: TestClient) -> None:
    fresh.post(ADDRESS)
    assert fresh.post("/v1/predictions?store=false", json=paper_scene()).status_code == 200
    assert fresh.delete(ADDRESS).status_code in (200, 202)


def test_the_stored_one_is_there_after_a_restart(fresh: TestClient) -> None:
    data = fresh.app.state.service.settings.data_dir  # type: ignore[attr-defined]
    with TestClient(create_app(Settings(data_dir=data))) as client:
        assert client.get(ADDRESS).json()["points"]


def test_the_command_keeps_what_it_measured_where_the_service_reads_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("DLO_DATA_DIR", str(tmp_path))
    monkeypatch.setattr(calibrating, "GRIDS", {"march": ((9, 13), (13, 19)), "spacetime": ((9, 13),)})
    assert cli.main(["calibrate", "--repeats", "1"]) == 0
    printed = capsys.readouterr()
    assert "march         9   13" in printed.out
    assert str(tmp_path / "calibration.json") in printed.err
    stored = calibration.load()
    assert stored is not None
    assert len(stored.points) == 2 * 3
    assert cli.main(["calibrate", "--repeats", "0"]) == 2
    assert "--repeats" in capsys.readouterr().err
