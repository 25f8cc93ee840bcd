"""One recording, whichever way it is asked for: of the service, of a stored run, of the command line, of the solve."""

import json
import math
import threading
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

from app.archive import Run
from app.cli import main
from app.recording import write_recording
from app.schemas import PredictionRequest, from_prediction, to_scene
from app.settings import Settings
from app.store.runs import RunStore
from dlocore import Prediction, energies, predict
from tests.app.conftest import paper_scene
from tests.app.test_recording import properties, rows

rr = pytest.importorskip("rerun")

# What tells one solve of a scene from the next, and a stored run from one that is not.
OF_ITS_OWN = {"/report", "/log", "/__properties"}


def content(path: Path, *, clock: bool = True) -> dict[str, Any]:
    """Return every column of a recording by entity and name, without the ids of its rows.

    Args:
        path: of the recording.
        clock: whether with what two solves of one scene do not share.
    """
    columns: dict[str, Any] = {}
    for chunk in rr.chunk.RrdReader(path).stream().to_chunks():
        if not clock and chunk.entity_path in OF_ITS_OWN:
            continue
        batch = chunk.to_record_batch()
        for name, values in zip(batch.schema.names, batch.columns, strict=True):
            if name != "rerun.controls.RowId" and (clock or name != "solver_time"):
                key = f"{chunk.entity_path} {name} {'static' if chunk.is_static else ''}"
                columns[key] = (
                    [*columns.get(key, []), *values.cast("int64").to_pylist()]
                    if (name in ("iteration", "solver_time", "motion"))
                    else [*columns.get(key, []), *values.to_pylist()]
                )
    return columns


def solved(scene: dict[str, Any], kept: RunStore) -> Prediction:
    return predict(to_scene(PredictionRequest.model_validate(scene), kept.motion))


def test_a_stored_run_gives_the_recording_of_the_solve_itself(tmp_path: Path) -> None:
    scene = paper_scene(quality={"n_u": 9, "n_t": 13, "delta": 1e-5})
    kept = RunStore(Settings(data_dir=tmp_path))
    prediction = solved(scene, kept)
    id, _ = kept.save(scene, prediction)
    stored, fresh = tmp_path / "stored.rrd", tmp_path / "fresh.rrd"
    stored.write_bytes(kept.recording(id) or b"")
    document = json.loads(kept.document(id) or b"")
    again = from_prediction(prediction, id, 101, 33)
    write_recording(Run.of(scene, {**again, "created": document["created"]}, prediction), fresh)
    assert content(stored) == content(fresh)


def test_the_command_line_gives_the_recording_of_the_service(
    tmp_path: Path, client: TestClient, answer: dict[str, Any]
) -> None:
    scene, served, written = (tmp_path / name for name in ("scene.json", "served.rrd", "written.rrd"))
    scene.write_bytes(client.get(answer["links"]["scene"]).content)
    served.write_bytes(client.get(answer["links"]["recording"]).content)
    assert main(["predict", str(scene), "--rrd", str(written)]) == 0
    shared = content(served, clock=False)
    assert len(shared) > 50
    assert content(written, clock=False) == shared


def test_recordings_of_the_command_line_are_told_apart(tmp_path: Path) -> None:
    """They are of one name, and no part of each other."""
    scene = tmp_path / "scene.json"
    scene.write_text(json.dumps(paper_scene()))
    ids = set()
    for folder in ("before", "after"):
        (tmp_path / folder).mkdir()
        path = tmp_path / folder / "out.rrd"
        assert main(["predict", str(scene), "--rrd", str(path)]) == 0
        assert [file.name for file in path.parent.iterdir()] == ["out.rrd"]
        reader = rr.chunk.RrdReader(path)
        (recording,), (shown,) = reader.recordings(), reader.blueprints()
        assert recording.application_id == shown.application_id == "dlo"
        assert properties(reader.stream().to_chunks())["name"] == "out"
        ids.add(recording.recording_id)
    assert len(ids) == 2


def test_a_run_that_continues_another_keeps_its_recording_without_it(tmp_path: Path) -> None:
    kept = RunStore(Settings(data_dir=tmp_path))
    first, _ = kept.save(paper_scene(), solved(paper_scene(), kept))
    scene = paper_scene(shape={"kind": "prediction", "id": first, "t": 0.8})
    prediction = solved(scene, kept)
    second, _ = kept.save(scene, prediction)
    assert kept.delete(first)
    run = kept.load(second)
    assert run is not None
    times = np.linspace(0.0, run.surface.horizon, 5)
    for name, expected in prediction.energies(times).items():
        found = energies(run.scene, run.surface, times, run.material, run.stretch)[name]
        np.testing.assert_array_equal(found, expected)
    assert kept.recording(second)


@pytest.mark.parametrize("lost", [math.nan, math.inf, 1e9])
def test_an_iterate_that_grew_beyond_all_bounds_is_not_drawn(tmp_path: Path, lost: float) -> None:
    kept = RunStore(Settings(data_dir=tmp_path))
    prediction = solved(paper_scene(), kept)
    first, *others = prediction.iterations
    surface = replace(first.surface, control_points=np.full_like(first.surface.control_points, lost))
    broken = replace(first, find_surface=lambda: surface, residual=lost, find_energy=lambda: lost)
    path = tmp_path / "run.rrd"
    id, _ = kept.save(paper_scene(), replace(prediction, iterations=(broken, *others)))
    path.write_bytes(kept.recording(id) or b"")
    chunks = list(rr.chunk.RrdReader(path).stream().to_chunks())
    for entity, component in (("/iterate/shape", "strips"), ("/forces/bend", "scalars"), ("/energy/bend", "scalars")):
        assert rows(chunks, entity, component, "iteration")[0] == [i.number for i in others]
    assert rows(chunks, "/log", "text", "iteration")[0] == [i.number for i in prediction.iterations]


def test_writing_recordings_leaves_no_threads(tmp_path: Path) -> None:
    kept = RunStore(Settings(data_dir=tmp_path))
    run = kept.load(kept.save(paper_scene(), solved(paper_scene(), kept))[0])
    assert run is not None
    write_recording(run, tmp_path / "0.rrd")
    before = native_threads()
    for k in range(1, 21):
        write_recording(run, tmp_path / f"{k}.rrd")
    assert native_threads() <= before


def native_threads() -> int:
    tasks = Path("/proc/self/task")  # those of compiled code too
    return len(list(tasks.iterdir())) if tasks.is_dir() else threading.active_count()
