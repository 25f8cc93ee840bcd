"""Recordings: markers tracked along a cable over time, which of them are held, and what is known of the cable.

Files (docs/identification.md): one `.npz` with the arrays `times` and `markers` and a JSON text `about`, or a `.csv` of
the markers with a `.json` of the same name beside it.
"""

import csv
import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dlocore.errors import SceneError, array, number

Floats = NDArray[np.float64]

PAIR = 0.06  # of the length: two held neighbours at an end, nearer than this to each other, are one clamp
LEAST_SEEN = 0.2  # of the frames in which each marker must be seen
_FACTS = ("u", "held", "length", "diameter", "linear_density", "gravity", "static", "name")


@dataclass(frozen=True)
class Hold:
    """What the held markers say of one gripper.

    Attributes:
        marker: the marker whose position is held.
        towards: its held neighbour, which gives the direction only; None: the direction is free.
        forward: the neighbour lies towards larger u.
    """

    marker: int
    towards: int | None = None
    forward: bool = True


@dataclass(frozen=True, kw_only=True, eq=False)
class Recording:
    """Tracked markers of one motion, or of several shapes at rest.

    Args:
        times: (k,) [s], rising, evenly or not.
        markers: (k, m, 2 or 3) [m], NaN where a marker was lost; 2D markers lie at z = 0.
        u: material coordinates of the markers (m,) [m], rising; None: from the distances of neighbours.
        held: the markers that grippers hold; negative ones count from the end.
        length: of the cable [m]; None: it ends at the outermost markers.
        diameter, linear_density: what is known of the cable, [m] and [kg/m].
        gravity: (3,) [m/s^2].
        static: every frame is a shape at rest of its own, and `times` only number them.
        name: for reports.

    Raises:
        SceneError: the arrays do not fit together, or too little was seen.
    """

    times: ArrayLike
    markers: ArrayLike
    u: ArrayLike | None = None
    held: tuple[int, ...] = ()
    length: float | None = None
    diameter: float | None = None
    linear_density: float | None = None
    gravity: ArrayLike = (0.0, 0.0, -9.81)
    static: bool = False
    name: str = "recording"

    def __post_init__(self) -> None:
        def put(name: str, value: Any) -> None:
            object.__setattr__(self, name, value)

        times = array("times", self.times, shape=(None,), unit="s")
        if not (np.diff(times) > 0).all():
            k = int(np.argmin(np.diff(times)))
            raise SceneError(f"times[{k + 1}]", times[k + 1], "rising times [s]")
        if not self.static and len(times) < 10:
            raise SceneError("times", f"{len(times)} frames", "at least 10 frames of a motion")
        put("times", times)
        put("markers", _markers(self.markers, len(times)))
        count = cast(Floats, self.markers).shape[1]
        put("held", _held(self.held, count))
        u = self._spacing() if self.u is None else array("u", self.u, shape=(count,), unit="m")
        if not ((np.diff(u) > 0).all() and u[0] >= 0):
            raise SceneError("u", u, "rising material coordinates from 0 on [m]")
        put("u", u)
        least = float(u[-1])
        length = least if self.length is None else number("length", self.length, at_least=least, at_most=1e3, unit="m")
        put("length", length)
        for name in ("diameter", "linear_density"):
            if getattr(self, name) is not None:
                put(name, number(name, getattr(self, name), above=0.0, at_most=1e4))
        put("gravity", array("gravity", self.gravity, shape=(3,), unit="m/s^2"))

    def _spacing(self) -> Floats:
        """Return coordinates from the median distances of neighbours, from 0 at the first marker."""
        distance = np.linalg.norm(np.diff(cast(Floats, self.markers), axis=1), axis=2)
        return np.concatenate([[0.0], np.cumsum(np.nanmedian(distance, axis=0))])

    @property
    def duration(self) -> float:
        """Recorded time [s]."""
        times = cast(Floats, self.times)
        return float(times[-1] - times[0])

    @property
    def free(self) -> NDArray[np.int64]:
        """The markers that nothing holds."""
        count = cast(Floats, self.markers).shape[1]
        return np.array([i for i in range(count) if i not in self.held], dtype=np.int64)

    @property
    def holds(self) -> tuple[Hold, ...]:
        """The grippers: a pair of close held neighbours is a clamp, of which the inner one is held in place.

        Both as two held positions would fight: their measured distance varies by millimetres, the cable's does not.
        Between them the cable is as straight as the gripper.
        """
        u, rest, found = cast(Floats, self.u), list(self.held), []
        middle = 0.5 * cast(float, self.length)
        while rest:
            first = rest.pop(0)
            near = rest and rest[0] == first + 1 and u[first + 1] - u[first] <= PAIR * cast(float, self.length)
            if not near:
                found.append(Hold(first))
                continue
            second = rest.pop(0)
            near_begin = 0.5 * (u[first] + u[second]) < middle
            found.append(Hold(second, first, False) if near_begin else Hold(first, second, True))
        return tuple(found)

    def part(self, begin: float, end: float) -> "Recording":
        """Return the frames from `begin` to `end` [s], counted from the first frame."""
        times = cast(Floats, self.times)
        inside = (times >= times[0] + begin - 1e-9) & (times <= times[0] + end + 1e-9)
        return replace(self, times=times[inside], markers=cast(Floats, self.markers)[inside])


