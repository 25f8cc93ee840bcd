"""A data folder that is full or gone: predictions are answered all the same, and say that they are not stored."""

import errno
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import orjson
import pytest
from fastapi.testclient import TestClient

from app.main import create_app
from app.settings import Settings
from app.store import runs
from tests.app.conftest import paper_scene, start
from tests.app.test_bad_requests import the_problem
from tests.app.test_jobs import parsed, until

GONE = "It is not stored: No such file or directory."


@pytest.fixture(scope="module")
def stored(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[TestClient, Path, dict[str, Any]]]:
    """A service, its data folder, and a run that it has stored."""
    data = tmp_path_factory.mktemp("data")
    with TestClient(create_app(Settings(data_dir=data)), raise_server_exceptions=False) as client:
        yield client, data, start(client).post("/v1/predictions", json=paper_scene()).json()


@pytest.fixture
def gone(stored: tuple[TestClient, Path, dict[str, Any]]) -> Iterator[TestClient]:
    """The service while the folder of the runs has gone."""
    client, data, _ = stored
    (data / "runs").rename(data / "elsewhere")
    yield client
    (data / "elsewhere").rename(data / "runs")


def test_what_cant_be_stored_is_answered_and_says_why(gone: TestClient, caplog: pytest.LogCaptureFixture) -> None:
    response = gone.post("/v1/predictions", json=paper_scene())
    assert response.status_code == 200
    assert "location" not in response.headers
    document = response.json()
    assert document["status"] == "converged"
    assert document["links"] is None
    assert document["message"].endswith(GONE)
    assert [record.message for record in caplog.records if "not stored" in record.message] == [
        f"the run is not stored: [Errno 2] No such file or directory: '{_unfinished(gone, document['id'])}'"
    ]


def _unfinished(client: TestClient, id: str) -> Path:
    settings: Settings = client.app.state.settings  # type: ignore[attr-defined]
    return settings.data_dir / "runs" / f".new-{id}"


def test_every_way_to_a_prediction_gives_what_cant_be_stored(gone: TestClient) -> None:
    taken = gone.post("/v1/predictions", json=paper_scene(), headers={"prefer": "respond-async"})
    assert until(gone, taken.headers["location"], "done")["message"].endswith(GONE)
    the_problem(gone.get(f"{taken.headers['location']}/recording.rrd"), 409)
    followed = gone.post("/v1/predictions", json=paper_scene(), headers={"accept": "text/event-stream"})
    assert parsed(followed.text)[-1][2]["message"].endswith(GONE)
    lines = gone.post("/v1/predictions:batch", json={"scenes": [paper_scene()], "store": True}).text
    assert orjson.loads(lines)["result"]["message"].endswith(GONE)


@pytest.mark.parametrize("file", [False, True], ids=["gone", "a file"])
def test_a_run_whose_folder_has_gone_is_not_found_and_can_be_removed(
    stored: tuple[TestClient, Path, dict[str, Any]], file: bool
) -> None:
    client, data, _ = stored
    document = client.post("/v1/predictions", json=paper_scene()).json()
    folder = data / "runs" / document["id"]
    shutil.rmtree(folder)
    if file:
        folder.write_bytes(b"")
    the_problem(client.get(document["links"]["self"]), 404)
    the_problem(client.get(document["links"]["recording"]), 404)
    assert client.delete(document["links"]["self"]).status_code == 204


def test_a_recording_that_cant_be_written_is_refused_with_507(
    stored: tuple[TestClient, Path, dict[str, Any]], monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(run: object, path: Path) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    client, _, document = stored
    monkeypatch.setattr(runs, "write_recording", full)
    problem = the_problem(client.get(document["links"]["recording"]), 507)
    assert problem["detail"] == "The recording can't be written: No space left on device."


def test_a_recording_into_a_folder_that_is_not_there_is_an_os_error(
    stored: tuple[TestClient, Path, dict[str, Any]], tmp_path: Path
) -> None:
    pytest.importorskip("rerun")
    run = stored[0].app.state.service.runs.load(stored[2]["id"])  # type: ignore[attr-defined]
    with pytest.raises(OSError, match="No such file"):
        runs.write_recording(run, tmp_path / "nowhere" / "x.rrd")
