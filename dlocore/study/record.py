"""The results of a study, as frozen data and as JSON."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from types import NoneType
from typing import Any, Literal, TypeVar

from dlocore.errors import DloError

FORMAT = 1
_BESIDE = ("format", "id", "state", "created")  # what a document has in addition to the fields of `Study`
Part = Literal["runs", "scaling", "effects"]
PARTS: tuple[Part, ...] = ("runs", "scaling", "effects")


@dataclass(frozen=True, kw_only=True)
class Step:
    """One iteration of a solve: norm of the update [m] (None: not finite), residual, time since the start [s]."""

    update: float | None
    residual: float | None
    wall_time: float


@dataclass(frozen=True, kw_only=True)
class Run:
    """One scene solved by one method on one grid, repeatedly.

    Attributes:
        scene: its name.
        effects: name of the set of effects.
        method: how it was solved.
        n_u, n_t: control points along the cable and in time.
        delta: threshold on the update [m].
        dimensions: of the motion.
        steps: time steps of the march.
        status: of the prediction.
        wall_time: of one solve on a core of its own, the median of the repeats [s].
        spread: median absolute deviation of the repeats [s].
        repeats: timed calls.
        error: largest distance to the truth over cable and time [m].
        rms: root mean square distance [m].
        truth_error: approximate error of the truth itself [m]; None if unknown.
        estimate: the error that the prediction states [m].
        iterations: the course of the solve.
        phases: time by phase [s].
        active: the effects that were simulated.
    """

    scene: str
    effects: str
    method: str
    n_u: int
    n_t: int
    delta: float
    dimensions: int
    steps: int
    status: str
    wall_time: float
    spread: float
    repeats: int
    error: float
    rms: float
    truth_error: float | None
    estimate: float | None
    iterations: tuple[Step, ...]
    phases: Mapping[str, float]
    active: tuple[str, ...]

    @property
    def key(self) -> tuple[str, str, str, int, int, float]:
        """What distinguishes it from the other runs of a study."""
        return self.scene, self.effects, self.method, self.n_u, self.n_t, self.delta


@dataclass(frozen=True, kw_only=True)
class Scaled:
    """The time of a solve at one value of the quantity against which its cost is measured.

    Attributes:
        variable: "n_u", "n_u in space", "n_t", "horizon" or "grasps".
        value: its value; the horizon in s.
        method: how it was solved.
        wall_time: the median of the repeats; of a single iteration if the method iterates [s].
        spread: median absolute deviation of the repeats [s].
    """

    variable: str
    value: float
    method: str
    wall_time: float
    spread: float


@dataclass(frozen=True, kw_only=True)
class EffectCost:
    """The time of a march with an effect and without it, on a scene that has it [s]."""

    effect: str
    present: float
    absent: float


@dataclass(frozen=True, kw_only=True)
class Study:
    """The results of a study.

    Attributes:
        machine: processor, cores, system, versions.
        source: an identifier of the program text that was measured.
        measured_at: when, ISO 8601 in UTC.
        duration: how long it took [s].
        judge: the truth that errors refer to.
        runs: scenes over grids, thresholds, methods and sets of effects.
        refused: what could not be measured, and why: runs that the solver refuses, and times lost in noise.
        scaling: cost against the size of a problem.
        effects: cost by effect.
    """

    machine: Mapping[str, str]
    source: str
    measured_at: str
    duration: float
    judge: str
    runs: tuple[Run, ...]
    refused: tuple[str, ...] = ()
    scaling: tuple[Scaled, ...] = ()
    effects: tuple[EffectCost, ...] = ()


class StudyError(DloError, ValueError):
    """A file is not a study."""


def to_document(study: Study) -> dict[str, Any]:
    """Return a study as data for JSON."""
    return {"format": FORMAT, **asdict(study)}


def from_document(document: Any) -> Study:
    """Return the study from a document of `to_document`.

    Raises:
        StudyError: it is not a study, or has another format.
    """
    if not isinstance(document, dict) or "format" not in document:
        raise StudyError("This is not a study as written by `dlo study -o`.")
    try:
        if document["format"] != FORMAT:
            raise StudyError(f"format: got {document['format']!r}. Allowed: {FORMAT}.")
        parts = {name: value for name, value in document.items() if name not in _BESIDE}
        parts["runs"] = tuple(_run(run) for run in parts["runs"])
        parts["refused"] = tuple(parts["refused"])
        parts["scaling"] = tuple(_plain(Scaled, row) for row in parts["scaling"])
        parts["effects"] = tuple(_plain(EffectCost, row) for row in parts["effects"])
        parts["machine"] = dict(parts["machine"])
        return _plain(Study, parts)
    except StudyError:
        raise
    except KeyError as error:
        raise StudyError(f"This is not a study: {error} is missing.") from None
    except (TypeError, ValueError, AttributeError) as error:
        raise StudyError(f"This is not a study: {error}.") from None


def _run(values: dict[str, Any]) -> Run:
    steps = tuple(_plain(Step, step) for step in values["iterations"])
    run = _plain(Run, {**values, "iterations": steps, "active": tuple(values["active"])})
    if not run.wall_time > 0.0:
        raise StudyError(f"wall_time: got {run.wall_time!r}. Allowed: a time above zero [s].")
    for name, unit in (("spread", "s"), ("error", "m"), ("rms", "m"), ("truth_error", "m"), ("estimate", "m")):
        value = getattr(run, name)
        if value is not None and value < 0.0:
            raise StudyError(f"{name}: got {value!r}. Allowed: zero or more [{unit}].")
    return run


_KINDS: Mapping[Any, tuple[str, tuple[type, ...]]] = {
    str: ("a text", (str,)),
    int: ("a whole number", (int,)),
    float: ("a number", (int, float)),
    float | None: ("a number or null", (int, float, NoneType)),
}
_Row = TypeVar("_Row", Step, Run, Scaled, EffectCost, Study)


def _plain(kind: type[_Row], values: Mapping[str, Any]) -> _Row:
    """Return a row of a study; its fields must have their types."""
    row = kind(**values)
    for part in fields(kind):
        if part.type not in _KINDS:
            continue
        value, (words, allowed) = getattr(row, part.name), _KINDS[part.type]
        if not isinstance(value, allowed) or isinstance(value, bool):
            raise StudyError(f"{part.name}: got {value!r}. Allowed: {words}.")
    return row


def as_json(study: Study) -> bytes:
    """Return a study as JSON."""
    return json.dumps(to_document(study), indent=1).encode()


def load(path: Path) -> Study:
    """Read a study.

    Raises:
        OSError: the file can't be read.
        StudyError: it is not a study.
    """
    try:
        return from_document(json.loads(path.read_text()))
    except (json.JSONDecodeError, UnicodeDecodeError, RecursionError) as error:
        raise StudyError(f"This is not JSON: {error}.") from None
