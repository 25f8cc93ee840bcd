"""Recordings: markers tracked along a cable over time, which of them are held, and what is known of the cable.

Files (docs/identification.md): one `.npz` with the arrays `times` and `markers` and a JSON text `about`, or a `.csv` of
the markers with a `.json` of the same name in the same folder.
"""

import csv
import json
import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dlocore.array_files import ArrayFile
from dlocore.errors import (
    MILLIMETRES,
    SceneError,
    array,
    instance,
    instances,
    number,
    repeated,
    unmasked,
    whole,
    within,
)
from dlocore.pickling import Checked
from dlocore.scene.cable import PointMass
from dlocore.words import counted

Floats = NDArray[np.float64]

PAIR = 0.06  # of the length: two held neighbours at most this far apart are one clamp
LEAST_SEEN = 0.2  # of the frames in which each marker must be seen
LEAST_FRAMES = 10  # of a motion
_ELSEWHERE = 20.0  # times its mean step from frame to frame: a marker does not go farther in one
_NOISY = 0.02  # relative, by which noise may make the distances of markers add up to more than the cable's length
_OTHER_UNIT = 20.0  # times the length: distances that add up to more must be in another unit, not in another order
_FACTS = ("u", "held", "length", "diameter", "linear_density", "point_masses", "gravity", "static", "name")


@dataclass(frozen=True)
class Hold:
    """One gripper, as the held markers show it.

    Attributes:
        marker: the marker whose position is held.
        towards: its held neighbour, which gives the direction only; None: the direction is free.
        forward: whether the neighbour lies towards larger u.
    """

    marker: int
    towards: int | None = None
    forward: bool = True

    def along(self, marker: Floats, towards: Floats) -> Floats:
        """Return the unit directions of larger u (k, 3) from the positions (k, 3) [m] of `marker` and `towards`."""
        way = (towards - marker) * (1.0 if self.forward else -1.0)
        return np.asarray(way / np.linalg.norm(way, axis=1)[:, None])


@dataclass(frozen=True, kw_only=True, eq=False)
class Recording(Checked):
    """Tracked markers of one motion, or of several shapes at rest.

    Args:
        times: (k,) [s], rising, evenly or not.
        markers: (k, m, 2 or 3) [m], NaN or masked where a marker was lost; 2D markers lie at z = 0.
        u: material coordinates of the markers (m,) [m], rising; None: from the distances of neighbours.
        held: numbers of the markers that grippers hold; negative ones count from the end.
        length: of the cable [m]; None: it ends at the last marker.
        diameter, linear_density: of the cable if known, [m] and [kg/m].
        point_masses: attached parts, such as a connector at an end.
        gravity: (3,) [m/s^2].
        static: whether every frame is a separate shape at rest; `times` then only number the frames.
        name: used in reports and errors.

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
    point_masses: tuple[PointMass, ...] = ()
    gravity: ArrayLike = (0.0, 0.0, -9.81)
    static: bool = False
    name: str = "recording"

    def __post_init__(self) -> None:
        def put(name: str, value: Any) -> None:
            object.__setattr__(self, name, value)

        times = array("times", self.times, shape=(None,), unit="s")
        if not (np.diff(times) > 0).all():
            k = int(np.argmin(np.diff(times) > 0))
            raise SceneError(f"times[{k + 1}]", float(times[k + 1]), "rising times [s]")
        for name, kind, allowed in (("static", bool | np.bool_, "true or false"), ("name", str, "text")):
            if not isinstance(getattr(self, name), kind):
                raise SceneError(name, repr(getattr(self, name)), allowed)
        put("static", bool(self.static))
        if not self.static and len(times) < LEAST_FRAMES:
            raise SceneError("times", counted(len(times), "frame"), f"at least {LEAST_FRAMES} frames of a motion")
        put("times", times)
        put("markers", _markers(self.markers, len(times), self.static))
        count = cast(Floats, self.markers).shape[1]
        put("held", _held(self.held, count))
        u = self._spacing() if self.u is None else array("u", self.u, shape=(count,), unit="m")
        if not ((np.diff(u) > 0).all() and u[0] >= 0):
            raise SceneError("u", u, "rising material coordinates from 0 on [m]")
        length = float(u[-1])
        if self.length is not None:
            least = {"above": 0.0} if self.u is None else {"at_least": length}
            length = number("length", self.length, at_most=1e3, unit="m", **least)
        put("u", _no_longer(u, length))
        put("length", length)
        for name, unit in (("diameter", "m"), ("linear_density", "kg/m")):
            if getattr(self, name) is not None:
                put(name, number(name, getattr(self, name), above=0.0, at_most=1e4, unit=unit))
        put("point_masses", instances("point_masses", self.point_masses, PointMass, "PointMass"))
        for i, one in enumerate(self.point_masses):
            if not one.u <= length:
                raise SceneError(f"point_masses[{i}].u", one.u, f"0 to the cable's length, {length:g} [m]")
        put("gravity", array("gravity", self.gravity, shape=(3,), unit="m/s^2"))

    def _spacing(self) -> Floats:
        """Return coordinates from the median distances of neighbours, from 0 at the first marker."""
        distance = np.linalg.norm(np.diff(cast(Floats, self.markers), axis=1), axis=2)
        return np.concatenate([[0.0], np.cumsum(np.nanmedian(distance, axis=0))])

    @property
    def place(self) -> str:
        """Prefix of its fields in errors."""
        return f"recordings[{self.name!r}]"

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
        """The grippers. Two held neighbours close to each other are one clamp: the inner one is held in position.

        They are not two held positions, since these would conflict: the measured distance varies by millimetres, that
        along the cable does not. Between the two the cable is as straight as the gripper.
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
        """Return the frames from `begin` to `end` [s], counted from the first frame.

        Raises:
            SceneError: they are too few for a motion.
        """
        times = cast(Floats, self.times)
        inside = (times >= times[0] + begin - 1e-9) & (times <= times[0] + end + 1e-9)
        if not self.static and inside.sum() < LEAST_FRAMES:
            given = f"{counted(int(inside.sum()), 'frame')} between {begin:.6g} and {end:.6g} s"
            reason = apart_in_words(times)
            raise SceneError("times", given, f"at least {LEAST_FRAMES} frames in every window of a motion", reason)
        return replace(self, times=times[inside], markers=cast(Floats, self.markers)[inside])


