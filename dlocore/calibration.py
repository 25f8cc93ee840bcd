"""The calibration of a machine: what accuracy costs in time on it, measured once and stored.

Times are those of one solve that has a core to itself. Errors are the largest distances, over the cable and the time,
to a converged march, refined until its motion no longer changes.
"""

import json
import os
from dataclasses import asdict, dataclass
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np

from dlocore.accuracy.cost import Cost, Rates, pareto_front
from dlocore.files import write_whole
from dlocore.machine import machine, user_data_dir

FORMAT = 1
FILE = "calibration.json"
_read: dict[Path, tuple[int, Cost | None]] = {}  # by file: when it was changed, and the cost in it


@dataclass(frozen=True, kw_only=True)
class Measured:
    """A method on one grid, measured over the calibration's scenes of one kind of motion.

    Attributes:
        dimensions: 2 in the plane (the paper's case, four grasps), 3 in space (a cable between two grippers).
        method: "march" or "spacetime"; "auto" of the default quality, which chooses its own grids.
        n_u, n_t: control points along the cable and in time; of "auto" the most of the scenes.
        steps: time steps of the march.
        wall_time: median time of a solve over repeats and scenes [s]; of "auto" with error estimate, else without.
        spread: median absolute deviation of the repeats [s], the largest of the scenes.
        error: largest distance to the converged motion [m], the largest of the scenes.
        iterations: iterations of the least squares, the most of the scenes; 0 for a march.
        converged: whether every scene converged.
    """

    dimensions: int
    method: str
    n_u: int
    n_t: int
    steps: int
    wall_time: float
    spread: float
    error: float
    iterations: int
    converged: bool


@dataclass(frozen=True, kw_only=True)
class Calibration:
    """What accuracy costs in time on a machine.

    Attributes:
        machine: processor, cores, system, versions.
        version: version of this package.
        source: hash of the source code that was measured.
        measured_at: when, ISO 8601 in UTC.
        duration: how long the measurement took [s].
        points: the measured points.
        cost: the model of the time of a solve.
        defaults: what the default quality takes and reaches, in the plane and in space; none of an earlier version.
    """

    machine: dict[str, str]
    version: str
    source: str
    measured_at: str
    duration: float
    points: tuple[Measured, ...]
    cost: Cost
    defaults: tuple[Measured, ...] = ()

    @property
    def current(self) -> bool:
        """Whether it was measured on this machine and with this source code."""
        return self.machine == machine() and self.source == source_mark()

    def of_dimensions(self, dimensions: int) -> tuple[Measured, ...]:
        """Return the points of motions in the plane (2) or in space (3)."""
        return tuple(p for p in self.points if p.dimensions == dimensions)

    def as_json(self) -> bytes:
        """Return it as JSON."""
        return json.dumps(to_document(self), indent=1).encode()

    def save(self, path: Path | None = None) -> Path:
        """Write it whole or not at all, by default to `default_path`, and return the path."""
        path = path or default_path()
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, self.as_json())
        return path


def front_of(points: tuple[Measured, ...]) -> list[int]:
    """Return the indices of the points that no other one beats in both time and error, fastest first."""
    return pareto_front([p.wall_time for p in points], [p.error if p.converged else np.nan for p in points])


def default_path() -> Path:
    """Return the path of this user's calibration: ``calibration.json`` in the data directory of the service."""
    given = os.environ.get("DLO_DATA_DIR")
    return (Path(given).expanduser() if given else user_data_dir()) / FILE


def load(path: Path | None = None) -> Calibration | None:
    """Return the stored calibration; None if there is none, or if its file is damaged or has another format.

    Args:
        path: its file, by default `default_path`.
    """
    try:
        return from_document(json.loads((path or default_path()).read_text()))
    except (OSError, ValueError, KeyError, TypeError):
        return None


def stored_cost(path: Path | None = None) -> Cost | None:
    """Return what solves cost on this machine, from its stored calibration; None if there is none for this machine.

    Args:
        path: its file, by default `default_path`. It is read again only after it has changed.
    """
    path = path or default_path()
    try:
        changed = path.stat().st_mtime_ns
    except OSError:
        return None
    if path not in _read or _read[path][0] != changed:
        found = load(path)
        _read[path] = changed, None if found is None or found.machine != machine() else found.cost
    return _read[path][1]


STAR = "no other one is both faster and more accurate"  # meaning of the star in the table
AUTO = "auto: the default quality on grids of its own choice, with error estimate; the others are without"


def table(calibration: Calibration) -> str:
    """Return the measured points as text; a star marks those that no other one beats in both time and error."""
    lines = [f"{'':2}{'method':10} {'n_u':>4} {'n_t':>4} {'time [ms]':>10} {'error [mm]':>11}"]
    for dimensions, title in ((2, "in the plane: the paper's case, four grasps"), (3, "in space: a hanging cable")):
        points = calibration.of_dimensions(dimensions)
        front = set(front_of(points))
        lines.append(title)
        for i, p in enumerate([*points, *(p for p in calibration.defaults if p.dimensions == dimensions)]):
            mark = "*" if i in front else ""
            times = f"{1e3 * p.wall_time:10.3g} {1e3 * p.error:11.3g}"
            lines.append(f"{mark:2}{p.method:10} {p.n_u:4} {p.n_t:4} {times}" + ("" if p.converged else "  not solved"))
    return "\n".join([*lines, f"* {STAR}", AUTO])


def to_document(calibration: Calibration) -> dict[str, Any]:
    """Return a calibration as data for JSON."""
    document = asdict(calibration)
    document["cost"]["rates"] = {str(nc): asdict(rates) for nc, rates in calibration.cost.rates.items()}
    return {"format": FORMAT, **document}


def from_document(document: dict[str, Any]) -> Calibration:
    """Return the calibration that `to_document` gave.

    Raises:
        ValueError, KeyError, TypeError: the document has another format.
    """
    if document["format"] != FORMAT:
        raise ValueError(f"format: got {document['format']!r}. Allowed: {FORMAT}.")
    cost = document["cost"]
    rates = {int(nc): Rates(**values) for nc, values in cost["rates"].items()}
    return Calibration(
        machine=document["machine"],
        version=document["version"],
        source=document["source"],
        measured_at=document["measured_at"],
        duration=document["duration"],
        points=tuple(Measured(**point) for point in document["points"]),
        cost=Cost(**(cost | {"rates": rates})),
        defaults=tuple(Measured(**point) for point in document.get("defaults", ())),
    )


def source_mark() -> str:
    """Return 12 hexadecimal digits, a hash of this package's source: a calibration is valid for one source only."""
    digest = sha256()
    root = Path(__file__).parent
    for file in sorted(root.rglob("*.py")):
        if "study" not in file.relative_to(root).parts:
            digest.update(file.read_bytes())
    return digest.hexdigest()[:12]