def _markers(value: ArrayLike, frames: int) -> Floats:
    markers = np.array(value, dtype=float)
    if markers.ndim != 3 or markers.shape[0] != frames or markers.shape[2] not in (2, 3) or markers.shape[1] < 3:
        raise SceneError("markers", f"shape {markers.shape}", f"({frames}, at least 3 markers, 2 or 3) [m]")
    if np.isinf(markers).any() or not np.nanmax(np.abs(markers), initial=0.0) < 1e5:
        raise SceneError("markers", "an infinite or huge coordinate", "finite coordinates [m], NaN where lost")
    if markers.shape[2] == 2:
        markers = np.concatenate([markers, 0.0 * markers[..., :1]], axis=2)
    markers[np.isnan(markers).any(axis=2)] = np.nan
    seen = np.isfinite(markers[..., 0]).mean(axis=0)
    if not (seen >= LEAST_SEEN).all():
        i = int(np.argmin(seen))
        raise SceneError(f"markers[:, {i}]", f"seen in {seen[i]:.0%} of the frames", f"at least {LEAST_SEEN:.0%}")
    markers.setflags(write=False)
    return markers


def _held(held: tuple[int, ...], count: int) -> tuple[int, ...]:
    out = []
    for i, marker in enumerate(held):
        if isinstance(marker, bool) or not isinstance(marker, int | np.integer) or not -count <= marker < count:
            raise SceneError(f"held[{i}]", marker, f"a marker's number, {-count} to {count - 1}")
        out.append(int(marker) % count)
    if len(set(out)) != len(out):
        raise SceneError("held", held, "each marker once")
    if len(out) == count:
        raise SceneError("held", held, "at least one marker that is free")
    return tuple(sorted(out))


def load_recording(path: str | Path) -> Recording:
    """Read a recording from `<name>.npz`, or from `<name>.csv` with `<name>.json` beside it.

    Raises:
        SceneError: the file is not one, or what it holds does not fit together.
        OSError: it can't be read.
    """
    path = Path(path)
    if path.suffix == ".npz":
        return _from_npz(path)
    if path.suffix == ".csv":
        return _from_csv(path)
    raise SceneError("recording", path.name, "a .npz, or a .csv with a .json of the same name")


def save_recording(recording: Recording, path: str | Path) -> None:
    """Write a recording as one `.npz` that `load_recording` reads."""
    np.savez_compressed(
        path,
        times=cast(Floats, recording.times),
        markers=cast(Floats, recording.markers),
        about=np.array(json.dumps(about(recording))),
    )


def about(recording: Recording) -> dict[str, Any]:
    """Return what a recording says beside its arrays, as JSON."""
    facts = {name: getattr(recording, name) for name in _FACTS}
    return {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in facts.items() if v is not None}


def recording_of(times: ArrayLike, markers: ArrayLike, facts: Mapping[str, Any]) -> Recording:
    """Return the recording of arrays and facts as files and requests give them.

    Raises:
        SceneError: a fact is unknown or wrong.
    """
    unknown = sorted(set(facts) - set(_FACTS))
    if unknown:
        raise SceneError(unknown[0], facts[unknown[0]], "one of " + ", ".join(_FACTS))
    held = facts.get("held", ())
    if not isinstance(held, list | tuple):
        raise SceneError("held", held, "a list of markers' numbers")
    return Recording(times=times, markers=markers, **{**facts, "held": tuple(held)})


def _from_npz(path: Path) -> Recording:
    try:
        with np.load(path, allow_pickle=False) as data:
            arrays = {name: data[name] for name in data.files}
    except (ValueError, EOFError) as error:
        raise SceneError("recording", path.name, "a NumPy .npz file") from error
    missing = [name for name in ("times", "markers") if name not in arrays]
    if missing:
        raise SceneError(
            missing[0], sorted(arrays), "the arrays times (k,) and markers (k, m, 2 or 3)", "It is missing"
        )
    facts = _json(str(arrays["about"]), path.name) if "about" in arrays else {}
    facts.setdefault("name", path.stem)
    return recording_of(arrays["times"], arrays["markers"], facts)


def _from_csv(path: Path) -> Recording:
    """Read rows of time, then x, y (and z) of each marker; an empty cell or `nan` is a lost marker."""
    beside = path.with_suffix(".json")
    facts = _json(beside.read_text(), beside.name) if beside.exists() else {}
    facts.setdefault("name", path.stem)
    dimensions = 2 if facts.pop("dimensions", 3) == 2 else 3
    with path.open(newline="") as file:
        rows = [row for row in csv.reader(file) if row]
    if rows and not _is_number(rows[0][0]):
        rows = rows[1:]  # names of the columns
    width = len(rows[0]) if rows else 0
    if width < 1 + 3 * dimensions or (width - 1) % dimensions:
        raise SceneError(
            "recording", f"{width} columns", f"time and {dimensions} columns for each of 3 markers or more"
        )
    values = np.empty((len(rows), width))
    for i, row in enumerate(rows):
        if len(row) != width:
            raise SceneError(f"row {i + 1}", f"{len(row)} columns", f"{width} columns, as in the first row")
        try:
            values[i] = [float(cell) if cell.strip() else np.nan for cell in row]
        except ValueError:
            raise SceneError(f"row {i + 1}", ",".join(row), "numbers, empty where a marker was lost") from None
    return recording_of(values[:, 0], values[:, 1:].reshape(len(rows), -1, dimensions), facts)


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _json(text: str, name: str) -> dict[str, Any]:
    try:
        facts = json.loads(text)
    except ValueError:
        raise SceneError("about", name, "JSON") from None
    if not isinstance(facts, dict):
        raise SceneError("about", name, "a JSON object")
    return facts