def apart_in_words(times: Floats) -> str:
    """Return in words the longest time between frames, and its possible causes."""
    return f"Frames are up to {np.diff(times).max():.3g} s apart: times in another unit than s, or a pause"


def _no_longer(u: Floats, length: float) -> Floats:
    """Return coordinates (m,) [m], found from distances that noise lengthens, scaled to fit on a cable of a length [m].

    Raises:
        SceneError: they exceed the length by more than noise explains.
    """
    times = float(u[-1]) / length
    if times > 1.0 + _NOISY:
        k = int(np.argmax(np.diff(u)))
        apart = f"Markers {k} and {k + 1} are {u[k + 1] - u[k]:.4g} m apart: perhaps they are in another order"
        allowed = f"at least {u[-1]:.6g} m, to which the distances of neighbouring markers add up"
        raise SceneError("length", f"{length:.6g} m", allowed, MILLIMETRES if times > _OTHER_UNIT else apart)
    return np.minimum(u / max(times, 1.0), length)


def seen_markers(value: ArrayLike) -> Floats:
    """Return the coordinates of markers [m] as floats, NaN where one was lost or is masked.

    Raises:
        SceneError: they are not numbers, the rows differ in length, or one is infinite or huge.
    """
    try:
        raw = np.asarray(unmasked(value))
    except ValueError:
        raise SceneError("markers", "rows that differ in length", "as many markers in every frame") from None
    if raw.dtype.kind not in "fiu":
        raise SceneError("markers", f"{raw.dtype}", "numbers [m], NaN where a marker was lost")
    markers = np.array(raw, dtype=float)
    if np.isinf(markers).any() or not np.nanmax(np.abs(markers), initial=0.0) < 1e5:
        raise SceneError("markers", "an infinite or huge coordinate", "finite coordinates [m], NaN where lost")
    return markers


def _markers(value: ArrayLike, frames: int, static: bool) -> Floats:
    markers = seen_markers(value)
    if markers.ndim != 3 or markers.shape[0] != frames or markers.shape[2] not in (2, 3) or markers.shape[1] < 3:
        raise SceneError("markers", f"shape {markers.shape}", f"({frames}, at least 3 markers, 2 or 3) [m]")
    if markers.shape[2] == 2:
        markers = np.concatenate([markers, 0.0 * markers[..., :1]], axis=2)
    markers[np.isnan(markers).any(axis=2)] = np.nan
    if not static:
        markers[_zeros_of_lost(markers)] = np.nan
    seen = np.isfinite(markers[..., 0]).mean(axis=0)
    if not (seen >= LEAST_SEEN).all():
        i = int(np.argmin(seen))
        raise SceneError(f"markers[:, {i}]", f"seen in {seen[i]:.0%} of the frames", f"at least {LEAST_SEEN:.0%}")
    markers.setflags(write=False)
    return markers


