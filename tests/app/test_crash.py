"""A process killed at any moment leaves whole runs only, and what was half-written goes at the next start."""

import io
import json
import os
import random
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest

from app.archive import pack
from app.schemas import PredictionRequest, to_scene
from app.settings import Settings
from app.store.runs import SUMMARY, RunStore
from dlocore import predict
from tests.app.conftest import ROOT, paper_scene

rr = pytest.importorskip("rerun")
RUNS = 40
WRITERS = 8
CAP = 30  # runs that the store keeps, well below what is written before a kill
KILLS = 4
MOST_KILLS = 60  # until one comes while a run is being written
# Predicts once; then, for every file that it is told of, a process of its own saves that prediction over and over, on
# threads, and notes the id of every run that is kept.
WRITER = """
import json, os, sys, threading
from pathlib import Path
from app.store.runs import RunStore
from app.schemas import PredictionRequest, to_scene
from app.settings import Settings
from dlocore import predict

scene = json.loads(sys.argv[2])
prediction = predict(to_scene(PredictionRequest.model_validate(scene), lambda id: None))

def write(store, notes):
    while True:
        id, _ = store.save(scene, prediction)
        os.write(notes, (id + chr(10)).encode())  # in one piece, whatever other threads write
        store.recording(id)

print("ready", flush=True)
for name in sys.stdin:
    child = os.fork()
    if not child:
        notes = os.open(name.strip(), os.O_WRONLY | os.O_CREAT | os.O_APPEND)
        store = RunStore(Settings(data_dir=Path(sys.argv[1]), max_runs=int(sys.argv[3])))
        for _ in range(4):
            threading.Thread(target=write, args=(store, notes)).start()
        threading.Event().wait()
    print(child, flush=True)
    os.waitpid(child, 0)
    print("gone", flush=True)
"""


