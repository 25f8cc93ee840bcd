"""The command line: exit codes, and one clear message that names the field."""

import io
import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.cli import main
from tests.app.conftest import paper_scene, put


class _Stdin:
    def __init__(self, content: bytes) -> None:
        self.buffer = io.BytesIO(content)


def written(tmp_path: Path, scene: Any) -> str:
    path = tmp_path / "scene.json"
    path.write_text(json.dumps(scene))
    return str(path)


def test_a_converged_scene_exits_with_0_and_a_summary(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["predict", written(tmp_path, paper_scene()), "-o", str(tmp_path / "out.npz")]) == 0
    output = capsys.readouterr()
    assert output.out == ""
    assert output.err.startswith("converged: ")
    for word in ("march", " mm", " ms", "inertia, drag, stretch, bend"):
        assert word in output.err
    with np.load(tmp_path / "out.npz") as npz:
        assert npz["positions"].shape == (33, 101, 3)


def test_another_method_takes_the_place_of_that_of_the_scene(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["predict", written(tmp_path, paper_scene()), "--method", "reference"]) == 0
    assert "method   reference" in capsys.readouterr().err


def test_a_scene_is_read_from_standard_input(
    monkeypatch: pytest.MonkeyPatch, capsysbinary: pytest.CaptureFixture[bytes]
) -> None:
    monkeypatch.setattr("sys.stdin", _Stdin(json.dumps(paper_scene()).encode()))
    assert main(["predict", "-", "--json", "-"]) == 0
    assert json.loads(capsysbinary.readouterr().out)["status"] == "converged"


@pytest.mark.parametrize(
    ("path", "value", "field"),
    [
        ("cable.length", -1, "cable.length"),
        ("primitives.0.u", 3.0, "primitives[0].u"),
        ("environment.drag", float("nan"), "environment.drag"),
        ("cable.memory_rate", 50.0, "cable.yield_strain"),
        ("shape.kind", "circle", "shape.kind"),
        ("shape", {"kind": "prediction", "id": "0" * 28}, "shape.id"),
    ],
)
def test_bad_input_exits_with_2_and_names_the_field(
    path: str,
    value: Any,
    field: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("DLO_DATA_DIR", str(tmp_path / "data"))
    scene = paper_scene()
    scene = {**scene, path: value} if "." not in path else put(scene, path, 0)
    if "." in path:
        scene = put(scene, path, None)
        node: Any = scene
        *parents, last = path.split(".")
        for key in parents:
            node = node[int(key) if key.isdigit() else key]
        node[last] = value
    assert main(["predict", written(tmp_path, scene), "-o", str(tmp_path / "out.npz")]) == 2
    message = capsys.readouterr().err
    assert message.startswith(f"dlo: {field}: ")
    assert len(message.splitlines()) == 1
    assert "Allowed: " in message
    assert not (tmp_path / "out.npz").exists()


@pytest.mark.parametrize("content", ["", "{", "[" * 100_000, "nonsense"])
def test_what_is_not_json_exits_with_2(content: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "scene.json").write_text(content)
    assert main(["predict", str(tmp_path / "scene.json")]) == 2
    assert "not JSON" in capsys.readouterr().err


def test_a_missing_file_exits_with_2(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["predict", str(tmp_path / "none.json")]) == 2
    assert "none.json" in capsys.readouterr().err


def test_not_converging_exits_with_3_and_still_writes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = paper_scene(quality={"n_u": 7, "n_t": 9, "method": "paper"})  # the printed scheme does not converge on it
    outputs = [tmp_path / name for name in ("out.npz", "out.json", "out.rrd", "out.rbl")]
    arguments = ["-o", str(outputs[0]), "--json", str(outputs[1]), "--rrd", str(outputs[2])]
    assert main(["predict", written(tmp_path, scene), *arguments]) == 3
    message = capsys.readouterr().err
    assert message.startswith("max_iterations: ")
    assert "take method march" in message  # the remedy
    assert all(output.stat().st_size > 1000 for output in outputs)


def test_a_least_squares_that_does_not_converge_is_answered_by_a_march(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = {"kind": "move", "displacement": [0.07, 0, 0], "duration": 0.3, "profile": "linear"}
    scene = {
        "cable": {"length": 0.6, "diameter": 0.005, "linear_density": 0.08, "bending_stiffness": 3e-5},
        "shape": {"kind": "straight", "direction": [0, 0, -1]},
        "primitives": [{"u": 0.0, "hold": "tangent", "path": path}],
        "environment": {"drag": 0.013},
        "horizon": 1.6,
        "quality": {"n_u": 17, "n_t": 41, "delta": 1e-9, "method": "spacetime"},
    }
    document = tmp_path / "out.json"
    assert main(["predict", written(tmp_path, scene), "--json", str(document)]) == 0
    message = capsys.readouterr().err
    assert message.startswith("converged: ")
    assert "method   march, 17 x 41" in message
    assert (
        "A march is the answer in place of the least squares that was asked for, which did not converge in" in message
    )
    answer = json.loads(document.read_text())
    assert (answer["status"], answer["accuracy"]["method"]) == ("converged", "march")
    assert answer["accuracy"]["error_estimate"] > 0
    assert len(answer["iterations"]) > 40


def test_an_output_that_cannot_be_written_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    missing = tmp_path / "none" / "out.npz"
    assert main(["predict", written(tmp_path, paper_scene()), "-o", str(missing)]) == 1
    assert "out.npz" in capsys.readouterr().err


def test_a_recording_of_the_command_line_is_that_of_the_solve(tmp_path: Path) -> None:
    rr = pytest.importorskip("rerun")
    rrd, full = tmp_path / "out.rrd", tmp_path / "out.json"
    assert main(["predict", written(tmp_path, paper_scene()), "--rrd", str(rrd), "--json", str(full)]) == 0
    reader = rr.chunk.RrdReader(rrd)
    entities = {chunk.entity_path for chunk in reader.stream().to_chunks()}
    assert {"/iterate/shape", "/iterate/net", "/motion/cable", "/convergence/residual", "/report"} <= entities
    assert rr.chunk.RrdReader(tmp_path / "out.rbl").blueprints()


def test_a_bad_setting_is_named(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.setenv("DLO_PORT", "here")
    assert main(["serve"]) == 2
    assert "DLO_PORT" in capsys.readouterr().err


def test_help_reads_well(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as done:
        main(["--help"])
    assert done.value.code == 0
    text = capsys.readouterr().out
    for word in ("serve", "predict", "warmup", "examples:", "DLO_PORT"):
        assert word in text
    assert max(map(len, text.splitlines())) <= 100


def test_an_unknown_command_exits_with_2() -> None:
    with pytest.raises(SystemExit) as done:
        main(["conquer"])
    assert done.value.code == 2