def _zeros_of_lost(markers: Floats) -> NDArray[np.bool_]:
    """Return which samples (frames, m) of a motion are (0, 0, 0) because their marker was lost; some trackers do that.

    A lost marker is much farther from the origin in the frames before and after than it moves from frame to frame. A
    marker that really is at the origin was near it in the frame before or after.
    """
    at = np.linalg.norm(markers, axis=2)
    steps = np.where((at[1:] > 0.0) & (at[:-1] > 0.0), np.linalg.norm(np.diff(markers, axis=0), axis=2), np.nan)
    lost = np.zeros(at.shape, dtype=bool)
    for marker, away in enumerate(at.T):
        zeros, others = np.flatnonzero(away == 0.0), np.flatnonzero(away > 0.0)
        if len(zeros) and len(others):
            own = steps[:, marker][np.isfinite(steps[:, marker])]
            far = _ELSEWHERE * float(own.mean()) if len(own) else 0.0
            after = np.searchsorted(others, zeros)
            beside = others[np.maximum(after - 1, 0)], others[np.minimum(after, len(others) - 1)]
            lost[zeros, marker] = np.minimum(away[beside[0]], away[beside[1]]) > far
    return lost


def _held(held: tuple[int, ...], count: int) -> tuple[int, ...]:
    out = []
    for i, marker in enumerate(instances("held", held, object, "markers' numbers")):
        if isinstance(marker, bool) or not isinstance(marker, int | np.integer) or not -count <= marker < count:
            raise SceneError(f"held[{i}]", marker, f"a marker's number, {-count} to {count - 1}")
        out.append(int(marker) % count)
    if len(set(out)) != len(out):
        raise SceneError("held", held, "each marker once")
    if len(out) == count:
        raise SceneError("held", held, "at least one marker that is free")
    return tuple(sorted(out))


def load_recording(path: str | Path, *, largest: float = math.inf) -> Recording:
    """Read a recording from `<name>.npz`, or from `<name>.csv` with `<name>.json` in the same folder.

    Args:
        path: the file.
        largest: largest size of an unpacked array of a `.npz` [bytes].

    Raises:
        SceneError: the file is not a recording, or its contents do not fit together.
        OSError: it can't be read.
    """
    path = Path(path)
    if path.suffix == ".npz":
        return _from_npz(path, largest)
    if path.suffix == ".csv":
        return _from_csv(path)
    raise SceneError("recording", path.name, "a .npz, or a .csv with a .json of the same name")


def save_recording(recording: Recording, path: str | Path) -> None:
    """Write a recording as one `.npz` that `load_recording` reads.

    Raises:
        SceneError: `recording` is no Recording, or `path` does not end in `.npz`.
        OSError: it can't be written.
    """
    instance("recording", recording, Recording, "a Recording")
    if Path(path).suffix != ".npz":
        raise SceneError("recording", Path(path).name, "a .npz")
    np.savez_compressed(
        path,
        times=cast(Floats, recording.times),
        markers=cast(Floats, recording.markers),
        about=np.array(json.dumps(about(recording))),
    )


def about(recording: Recording) -> dict[str, Any]:
    """Return the facts of a recording besides its arrays, as data for JSON."""
    facts = {name: getattr(recording, name) for name in _FACTS}
    facts["point_masses"] = [asdict(one) for one in recording.point_masses]
    return {k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in facts.items() if v is not None}


def recording_of(times: ArrayLike, markers: ArrayLike, facts: Mapping[str, Any]) -> Recording:
    """Return the recording made of arrays and facts in the form of files and requests.

    Raises:
        SceneError: a fact is unknown or wrong.
    """
    unknown = sorted(set(facts) - set(_FACTS))
    if unknown:
        raise SceneError(unknown[0], facts[unknown[0]], "one of " + ", ".join(_FACTS))
    held = facts.get("held", ())
    if not isinstance(held, list | tuple):
        raise SceneError("held", held, "a list of markers' numbers")
    masses = _point_masses(facts.get("point_masses", []))
    return Recording(times=times, markers=markers, **{**facts, "held": tuple(held), "point_masses": masses})