@contextmanager
def service(data: Path) -> Iterator[tuple[str, "subprocess.Popen[bytes]"]]:
    """Run a service on a free port of this machine; give its address and process."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [sys.executable, "-m", "uvicorn", "--factory", "app.main:create_app", "--port", str(port)]
    environment = {**os.environ, "DLO_DATA_DIR": str(data)}
    process = subprocess.Popen(command, cwd=ROOT, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        address = f"http://127.0.0.1:{port}"
        give_up = time.monotonic() + 540
        while not ready(address):
            assert process.poll() is None
            assert time.monotonic() < give_up, "the service did not get ready"
            time.sleep(0.1)
        yield address, process
    finally:
        process.kill()
        process.wait()


def ready(address: str) -> bool:
    try:
        return httpx.get(f"{address}/ready").status_code == 200
    except httpx.TransportError:
        return False


def leftovers(data: Path) -> list[str]:
    return sorted(path.name for path in (data / "runs").glob(".*"))


def being_written(data: Path) -> bool:
    return any(not (path / SUMMARY).is_file() for path in (data / "runs").iterdir())


def check_recording(content: bytes, directory: Path, id: str) -> None:
    path = directory / "check.rrd"
    path.write_bytes(content)
    reader = rr.chunk.RrdReader(path)
    (store,) = reader.recordings()
    assert store.recording_id == id
    assert {"/motion/cable", "/report"} <= {chunk.entity_path for chunk in reader.stream(store=store).to_chunks()}


def check_store(store: RunStore, directory: Path) -> list[str]:
    """Check that every listed run is whole; return their ids, oldest first."""
    ids = sorted(summary["id"] for summary in store.page(10_000, 0)[0])
    for id in ids:
        run = store.load(id)
        assert run is not None
        assert run.document["id"] == id
        assert np.isfinite(run.surface.control_points).all()
        check_recording(store.recording(id) or b"", directory, id)
    return ids


@pytest.mark.slow
def test_a_service_killed_while_runs_are_written_restarts_with_whole_runs(tmp_path: Path) -> None:
    data = tmp_path / "data"
    answered: list[str] = []
    enough = threading.Event()

    def post(address: str) -> None:
        try:
            with httpx.Client(base_url=address, timeout=60) as client:
                links = client.post("/v1/predictions", json=paper_scene()).raise_for_status().json()["links"]
                answered.append(links["self"])
                if len(answered) >= RUNS // 2:
                    enough.set()
                client.get(links["recording"])
        except httpx.HTTPError:  # the service is gone
            enough.set()

    with service(data) as (address, process), ThreadPoolExecutor(WRITERS) as clients:
        for _ in range(RUNS):
            clients.submit(post, address)
        assert enough.wait(120)
        process.send_signal(signal.SIGKILL)
        process.wait()

    with service(data) as (address, _), httpx.Client(base_url=address, timeout=60) as client:
        assert leftovers(data) == []
        page = client.get("/v1/predictions?limit=1000").json()
        listed = {run["links"]["self"]: run for run in page["predictions"]}
        assert len(listed) == page["total"] >= RUNS // 2
        assert set(answered) <= set(listed)  # what was answered is kept
        for link, run in listed.items():
            check_answer(client, link, run, tmp_path)


def check_answer(client: httpx.Client, link: str, run: dict[str, Any], directory: Path) -> None:
    document = client.get(link).raise_for_status().json()
    assert document["id"] == run["id"]
    assert document["status"] == run["status"] == "converged"
    npz = client.get(document["links"]["surface"]).raise_for_status().content
    with np.load(io.BytesIO(npz)) as arrays:
        np.testing.assert_array_equal(arrays["positions"], document["surface"]["positions"])
    assert client.get(document["links"]["scene"]).json() == paper_scene()
    check_recording(client.get(document["links"]["recording"]).raise_for_status().content, directory, run["id"])


@contextmanager
def writer(data: Path) -> Iterator["subprocess.Popen[str]"]:
    """Run WRITER; kill it and the process that it may have begun, whatever happens."""
    command = [sys.executable, "-c", WRITER, str(data), json.dumps(paper_scene()), str(CAP)]
    pipes = {"stdin": subprocess.PIPE, "stdout": subprocess.PIPE}
    with subprocess.Popen(command, cwd=ROOT, text=True, start_new_session=True, **pipes) as process:
        try:
            assert line_of(process) == "ready"
            yield process
        finally:
            os.killpg(process.pid, signal.SIGKILL)


def line_of(process: "subprocess.Popen[str]") -> str:
    assert process.stdout is not None
    return process.stdout.readline().strip()


def killed(process: "subprocess.Popen[str]", data: Path, notes: Path, after: float, in_sight: bool) -> list[str]:
    """Have runs written, kill what writes them, and return the ids of those that it kept.

    Args:
        process: a `writer` to the store.
        data: directory of the store.
        notes: file for the ids.
        after: from the first that is kept to the kill [s], ...
        in_sight: ... or sooner, as soon as something half-written is in sight.
    """
    print(notes, file=process.stdin, flush=True)
    child = int(line_of(process))
    while not (notes.exists() and "\n" in notes.read_text()):  # so that one is kept, however busy the machine is
        time.sleep(0.01)
    end = time.monotonic() + after
    while time.monotonic() < end and not (in_sight and being_written(data)):
        time.sleep(0.0 if in_sight else 0.01)
    os.kill(child, signal.SIGKILL)
    assert line_of(process) == "gone"
    return [id for id in notes.read_text().split() if len(id) == 28]  # the last may have been cut


@pytest.mark.slow
def test_a_store_killed_at_any_moment_has_whole_runs_only(tmp_path: Path) -> None:
    data, moments = tmp_path / "data", random.Random(5)
    interrupted = kills = 0
    with writer(data) as process:
        while kills < KILLS or (interrupted == 0 and kills < MOST_KILLS):
            kills += 1
            in_sight = kills % 2 == 0  # a kill at any moment seldom comes while a run is being written
            kept = killed(process, data, tmp_path / f"kept-{kills}", moments.uniform(0.0, 0.6), in_sight)
            interrupted += bool(leftovers(data))
            ids = check_store(RunStore(Settings(data_dir=data, max_runs=CAP)), tmp_path)
            assert leftovers(data) == []
            assert sorted(path.name for path in (data / "runs").iterdir()) == ids  # nor half-written by its id
            assert len(ids) <= CAP  # the cap holds through all the kills
            newest = sorted(kept)[-CAP // 3 :]  # well inside the cap: four threads may finish out of order
            assert newest
            assert set(newest) <= set(ids)
    assert interrupted > 0  # else no kill came while a run was being written, and nothing was tested


def half_written(data: Path) -> None:
    runs = data / "runs"
    for name in (".new-0", ".old-1"):
        (runs / name).mkdir(parents=True)
        (runs / name / "prediction.json").write_bytes(b"{")
    (runs / ".rrd-2").write_bytes(b"RRF2")
    (data / ".viewer-3").mkdir()


def test_what_is_half_written_goes_at_the_next_start(tmp_path: Path) -> None:
    half_written(tmp_path)
    RunStore(Settings(data_dir=tmp_path))
    assert leftovers(tmp_path) == []
    assert not (tmp_path / ".viewer-3").exists()


def test_what_another_process_is_writing_stays(tmp_path: Path) -> None:
    first = RunStore(Settings(data_dir=tmp_path))
    half_written(tmp_path)
    RunStore(Settings(data_dir=tmp_path))
    assert leftovers(tmp_path) == [".new-0", ".old-1", ".rrd-2"]
    assert (tmp_path / ".viewer-3").exists()
    del first  # gives its claim up, as the end of a process does
    RunStore(Settings(data_dir=tmp_path))
    assert leftovers(tmp_path) == []


@pytest.mark.parametrize("cap", ["number", "bytes"])
def test_the_oldest_go_first_across_restarts(tmp_path: Path, cap: str) -> None:
    prediction = predict(to_scene(PredictionRequest.model_validate(paper_scene()), lambda id: None))
    data, size = tmp_path / "data", len(pack(prediction))
    limits = {"max_runs": 6} if cap == "number" else {"max_run_bytes": 1_000_000}
    ids: list[str] = []
    for _ in range(3):
        store = RunStore(Settings(data_dir=data, **limits))
        before = sorted(summary["id"] for summary in store.page(10_000, 0)[0])
        assert before == ids[len(ids) - len(before) :]  # what the last process kept
        for _ in range(8 if cap == "number" else 1_000_000 // size):
            ids.append(store.save(paper_scene(), prediction)[0])
            time.sleep(0.002)  # ids sort by the millisecond
        kept = sorted(summary["id"] for summary in store.page(10_000, 0)[0])
        assert kept == ids[len(ids) - len(kept) :]
        assert 0 < len(kept) < len(ids)
        on_disk = {path.name: sum(file.stat().st_size for file in path.iterdir()) for path in (data / "runs").iterdir()}
        assert sorted(on_disk) == kept
        assert len(kept) == 6 if cap == "number" else sum(on_disk.values()) <= 1_000_000
