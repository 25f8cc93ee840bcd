"""Published data sets that a user has on disk, read as recordings: motion capture of cables, and hanging wires."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dlocore.array_files import ArrayFile
from dlocore.errors import SceneError, number, whole, within
from dlocore.recordings import Recording, read_facts

Floats = NDArray[np.float64]

FIT = 4  # windows of 5 s, for each cable, on which parameters are fitted; the others are predicted
PUBLISHED_BY = (
    "rod with a learned residual, best validation error in the training log of its authors (github.com/roahmlab/DEFORM)"
)
PUBLISHED = {"DLO1": 0.0103, "DLO2": 0.0102, "DLO3": 0.0099, "DLO4": 0.0115}  # L1 [m], source: PUBLISHED_BY


@dataclass(frozen=True, kw_only=True, eq=False)
class MovedCable:
    """Windows of motion of one cable: some to fit on and the others to predict."""

    name: str
    fit: tuple[Recording, ...]
    test: tuple[Recording, ...]


@dataclass(frozen=True, kw_only=True, eq=False)
class HangingWire:
    """Repeated shapes of one wire that hangs between two clamps."""

    name: str
    recording: Recording
    published_bending_stiffness: float | None


def dataset_files(paths: list[Path]) -> list[Path]:
    """Return the given files, and those in the given folders, in the order in which `load_datasets` reads them."""
    return [file for path in paths for file in (sorted(path.glob("*.npz")) if path.is_dir() else [path])]


def load_datasets(paths: list[Path], fit: int = FIT) -> tuple[list[MovedCable], list[HangingWire]]:
    """Return the contents of the given files, or of the files in the given folders.

    Files of one cable, such as DLO1_train.npz and DLO1_eval.npz, belong together: the cable is fitted on windows spread
    evenly over the first file, and all other windows are predicted.

    Args:
        paths: `.npz` files with a `.json` next to each, or folders of them; other files in a folder are ignored.
        fit: number of windows of each cable to fit on.

    Raises:
        SceneError: a file is damaged, a given file is not of a known set, or nothing is there.
        OSError: a file can't be read.
    """
    fit = whole("fit", fit, at_least=1)
    for path in paths:
        if not path.exists():
            raise SceneError("dataset", str(path), "a file or a folder that exists")
        if not path.is_dir() and path.suffix != ".npz":
            raise SceneError("dataset", path.name, "a .npz file, with a .json beside it, or a folder of them")
    moved: dict[str, list[tuple[Path, Floats, dict[str, Any]]]] = {}
    wires = []
    for file in dataset_files(paths):
        with file.open("rb") as opened:
            arrays = ArrayFile(opened, file.name)
            markers = arrays.read("markers") if "markers" in arrays.names else np.zeros(0)
        beside = file.with_suffix(".json")
        facts = read_facts(beside) if beside.exists() else {}
        if markers.ndim == 4:
            numbers = _numbers(f"{_place(file)}.markers", markers)
            moved.setdefault(file.stem.split("_")[0], []).append((file, numbers, facts))
        elif markers.ndim == 3 and facts.get("static") is True and file.stem.endswith("_hang"):
            with within(_place(file)):
                wires.append(_wire(file.stem.removesuffix("_hang"), _numbers("markers", markers), facts))
        elif file in paths:
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
    held = facts.get("held_markers", [0, 1, -2, -1])
    if not isinstance(held, list):
        raise SceneError(f"{_place(first)}.held_markers", held, "a list of markers' numbers")

    def recording(part: tuple[Path, Floats, dict[str, Any]], window: int) -> Recording:
        path, x, about = part
        with within(_place(path)):
            numbers = about.get("windows", list(range(len(x))))
            if not isinstance(numbers, list) or len(numbers) != len(x):
                raise SceneError("windows", numbers, f"a list of the numbers of its {len(x)} windows")
            times = 0.01 * np.arange(x.shape[1])
            density = number("nominal_linear_density", about.get("nominal_linear_density", 0.04), above=0.0)
            label = f"{path.stem} {numbers[window]}"
            return Recording(times=times, markers=x[window], u=u, held=tuple(held), linear_density=density, name=label)

    test = [recording(parts[0], i) for i in range(len(markers)) if i not in chosen]
    test += [recording(part, i) for part in parts[1:] for i in range(len(part[1]))]
    return MovedCable(name=name, fit=tuple(recording(parts[0], int(i)) for i in chosen), test=tuple(test))


def _place(file: Path) -> str:
    return f"datasets[{file.name!r}]"


def _numbers(field: str, markers: NDArray[Any]) -> Floats:
    if markers.dtype.kind not in "fiu" or 0 in markers.shape or markers.shape[-2] < 3:
        raise SceneError(field, f"{markers.dtype} {markers.shape}", "numbers [m] of 3 markers or more")
    return np.array(markers, dtype=float)


def _coordinates(markers: Floats) -> Floats:
    distance = np.linalg.norm(np.diff(markers, axis=2), axis=3).reshape(-1, markers.shape[2] - 1)
    return np.concatenate([[0.0], np.cumsum(np.nanmedian(distance, axis=0))])


def _wire(name: str, markers: Floats, facts: dict[str, Any]) -> HangingWire:
    length = number("length_m", facts.get("length_m"), above=0.0, unit="m")
    density = number("linear_density_kg_per_m", facts.get("linear_density_kg_per_m"), above=0.0, unit="kg/m")
    published = facts.get("bend_stiffness_EI_identified_Nm2", {})
    if not isinstance(published, dict):
        raise SceneError("bend_stiffness_EI_identified_Nm2", published, 'an object with a "mean"')
    mean = published.get("mean")
    u = _coordinates(markers[None])
    recording = Recording(
        times=np.arange(len(markers), dtype=float),
        markers=markers,
        u=u * (length / u[-1]),
        held=(0, 1, -2, -1),
        length=length,
        diameter=facts.get("diameter_m"),
        linear_density=density,
        static=True,
        name=name,
    )
    if mean is not None:
        mean = number("bend_stiffness_EI_identified_Nm2.mean", mean, above=0.0, unit="N m^2")
    return HangingWire(name=name, recording=recording, published_bending_stiffness=mean)
