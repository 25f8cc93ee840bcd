"""Stored runs: whole or not at all, found again, listed newest first, the oldest evicted first."""

import time
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import numpy as np
import orjson
import pytest
from fastapi.testclient import TestClient

from app.commands.commands import read_scene
from app.main import create_app
from app.schemas import PredictionRequest, to_scene
from app.schemas.ids import new_id
from app.settings import Settings
from app.store import runs
from app.store.runs import RunStore
from dlocore import ControlPoints, MaterialMotion, Prediction, predict
from tests.app.conftest import paper_scene, start
from tests.app.test_bad_requests import the_problem


@pytest.fixture(scope="module")
def prediction() -> Prediction:
    return predict(to_scene(PredictionRequest.model_validate(paper_scene()), lambda id: None))


def store(directory: Path, **limits: Any) -> RunStore:
    return RunStore(Settings(data_dir=directory, **limits))


def listed(found: RunStore) -> list[str]:
    return [summary["id"] for summary in found.page(1000, 0)[0]]


def fill(directory: Path, prediction: Prediction, count: int, **limits: Any) -> tuple[RunStore, list[str]]:
    target = store(directory, **limits)
    ids = []
    for _ in range(count):
        ids.append(target.save(paper_scene(), prediction)[0])
        time.sleep(0.002)  # ids sort by the millisecond
    return target, ids


def test_a_restart_finds_the_runs(tmp_path: Path) -> None:
    settings = Settings(data_dir=tmp_path)
    with TestClient(create_app(settings)) as first:
        document = start(first).post("/v1/predictions", json=paper_scene()).json()
        recording = first.get(document["links"]["recording"]).content
    with TestClient(create_app(settings)) as second:
        again = second.get(document["links"]["self"])
        assert again.json() == document
        assert second.get(document["links"]["recording"]).content == recording
        assert second.get(document["links"]["scene"]).json() == paper_scene()
        (summary,) = second.get("/v1/predictions").json()["predictions"]
        assert summary["id"] == document["id"]
        assert summary["status"] == document["status"]


def test_what_is_loaded_is_what_was_saved(tmp_path: Path, prediction: Prediction) -> None:
    target, (id,) = fill(tmp_path, prediction, 1)
    run = target.load(id)
    assert run is not None
    assert (run.surface.control_points == prediction.surface.control_points).all()
    assert run.request == paper_scene()
    assert len(run.iterations) == len(prediction.iterations)
    for read, kept in zip(run.iterations, prediction.iterations, strict=True):
        assert (read.surface.control_points == kept.surface.control_points).all()
        told = ["energy", *(f.name for f in fields(kept) if f.name not in ("find_surface", "find_energy"))]
        assert [getattr(read, name) for name in told] == [getattr(kept, name) for name in told]


def remembering(prediction: Prediction) -> Prediction:
    """Return a prediction whose cable remembers something, where it does not."""
    random = np.random.default_rng(1)
    times, u = np.linspace(0.0, prediction.surface.horizon, 7), np.linspace(0.0, prediction.surface.length, 9)
    material = MaterialMotion(
        times=times,
        director=np.tile([0.0, 0.0, 1.0], (7, 1)),
        u=u,
        memory=random.normal(size=(7, 9, 3)),
        stretch=random.normal(size=(7, 9)),
        natural=random.normal(size=(9, 3)),
    )
    return replace(prediction, report_material=lambda: material)


def assert_same_fields(one: Any, other: Any) -> None:
    assert vars(one).keys() == vars(other).keys()
    for name, value in vars(one).items():
        np.testing.assert_array_equal(value, vars(other)[name], err_msg=name)


def test_what_the_cable_remembers_is_stored_and_goes_on(tmp_path: Path, prediction: Prediction) -> None:
    prediction = remembering(prediction)
    target, (id,) = fill(tmp_path, prediction, 1)
    run = target.load(id)
    assert run is not None
    assert_same_fields(run.material, prediction.material)
    request = paper_scene(shape={"kind": "prediction", "id": id, "t": 0.7})
    follow = to_scene(PredictionRequest.model_validate(request), target.motion)
    expected = prediction.shape_at(0.7)
    assert isinstance(follow.shape, ControlPoints)
    assert_same_fields(follow.shape.material, expected.material)
    np.testing.assert_array_equal(follow.shape.control_points, expected.control_points)
    np.testing.assert_array_equal(follow.shape.velocity, expected.velocity)
    np.testing.assert_array_equal(follow.shape.strain, expected.strain)


def test_a_run_that_went_on_knows_its_scene_without_the_one_before(tmp_path: Path, prediction: Prediction) -> None:
    target, (first,) = fill(tmp_path, remembering(prediction), 1)
    request = paper_scene(shape={"kind": "prediction", "id": first, "t": 0.7, "settle": True})
    scene = to_scene(PredictionRequest.model_validate(request), target.motion)
    second, _ = target.save(request, replace(prediction, scene=scene))
    assert target.delete(first)
    run = target.load(second)
    assert run is not None
    assert isinstance(run.scene.shape, ControlPoints)
    assert run.scene.shape.settle
    assert_same_fields(run.scene.shape.material, scene.shape.material)
    np.testing.assert_array_equal(run.scene.shape.control_points, scene.shape.control_points)
    np.testing.assert_array_equal(run.scene.shape.strain, scene.shape.strain)


