"""The command line: exit codes, and one clear message that names the field."""

import io
import json
import os
import re
import socket
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import dlocore
from app.cli import main
from app.commands.files import write_output
from dlocore import Prediction, Scene, calibration, predict
from dlocore.files import whole
from dlocore.identify.datasets import FIT
from dlocore.identify.parameters import DEFAULT
from tests.app.conftest import paper_scene, put

ROOT = Path(__file__).parents[2]


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
    assert main(["predict", ""]) == 2
    assert "an input needs a name" in capsys.readouterr().err


def test_an_unknown_error_is_not_said_to_be_an_estimate(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    quality = {"n_u": 7, "n_t": 9, "method": "paper"}  # which does not converge
    assert main(["predict", written(tmp_path, paper_scene(quality=quality))]) == 3
    assert "\nerror    unknown\n" in capsys.readouterr().err


def test_not_converging_exits_with_3_and_still_writes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene = paper_scene(quality={"n_u": 7, "n_t": 9, "method": "paper"})  # the printed scheme does not converge on it
    outputs = [tmp_path / name for name in ("out.npz", "out.json", "out.rrd")]
    arguments = ["-o", str(outputs[0]), "--json", str(outputs[1]), "--rrd", str(outputs[2])]
    assert main(["predict", written(tmp_path, scene), *arguments]) == 3
    message = capsys.readouterr().err
    assert message.startswith("max_iterations: ")
    assert "use method march" in message  # the remedy
    assert all(output.stat().st_size > 1000 for output in outputs)


@pytest.mark.parametrize("quality", [{"time_budget": 5.0}, "auto"])
def test_a_time_budget_goes_by_what_solves_were_measured_to_cost(
    quality: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    costs: list[Any] = []

    def solve(scene: Scene, *, cost: Any, **_: object) -> Prediction:
        costs.append(cost)
        return predict(scene)

    monkeypatch.setenv("DLO_DATA_DIR", str(tmp_path))
    monkeypatch.setattr(dlocore, "predict", solve)
    monkeypatch.setattr(calibration, "stored_cost", lambda path: f"that of {path.name}")
    assert main(["predict", written(tmp_path, paper_scene(quality=quality))]) == 0
    assert costs == ["that of calibration.json" if isinstance(quality, dict) else None]


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
    assert "A march gives the answer instead of the requested least squares, which did not converge in" in message
    answer = json.loads(document.read_text())
    assert (answer["status"], answer["accuracy"]["method"]) == ("converged", "march")
    assert answer["accuracy"]["error_estimate"] > 0
    assert len(answer["iterations"]) > 40


COMMANDS = {
    "predict": ("-o", "--json", "--rrd"),
    "study": ("-o", "--plots"),
    "identify": ("-o", "--report"),
    "validate": ("--json", "--plots"),
    "calibrate": ("--json",),
}


@pytest.mark.parametrize(("command", "option"), [(c, option) for c, options in COMMANDS.items() for option in options])
@pytest.mark.parametrize("bad", ["a file/out", ""])
def test_an_output_that_cannot_be_written_says_so_before_any_work_is_done(
    command: str, option: str, bad: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "a file").touch()
    given = [] if command == "calibrate" else [str(tmp_path / "not there")]
    assert main([command, *given, option, str(tmp_path / bad) if bad else ""]) == 1  # 2 once the input is looked for
    message = capsys.readouterr().err
    assert ("can't write" if bad else "an output needs a name") in message
    assert len(message.splitlines()) == 1


def test_a_missing_folder_of_an_output_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    missing = tmp_path / "none" / "out.npz"
    assert main(["predict", written(tmp_path, paper_scene()), "-o", str(missing)]) == 1
    assert f"can't write {missing}: there is no folder {missing.parent}" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("outputs", "named"),
    [
        (["-o", "same", "--json", "same"], "--json: got same. Allowed: a file of its own, not that of --output."),
        (["-o", "-", "--json", "-"], "--json: got -."),
        (["--json", "scene.json"], "not that of the input."),
        (["--json", "./link.json"], "not that of the input."),
        (["--rrd", "out.txt"], "--rrd: got out.txt. Allowed: a name that ends in .rrd."),
        (["--rrd", "-"], "--rrd: got -. Allowed: the name of a file"),
    ],
)
def test_outputs_do_not_overwrite_each_other_or_the_scene(
    outputs: list[str], named: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    scene = Path(written(tmp_path, paper_scene()))
    (tmp_path / "link.json").symlink_to(scene)
    before = scene.read_bytes()
    assert main(["predict", "scene.json", *outputs]) == 2
    assert named in capsys.readouterr().err
    assert scene.read_bytes() == before
    assert sorted(file.name for file in tmp_path.iterdir()) == ["link.json", "scene.json"]


@pytest.mark.parametrize(
    "command",
    [
        "identify shaken.csv -o shaken.json",
        "identify shaken.csv --report ./shaken.json",
        "validate shaken.npz --json shaken.json",
        "validate . --json shaken.json",
    ],
)
def test_what_is_told_beside_a_recording_is_not_overwritten(
    command: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("shaken.csv", "shaken.npz", "shaken.json"):
        Path(name).write_text(name)
    assert main(command.split()) == 2
    assert "shaken.json. Allowed: a file of its own, not that of the input." in capsys.readouterr().err
    assert Path("shaken.json").read_text() == "shaken.json"


@pytest.mark.parametrize("name", ["out.csv", "out", "out.json"])
def test_arrays_are_not_written_under_the_name_of_another_format(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    output = tmp_path / name
    assert main(["predict", str(tmp_path / "not there"), "-o", str(output)]) == 2
    assert f"--output: got {output}. Allowed: a name that ends in .npz; " in capsys.readouterr().err


def test_a_device_takes_arrays_under_any_name(tmp_path: Path) -> None:
    assert main(["predict", written(tmp_path, paper_scene()), "-o", os.devnull]) == 0


def test_an_output_is_whole_or_as_it_was(tmp_path: Path) -> None:
    file, link = tmp_path / "out.json", tmp_path / "link"
    file.write_text("before")
    file.chmod(0o640)
    link.symlink_to(file)

    def interrupted() -> None:
        with whole(link) as unfinished:
            unfinished.write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert file.read_text() == "before"
    write_output(str(link), b"after")
    assert link.is_symlink()
    assert (file.read_text(), file.stat().st_mode & 0o777) == ("after", 0o640)
    assert sorted(tmp_path.iterdir()) == [link, file]


def in_shell(line: str, tmp_path: Path) -> subprocess.CompletedProcess[str]:
    """Run a line of a shell in which `dlo` is the command line."""
    script = f'dlo() {{ "{sys.executable}" -m app.cli "$@"; }}\n{line}'
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "DLO_DATA_DIR": str(tmp_path / "data")}
    return subprocess.run(
        ["bash", "-c", script], cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=120, check=False
    )


@pytest.mark.parametrize(
    ("line", "code", "said"),
    [
        ("dlo predict scene.json --json - | true; exit ${PIPESTATUS[0]}", 141, "converged: "),
        ("dlo predict scene.json --json - > /dev/full", 1, "can't write standard output: No space left on device"),
        ("dlo predict scene.json --json - >&-", 1, "--json: standard output is closed"),
        ("dlo predict - <&-", 2, "standard input is closed"),
        ("dlo predict scene.json 2>&-", 0, ""),
        ("dlo --version", 0, ""),
    ],
)
def test_closed_and_full_ends_are_told_in_one_line(line: str, code: int, said: str, tmp_path: Path) -> None:
    written(tmp_path, paper_scene())
    done = in_shell(line, tmp_path)
    assert done.returncode == code, done.stderr
    assert "Traceback" not in done.stderr
    assert code == 141 or said in done.stderr


def test_an_interrupt_while_it_still_starts_is_one(tmp_path: Path) -> None:
    written(tmp_path, paper_scene())
    done = in_shell(f'timeout -s INT 0.3 "{sys.executable}" -m app.cli predict scene.json', tmp_path)
    assert done.returncode == 124  # of timeout, which had to end it
    assert done.stderr == ""


def test_a_deadline_ends_a_solve(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    long = written(tmp_path, {**paper_scene(quality={"target_error": 1e-6}), "horizon": 500.0})
    assert main(["predict", long, "--deadline", "0.5"]) == 3
    assert capsys.readouterr().err.startswith("time_limit: ")
    for bad in ("0", "-1", "nan", "inf"):
        assert main(["predict", long, "--deadline", bad]) == 2
        assert f"--deadline: got {bad}. Allowed: a finite number above 0 [s]." in capsys.readouterr().err


def test_a_name_that_is_given_twice_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "scene.json").write_text('{"cable": {"preset": "paper"}, "cable": {"preset": "black-wire"}}')
    assert main(["predict", str(tmp_path / "scene.json")]) == 2
    assert "got 'cable' twice in one object" in capsys.readouterr().err


@pytest.mark.parametrize("method", ["paper", "spacetime"])
def test_a_method_that_needs_a_grid_is_named_with_its_option(
    method: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scene = written(tmp_path, paper_scene(quality="auto"))
    assert main(["predict", scene, "--method", method]) == 2
    assert f"--method: got {method}. Allowed: march or reference, or a scene whose quality" in capsys.readouterr().err


@pytest.mark.parametrize("models", ["bend", "", "scalars,scalars"])
def test_an_unknown_model_is_refused(models: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["validate", str(tmp_path), "--models", models]) == 2
    assert f"--models: got {models!r}. Allowed: scalars or bends" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["nope.json"], "dlo: can't read nope.json: No such file or directory"),
        (["--grids", "9x999999"], "dlo: --grids: got 9x999999. Allowed: for n_t an integer, 5 to 513."),
        (["--deltas", "1"], "dlo: --deltas: got 1.0. Allowed: a finite number at least 1e-10 at most 0.01 [m]."),
        (
            ["--effects", "stretch=off"],
            'dlo: --effects, stretch: got off. Without axial stiffness a cable has no length. Allowed: "on" or "auto".',
        ),
        (["--effects", "drag=on,drag=off"], "dlo: --effects: got 'drag=on,drag=off'. Allowed: drag once."),
        (["--effects", "auto", "auto"], "dlo: --effects: got auto. Allowed: each once."),
    ],
)
def test_what_a_study_refuses_is_named_once(
    arguments: list[str], told: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["study", *arguments]) == 2
    assert capsys.readouterr().err.strip() == told


@pytest.mark.skipif(not Path("/proc").is_dir(), reason="no folder in which none can be made")
def test_a_folder_of_plots_that_cannot_be_made_is_told_before_anything_is_measured(
    capsys: pytest.CaptureFixture[str],
) -> None:
    pytest.importorskip("matplotlib")
    assert main(["study", "--plots", "/proc/plots", "--repeats", "100"]) == 1
    assert capsys.readouterr().err.strip() == "dlo: can't write /proc/plots: No such file or directory"


def test_an_interrupted_study_says_that_nothing_is_kept(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def interrupted(plan: Any, on_progress: Any) -> None:
        on_progress(3, 7, "a run")
        raise KeyboardInterrupt

    monkeypatch.setattr("dlocore.study.running.run_study", interrupted)
    assert main(["study", "-o", str(tmp_path / "now.json")]) == 130
    assert capsys.readouterr().err.strip() == "dlo: interrupted after 3 of 7 parts; nothing is kept"
    assert not list(tmp_path.iterdir())


def test_a_comparison_with_nothing_in_common_is_none(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene, before = written(tmp_path, paper_scene()), str(tmp_path / "before.json")
    quick = ["--methods", "march", "--parts", "runs", "--repeats", "1"]
    assert main(["study", scene, "--grids", "9x13", *quick, "-o", before]) == 0
    assert main(["study", scene, "--grids", "9x13", "7x11", *quick, "--compare", before]) == 0
    assert "1 run compared; 0 changes for the worse" in capsys.readouterr().out
    assert main(["study", scene, "--grids", "7x11", *quick, "--compare", before]) == 2
    output = capsys.readouterr()
    assert "not measured now: scene: march, 9 x 13" in output.out
    assert f"{before} has no run in common with this study" in output.err


def test_a_recording_of_the_command_line_is_that_of_the_solve(tmp_path: Path) -> None:
    rr = pytest.importorskip("rerun")
    rrd, full = tmp_path / "out.rrd", tmp_path / "out.json"
    assert main(["predict", written(tmp_path, paper_scene()), "--rrd", str(rrd), "--json", str(full)]) == 0
    reader = rr.chunk.RrdReader(rrd)
    entities = {chunk.entity_path for chunk in reader.stream().to_chunks()}
    assert {"/iterate/shape", "/iterate/net", "/motion/cable", "/convergence/residual", "/report"} <= entities


@pytest.mark.parametrize(
    ("name", "value", "told"),
    [
        ("DLO_PORT", "here", "DLO_PORT: got 'here'. "),
        ("DLO_ALLOWED_ORIGINS", "foo", "DLO_ALLOWED_ORIGINS: got 'foo'. Allowed: Other origins"),
        (
            "DLO_ALLOWED_ORIGINS",
            '["lab"]',
            "DLO_ALLOWED_ORIGINS: got ['lab']. 'lab' is not an origin such as https://host",
        ),
        ("DLO_TOKEN", "short", "DLO_TOKEN: got a secret. It has 5 characters, and needs at least 8: Bearer token"),
    ],
)
def test_a_bad_setting_is_named(
    name: str, value: str, told: str, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv(name, value)
    assert main(["serve"]) == 2
    message = capsys.readouterr().err
    assert message.startswith(f"dlo: {told}")
    assert "short" not in message


def test_what_serve_can_not_have_is_named_before_it_says_where_it_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("DLO_DATA_DIR", str(tmp_path))
    assert main(["serve", "--port", "99999"]) == 2
    assert "--port: got 99999. " in capsys.readouterr().err
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        assert main(["serve", "--port", str(port)]) == 1
    assert f"can't listen on port {port} of 127.0.0.1: Address already in use. " in capsys.readouterr().err
    (tmp_path / "file").touch()
    monkeypatch.setenv("DLO_DATA_DIR", str(tmp_path / "file" / "data"))
    assert main(["serve", "--port", "0"]) == 1
    output = capsys.readouterr()
    assert output.out == ""
    assert f"DLO_DATA_DIR: can't create {tmp_path}/file/data: Not a directory" in output.err


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


def test_the_help_tells_the_defaults_of_identification(capsys: pytest.CaptureFixture[str]) -> None:
    told = {}
    for command in ("identify", "validate"):
        with pytest.raises(SystemExit):
            main([command, "--help"])
        told[command] = " ".join(capsys.readouterr().out.split())
    assert f"(default: {', '.join(DEFAULT[:-1])} and {DEFAULT[-1]})" in told["identify"]
    assert f"windows of each cable to fit on (default {FIT})" in told["validate"]


@pytest.mark.parametrize("command", ["predict", "identify", "calibrate", "study", "validate"])
def test_the_help_of_a_command_lists_its_exit_codes(command: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main([command, "--help"])
    told = " ".join(capsys.readouterr().out.split())
    assert re.search(r"exit codes: 0 \w+; 1 an output can't be written", told)
