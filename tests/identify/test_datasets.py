"""Data sets on disk: what is damaged or missing in them is named, by file and field."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from dlocore import SceneError
from dlocore.identify.datasets import load_datasets

MARKERS = np.zeros((5, 12, 6, 3))
MARKERS[..., 0] = 0.1 * np.arange(6)
WIRE = {"static": True, "length_m": 0.5, "linear_density_kg_per_m": 0.02}


def kept(folder: Path, name: str, markers: Any, facts: Any = None) -> Path:
    np.savez(folder / name, markers=markers)
    if facts is not None:
        (folder / name).with_suffix(".json").write_text(facts if isinstance(facts, str) else json.dumps(facts))
    return folder / name


def refused(path: Path, fit: int = 2) -> SceneError:
    with pytest.raises(SceneError) as error:
        load_datasets([path], fit)
    return error.value


def test_windows_and_wires_are_loaded_and_other_files_of_a_folder_passed_over(tmp_path: Path) -> None:
    kept(tmp_path, "A_train.npz", MARKERS, {"held_markers": [0, -1], "windows": [3, 4, 5, 6, 7]})
    kept(tmp_path, "w_hang.npz", MARKERS[0], WIRE | {"bend_stiffness_EI_identified_Nm2": {"mean": 1e-3}})
    kept(tmp_path, "other.npz", [1, 2])
    (tmp_path / "notes.txt").write_text("none")
    cables, wires = load_datasets([tmp_path], 2)
    assert [w.name for w in cables[0].fit + cables[0].test] == [f"A_train {i}" for i in (3, 5, 4, 6, 7)]
    assert wires[0].recording.length == 0.5
    assert wires[0].published_bending_stiffness == 1e-3


@pytest.mark.parametrize(
    ("name", "markers", "facts", "field"),
    [
        ("A_train.npz", MARKERS, "{", "A_train.json"),
        ("A_train.npz", MARKERS, [], "A_train.json"),
        ("A_train.npz", np.array([{}]), None, "A_train.npz"),
        ("A_train.npz", MARKERS[:0], None, "datasets['A_train.npz'].markers"),
        ("A_train.npz", MARKERS[:, :, :1], None, "datasets['A_train.npz'].markers"),
        ("A_train.npz", MARKERS.astype(str), None, "datasets['A_train.npz'].markers"),
        ("A_train.npz", MARKERS, {"held_markers": 0}, "datasets['A_train.npz'].held_markers"),
        ("A_train.npz", MARKERS, {"held_markers": ["a"]}, "datasets['A_train.npz'].held[0]"),
        ("A_train.npz", MARKERS, {"windows": [1]}, "datasets['A_train.npz'].windows"),
        ("A_train.npz", MARKERS, {"nominal_linear_density": "x"}, "datasets['A_train.npz'].nominal_linear_density"),
        ("w_hang.npz", MARKERS[0], {"static": True}, "datasets['w_hang.npz'].length_m"),
        ("w_hang.npz", MARKERS[0], WIRE | {"length_m": "x"}, "datasets['w_hang.npz'].length_m"),
        ("w_hang.npz", MARKERS[0], WIRE | {"diameter_m": "x"}, "datasets['w_hang.npz'].diameter"),
        (
            "w_hang.npz", MARKERS[0], WIRE | {"linear_density_kg_per_m": None},
            "datasets['w_hang.npz'].linear_density_kg_per_m",
        ),
        (
            "w_hang.npz", MARKERS[0], WIRE | {"bend_stiffness_EI_identified_Nm2": 1},
            "datasets['w_hang.npz'].bend_stiffness_EI_identified_Nm2",
        ),
        ("x.npz", [1, 2], None, "dataset"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_a_data_set_is_named(
    tmp_path: Path, name: str, markers: Any, facts: Any, field: str
) -> None:
    assert refused(kept(tmp_path, name, markers, facts)).field == field


@pytest.mark.parametrize("content", [b"", b"PK"])
def test_a_damaged_data_set_is_named(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "A_train.npz").write_bytes(content)
    assert refused(tmp_path).field == "A_train.npz"


def test_a_file_that_is_no_npz_is_refused(tmp_path: Path) -> None:
    kept(tmp_path, "A_train.npz", MARKERS, {})
    assert refused(tmp_path / "A_train.json").given == "A_train.json"


@pytest.mark.parametrize("fit", [0, -1, 5])
def test_windows_to_fit_on_are_some_but_not_all(tmp_path: Path, fit: int) -> None:
    assert refused(kept(tmp_path, "A_train.npz", MARKERS), fit).field == "fit"