def test_a_run_that_was_stored_without_its_memory_still_loads(tmp_path: Path, prediction: Prediction) -> None:
    target, (id,) = fill(tmp_path, prediction, 1)  # an elastic, straight cable remembers nothing
    nets = tmp_path / "runs" / id / runs.NETS
    with np.load(nets) as arrays:
        assert not [name for name in arrays.files if name.startswith(("material_", "remembered_"))]
    run, motion = target.load(id), target.motion(id)
    assert run is not None
    assert motion is not None
    assert run.material is None
    assert motion.material is None


def test_a_run_that_was_stored_without_its_stretch_goes_on_without(tmp_path: Path, prediction: Prediction) -> None:
    target, (id,) = fill(tmp_path, prediction, 1)
    nets = tmp_path / "runs" / id / runs.NETS
    with np.load(nets) as arrays:
        kept = {name: arrays[name] for name in arrays.files if not name.startswith("stretch_")}
        assert len(kept) == len(arrays.files) - 3
    np.savez(nets, **kept)
    motion = target.motion(id)
    assert motion is not None
    assert motion.stretch is None
    request = paper_scene(shape={"kind": "prediction", "id": id, "t": 0.7})
    shape = to_scene(PredictionRequest.model_validate(request), target.motion).shape
    assert isinstance(shape, ControlPoints)
    assert shape.strain is None


def test_runs_are_listed_newest_first_in_pages(tmp_path: Path, prediction: Prediction) -> None:
    target, ids = fill(tmp_path, prediction, 5)
    assert listed(target) == ids[::-1]
    page, total = target.page(2, 1)
    assert [summary["id"] for summary in page] == [ids[3], ids[2]]
    assert total == 5


def test_the_pages_of_the_service_lead_on(client: TestClient, answer: dict[str, Any]) -> None:
    client.post("/v1/predictions", json=paper_scene())
    address, seen = "/v1/predictions?limit=2", []
    while address:
        page = client.get(address).json()
        assert len(page["predictions"]) <= 2
        seen += [summary["id"] for summary in page["predictions"]]
        address = page["next"]
    assert len(seen) == page["total"]
    assert seen == sorted(set(seen), reverse=True)
    assert answer["id"] in seen


def test_the_oldest_go_first_when_there_are_too_many(tmp_path: Path, prediction: Prediction) -> None:
    target, ids = fill(tmp_path, prediction, 6, max_runs=4)
    assert listed(target) == ids[:1:-1]
    assert target.document(ids[0]) is None
    assert sorted(path.name for path in (tmp_path / "runs").iterdir()) == ids[2:]


def test_the_oldest_go_first_when_they_are_too_large(tmp_path: Path, prediction: Prediction) -> None:
    target, (id,) = fill(tmp_path / "one", prediction, 1)
    size = sum(file.stat().st_size for file in (tmp_path / "one" / "runs" / id).iterdir())
    keep = 1_000_000 // size + 1
    target, ids = fill(tmp_path / "many", prediction, keep + 3, max_run_bytes=1_000_000)
    kept = listed(target)
    assert kept == ids[::-1][: len(kept)]
    assert 1_000_000 // size - 1 <= len(kept) <= 1_000_000 // size + 1


def test_recordings_count_as_bytes(tmp_path: Path, prediction: Prediction) -> None:
    pytest.importorskip("rerun")
    target, (id,) = fill(tmp_path, prediction, 1)
    assert target.recording(id)
    on_disk = sum(file.stat().st_size for file in (tmp_path / "runs" / id).iterdir())
    assert target._entries[id].size == on_disk
    assert store(tmp_path)._entries[id].size == on_disk


