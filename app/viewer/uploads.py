"""Read files that the user opens: a scene as JSON, or the points of a cable as JSON, CSV or NumPy arrays."""

import io
import json
import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.viewer.draft import Draft
from app.viewer.shapes import between, scaled, with_points
from dlocore import SceneError
from dlocore.array_files import ArrayFile, read_array
from dlocore.errors import points_array
from dlocore.scene.cable import MAX_LENGTH, MIN_LENGTH
from dlocore.shape.cloud import LEAST, fit_cloud
from dlocore.shape.fit import MAX_LENGTH_MISMATCH

Floats = NDArray[np.float64]
LARGEST = 10_000_000  # bytes, of a file and of an array in it
MOST_POINTS = 2000  # most points that a document keeps; more are replaced by samples of a fitted curve
SAMPLES = 101  # of that curve
_KINDS = "a .json scene, or points as .json, .csv, .txt, .npz or .npy"
_ARRAYS = ("points", "positions", "control_points")


def opened(draft: Draft, name: str, content: bytes) -> Draft:
    """Return the draft that a file describes: its scene, or `draft` with the cable along its points.

    Raises:
        SceneError: the file can't be opened, or it contains no valid scene or points.
    """
    if len(content) > LARGEST:
        raise SceneError("file", f"{len(content)} bytes", f"at most {LARGEST} bytes")
    suffix = name.rsplit(".", 1)[-1].lower()
    readers: dict[str, Callable[[bytes], Any]] = {
        "json": _json,
        "csv": _csv,
        "txt": _csv,
        "npz": _arrays,
        "npy": _arrays,
    }
    if suffix not in readers:
        raise SceneError("file", name, _KINDS)
    found = readers[suffix](content)
    if isinstance(found, dict):
        scene = Draft.of(found) if _has_form(found) else Draft(document=found)
        scene.cable()  # raises if it is no valid request, or its cable is impossible: the panel could not show it
        return Draft.of(found)
    return _along(draft, points_array("points", found))


def _has_form(found: dict[str, Any]) -> bool:
    primitives = found.get("primitives", [])
    return isinstance(primitives, list) and all(
        isinstance(p, dict) and isinstance(p.get("path"), dict) and "kind" in p["path"] for p in primitives
    )


def _json(content: bytes) -> Any:
    try:
        found = json.loads(content.decode("utf-8-sig"))
    except ValueError as error:
        raise SceneError("file", f"invalid JSON: {error}", "a scene, or points, as JSON in UTF-8") from None
    if isinstance(found, dict) and "cable" in found:
        return {key: value for key, value in found.items() if key != "output"}
    if isinstance(found, dict) and "points" in found:
        found = found["points"]
    if isinstance(found, dict):
        raise SceneError("file", ", ".join(list(found)[:6]) or "{}", 'a scene with "cable", or "points"')
    return found


def _csv(content: bytes) -> Floats:
    """Return the rows of numbers in a text; rows of words before the first numbers are headings."""
    try:
        lines = [line.strip() for line in content.decode("utf-8-sig").splitlines()]
    except UnicodeDecodeError:
        raise SceneError("file", "bytes that are not text", "rows of 2 or 3 numbers [m], in UTF-8") from None
    rows: list[list[float]] = []
    for number, line in enumerate(lines, 1):
        if not line or line.startswith("#"):
            continue
        cells = line.replace(";", " ").replace(",", " ").split()
        try:
            row = [float(cell) for cell in cells]
        except ValueError:
            if rows:
                raise SceneError(f"file, line {number}", line, "2 or 3 numbers [m]") from None
            continue
        if len(row) not in (2, 3) or (rows and len(row) != len(rows[0])):
            raise SceneError(f"file, line {number}", line, "2 or 3 numbers [m], the same count in every line")
        rows.append(row)
    if not rows:
        raise SceneError("file", "no row of numbers", "rows of 2 or 3 numbers, the points [m]")
    return np.array(rows, dtype=float)


def _arrays(content: bytes) -> Floats:
    """Return the points of a NumPy file: its array `points`, `positions` or `control_points`, or its only array.

    If the array is a motion, the points are those at its end.
    """
    file = io.BytesIO(content)
    if not content.startswith(b"PK"):  # not an archive
        name, found = "points", read_array(file, "file")
    else:
        arrays = ArrayFile(file, "file", LARGEST)
        names = arrays.names
        name = next((key for key in _ARRAYS if key in names), names[0] if len(names) == 1 else "")
        if not name:
            raise SceneError("file", ", ".join(names) or "no array", "an array called points, (n, 2) or (n, 3) [m]")
        found = arrays.read(name)
    if found.ndim == 3 and len(found):  # a motion: take its end
        found = found[-1]
    if found.dtype.kind not in "fiu" or found.ndim != 2 or found.shape[1] not in (2, 3, 4):
        raise SceneError(f"file, {name}", f"{found.dtype} {found.shape}", "numbers, (n, 2) or (n, 3) [m]")
    return np.asarray(found[:, : min(found.shape[1], 3)], dtype=float)


def _along(draft: Draft, points: Floats) -> Draft:
    """Let the cable start along ordered or unordered points; it takes over their length if its own differs too much."""
    if len(points) == 2:
        return _between(draft, *points)
    try:
        fit = fit_cloud(points)
    except SceneError:
        if len(points) < LEAST:
            raise
        fit = fit_cloud(points, ordered=False)
        points = points[fit.order]
    measured = float(fit.measured_length)
    if len(points) > MOST_POINTS:
        points = fit.curve(np.linspace(0.0, float(fit.curve.knots[-1]), SAMPLES))
    return with_points(_as_long(draft, measured), points)


def _between(draft: Draft, begin: Floats, end: Floats) -> Draft:
    """Let the cable start straight between two points, (3,) [m]."""
    apart = math.dist(begin, end)
    if not MIN_LENGTH <= apart <= MAX_LENGTH:
        raise SceneError("points", f"two points {apart:g} m apart", f"a line of {MIN_LENGTH:g} to {MAX_LENGTH:g} m")
    return between(_as_long(draft, apart), begin, end)


def _as_long(draft: Draft, measured: float) -> Draft:
    """Give the cable the measured length of its points [m], unless its own length is close to that."""
    if abs(measured - draft.length) <= 0.5 * MAX_LENGTH_MISMATCH * draft.length:
        return draft
    return scaled(draft, round(measured, 6))
