"""Published data sets that a user has on disk, as recordings: motion capture of cables, hanging wires."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from dlocore.errors import SceneError
from dlocore.recordings import Recording

Floats = NDArray[np.float64]

FIT = 4  # windows of 5 s, of each cable, that parameters are fitted on; the others are predicted
PUBLISHED_BY = (
    "rod with a learned residual, best validation error in the training log of its authors (github.com/roahmlab/DEFORM)"
)
PUBLISHED = {"DLO1": 0.0103, "DLO2": 0.0102, "DLO3": 0.0099, "DLO4": 0.0115}  # L1 [m], source: PUBLISHED_BY


@dataclass(frozen=True, kw_only=True, eq=False)
class MovedCable:
    """Windows of motion of one cable, those to fit on and those to predict."""

    name: str
    fit: tuple[Recording, ...]
    test: tuple[Recording, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class HangingWire:
    """Repeated shapes of one wire that hangs between two clamps."""

    name: str
    recording: Recording
    published_bending_stiffness: float | None


def load_datasets(paths: list[Path], fit: int = FIT) -> tuple[list[MovedCable], list[HangingWire]]:
    """Return what the files, or the files in folders, hold.

    Files of one cable, such as DLO1_train.npz and DLO1_eval.npz, go together: it is fitted on windows spread evenly
    over the first of them, and all others are predicted.

    Args:
        paths: `.npz` files with a `.json` beside each, or folders of them.
        fit: number of windows of each cable to fit on.

    Raises:
        SceneError: a file is not of a known set, or nothing is there.
    """
    files: list[Path] = []
    for path in paths:
        if not path.exists():
            raise SceneError("dataset", str(path), "a file or a folder that exists")
        files += sorted(path.glob("*.npz")) if path.is_dir() else [path]
    moved: dict[str, list[tuple[Path, Floats, dict[str, Any]]]] = {}
    wires = []
    for file in files:
        beside = file.with_suffix(".json")
        facts = json.loads(beside.read_text()) if beside.exists() else {}
        with np.load(file) as data:
            markers = np.array(data["markers"], dtype=float) if "markers" in data.files else np.zeros(0)
        if markers.ndim == 4:
            moved.setdefault(file.stem.split("_")[0], []).append((file, markers, facts))
        elif markers.ndim == 3 and facts.get("static") and file.stem.endswith("_hang"):
            wires.append(_wire(file.stem.removesuffix("_hang"), markers, facts))
        elif len(paths) == len(files):
            raise SceneError("dataset", file.name, "markers (windows, frames, markers, 3), or shapes of a hanging wire")
    cables = [_moved(name, parts, fit) for name, parts in moved.items()]
    if not cables and not wires:
        raise SceneError("dataset", [str(p) for p in paths], "files of motion windows or of hanging wires")
    return cables, wires


def _moved(name: str, parts: list[tuple[Path, Floats, dict[str, Any]]], fit: int) -> MovedCable:
    parts = sorted(parts, key=lambda part: "train" not in part[0].stem)
    first, markers, facts = parts[0]
    if len(markers) <= fit and len(parts) == 1:
        raise SceneError("fit", fit, f"fewer than the {len(markers)} windows of {first.name}")
    chosen = np.unique(np.linspace(0, len(markers), fit, endpoint=False).astype(int))
    u = _coordinates(markers[chosen])
    held = tuple(int(i) for i in facts.get("held_markers", (0, 1, -2, -1)))

    def recording(part: tuple[Path, Floats, dict[str, Any]], window: int) -> Recording:
        path, x, about = part
        number = about.get("windows", list(range(len(x))))[window]
        times = 0.01 * np.arange(x.shape[1])
        density = float(about.get("nominal_linear_density", 0.04))
        label = f"{path.stem} {number}"
        return Recording(times=times, markers=x[window], u=u, held=held, linear_density=density, name=label)

    test = [recording(parts[0], i) for i in range(len(markers)) if i not in chosen]
    test += [recording(part, i) for part in parts[1:] for i in range(len(part[1]))]
    return MovedCable(name=name, fit=tuple(recording(parts[0], int(i)) for i in chosen), test=tuple(test))


def _coordinates(markers: Floats) -> Floats:
    distance = np.linalg.norm(np.diff(markers, axis=2), axis=3).reshape(-1, markers.shape[2] - 1)
    return np.concatenate([[0.0], np.cumsum(np.nanmedian(distance, axis=0))])


def _wire(name: str, markers: Floats, facts: dict[str, Any]) -> HangingWire:
    length = float(facts["length_m"])
    u = _coordinates(markers[None])
    recording = Recording(
        times=np.arange(len(markers), dtype=float),
        markers=markers,
        u=u * (length / u[-1]),
        held=(0, 1, -2, -1),
        length=length,
        diameter=facts.get("diameter_m"),
        linear_density=float(facts["linear_density_kg_per_m"]),
        static=True,
        name=name,
    )
    published = cast(dict[str, Any], facts.get("bend_stiffness_EI_identified_Nm2", {})).get("mean")
    return HangingWire(name=name, recording=recording, published_bending_stiffness=published)