def test_recordings_go_before_runs_do(tmp_path: Path, prediction: Prediction, monkeypatch: pytest.MonkeyPatch) -> None:
    large = 2_000_000  # bytes of a recording
    monkeypatch.setattr(runs, "write_recording", lambda run, path: path.write_bytes(bytes(large)))
    one, _ = fill(tmp_path / "one", prediction, 1)
    size = one.size[1]  # of a run
    data = tmp_path / "many"
    target, ids = fill(data, prediction, 3, max_run_bytes=large + 3 * size + size // 2)

    def recorded() -> list[str]:
        return [path.parent.name for path in (data / "runs").glob(f"*/{runs.RECORDING}")]

    assert len(target.recording(ids[0]) or b"") == large
    assert recorded() == [ids[0]]
    assert len(target.recording(ids[1]) or b"") == large
    assert recorded() == [ids[1]]  # the older one makes room
    assert len(target.recording(ids[0]) or b"") == large  # it is written again, though not kept
    assert listed(target) == ids[::-1]
    assert target.size == store(data).size == (3, sum(file.stat().st_size for file in (data / "runs").glob("*/*")))
    target.save(paper_scene(), prediction)
    assert recorded() == []
    assert len(listed(target)) == 4


def test_a_lower_cap_evicts_at_the_next_start(tmp_path: Path, prediction: Prediction) -> None:
    _, ids = fill(tmp_path, prediction, 4)
    assert listed(store(tmp_path, max_runs=2)) == ids[:1:-1]


def test_a_command_that_goes_on_from_a_run_leaves_the_others_of_a_service_with_higher_caps(
    tmp_path: Path, prediction: Prediction, monkeypatch: pytest.MonkeyPatch
) -> None:
    _, ids = fill(tmp_path, prediction, 3)
    monkeypatch.setenv("DLO_DATA_DIR", str(tmp_path))
    monkeypatch.setenv("DLO_MAX_RUNS", "1")
    shape = {"kind": "prediction", "id": ids[0]}
    (tmp_path / "scene.json").write_bytes(orjson.dumps({**paper_scene(), "shape": shape}))
    read_scene(str(tmp_path / "scene.json"))
    assert sorted(path.name for path in (tmp_path / "runs").iterdir()) == ids


def test_a_second_process_on_a_data_directory_is_told_of_the_first(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    first = store(tmp_path)
    assert caplog.messages == []
    second = store(tmp_path)
    assert caplog.messages == [
        f"another process uses {tmp_path}: each answers 404 for runs that the other stores from now on"
    ]
    del first, second
    caplog.clear()
    store(tmp_path)
    assert caplog.messages == []


def test_an_unfinished_run_is_never_listed(
    tmp_path: Path, prediction: Prediction, monkeypatch: pytest.MonkeyPatch
) -> None:
    target, ids = fill(tmp_path, prediction, 1)

    def crash(directory: Path) -> None:
        raise KeyboardInterrupt  # as if killed between writing and renaming

    with monkeypatch.context() as patch:
        patch.setattr(runs, "_sync", crash)
        with pytest.raises(KeyboardInterrupt):
            target.save(paper_scene(), prediction)
    leftover = tmp_path / "runs" / ".new-1"
    leftover.mkdir()
    (leftover / runs.DOCUMENT).write_bytes(b"{")
    (tmp_path / "runs" / ("0" * 28)).mkdir()  # without its summary: not one of ours
    assert listed(target) == ids
    assert listed(store(tmp_path)) == ids


def test_a_removed_run_is_gone(client: TestClient) -> None:
    document = client.post("/v1/predictions", json=paper_scene()).json()
    assert client.delete(document["links"]["self"]).status_code == 204
    for link in ("self", "recording", "surface", "scene", "viewer"):
        assert client.get(document["links"][link], follow_redirects=False).status_code == 404
    assert client.delete(document["links"]["self"]).status_code == 404


def test_a_run_whose_answer_was_emptied_is_not_found(client: TestClient) -> None:
    document = client.post("/v1/predictions", json=paper_scene()).json()
    settings: Settings = client.app.state.settings  # type: ignore[attr-defined]
    (settings.data_dir / "runs" / document["id"] / runs.DOCUMENT).write_bytes(b"")
    for link in ("self", "surface", "recording", "viewer", "events"):
        the_problem(client.get(document["links"][link], follow_redirects=False), 404)
    assert client.delete(document["links"]["self"]).status_code == 204


def test_a_run_whose_summary_is_damaged_is_not_listed(tmp_path: Path, prediction: Prediction) -> None:
    _, ids = fill(tmp_path, prediction, 2)
    (tmp_path / "runs" / ids[0] / runs.SUMMARY).write_bytes(b"")
    assert listed(store(tmp_path)) == ids[1:]


def test_ids_differ_and_sort_by_time() -> None:
    ids = [new_id() for _ in range(1000)]
    assert len(set(ids)) == 1000
    assert [id[:12] for id in ids] == sorted(id[:12] for id in ids)


def test_a_run_may_be_saved_as_data_or_as_sent(tmp_path: Path, prediction: Prediction) -> None:
    target = store(tmp_path)
    (data, _), (sent, _) = (target.save(given, prediction) for given in (paper_scene(), orjson.dumps(paper_scene())))
    assert target.request(data) == target.request(sent)


def test_a_run_that_is_removed_as_soon_as_it_is_stored_is_answered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with TestClient(create_app(Settings(data_dir=tmp_path))) as client:
        start(client)
        monkeypatch.setattr(client.app.state.service.runs, "_max_runs", 0)  # as if others had been stored meanwhile
        for accept, status in (("application/json", 201), ("application/x-npz", 201), ("text/event-stream", 200)):
            response = client.post("/v1/predictions", json=paper_scene(), headers={"accept": accept})
            assert response.status_code == status
            assert response.content
            assert b"event: error" not in response.content
        for fields in (["grasps"], ["surface"]):
            batch = {"scenes": [paper_scene()], "store": True, "fields": fields}
            line = orjson.loads(client.post("/v1/predictions:batch", json=batch).content)
            assert line["status"] == "converged"
            assert ("grasps" in line["result"]) is (fields == ["grasps"])
        assert client.get("/v1/predictions").json()["total"] == 0