def _point_masses(given: Any) -> tuple[PointMass, ...]:
    if not isinstance(given, list | tuple):
        raise SceneError("point_masses", given, 'a list of {"u": ..., "mass": ...}')
    out = []
    for i, one in enumerate(given):
        if not isinstance(one, Mapping) or set(one) != {"u", "mass"}:
            raise SceneError(f"point_masses[{i}]", one, '"u" [m] and "mass" [kg]')
        with within(f"point_masses[{i}]"):
            out.append(PointMass(u=one["u"], mass=one["mass"]))
    return tuple(out)


def read_facts(path: Path) -> dict[str, Any]:
    """Return the JSON object in a file.

    Raises:
        SceneError: it does not hold a JSON object, or a name occurs twice.
        OSError: it can't be read.
    """
    try:
        return _json(path.read_text(encoding="utf-8-sig"), path.name)
    except UnicodeDecodeError as error:
        raise SceneError(path.name, str(error), "text in UTF-8") from None


def _from_npz(path: Path, largest: float) -> Recording:
    with path.open("rb") as file:
        arrays = ArrayFile(file, path.name, largest)
        missing = [name for name in ("times", "markers") if name not in arrays.names]
        if missing:
            allowed = "the arrays times (k,) and markers (k, m, 2 or 3)"
            raise SceneError(f"recordings[{path.name!r}].{missing[0]}", sorted(arrays.names), allowed, "It is missing")
        facts = _json(str(arrays.read("about")), f"{path.name}, about") if "about" in arrays.names else {}
        return _of_file(path, arrays.read("times"), arrays.read("markers"), facts)


def _from_csv(path: Path) -> Recording:
    """Read rows of time, then x, y (and z) of each marker; an empty cell or `nan` is a lost marker.

    A first row without a number names the columns.
    """
    rows = _rows(path)
    beside = path.with_suffix(".json")
    if not beside.exists():
        allowed = "a .json of the same name with the facts of the recording"
        raise SceneError(path.name, f"no {beside.name} in the same folder", allowed)
    facts = read_facts(beside)
    named = f"recordings[{path.name!r}].dimensions"
    dimensions = whole(named, facts.pop("dimensions", 3), at_least=2, at_most=3)
    if rows and not any(_is_number(cell) for cell in rows[0][1]):
        rows = rows[1:]
    width = len(rows[0][1]) if rows else 0
    if width < 1 + 3 * dimensions or (width - 1) % dimensions:
        allowed = f"time and {dimensions} columns for each of 3 markers or more, between commas"
        raise SceneError(f"{path.name}, line {rows[0][0]}" if rows else path.name, counted(width, "column"), allowed)
    values = np.empty((len(rows), width))
    for i, (line, row) in enumerate(rows):
        place = f"{path.name}, line {line}"
        if len(row) != width:
            raise SceneError(place, counted(len(row), "column"), f"{width} columns, as in line {rows[0][0]}")
        try:
            values[i] = [float(cell) if cell.strip() else np.nan for cell in row]
        except ValueError:
            wrong = next(cell for cell in row if cell.strip() and not _is_number(cell))
            raise SceneError(place, wrong, "numbers, empty where a marker was lost") from None
    return _of_file(path, values[:, 0], values[:, 1:].reshape(len(rows), -1, dimensions), facts)


def _rows(path: Path) -> list[tuple[int, list[str]]]:
    """Return the rows of a `.csv` that are not empty, each with the number of the line on which it ends."""
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.reader(file)
            return [(reader.line_num, row) for row in reader if row]
    except (UnicodeDecodeError, csv.Error) as error:
        raise SceneError(path.name, str(error), "rows of numbers as text in UTF-8") from None


def _of_file(path: Path, times: ArrayLike, markers: ArrayLike, facts: dict[str, Any]) -> Recording:
    with within(f"recordings[{path.name!r}]"):
        return recording_of(times, markers, {"name": path.stem, **facts})


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _json(text: str, name: str) -> dict[str, Any]:
    def once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
        names = [key for key, _ in pairs]
        twice = repeated(names)
        if twice is not None:
            raise SceneError(name, f"{twice!r} {names.count(twice)} times", "each name once")
        return dict(pairs)

    try:
        facts = json.loads(text, object_pairs_hook=once)
    except SceneError:
        raise
    except (ValueError, RecursionError) as error:
        raise SceneError(name, str(error), "a JSON object") from None
    if not isinstance(facts, dict):
        raise SceneError(name, facts, "a JSON object")
    return facts
