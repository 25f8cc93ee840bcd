"""The solve by iteration: the iterates with their norms, steps, energies and forces."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from app.archive import Run
from app.instants import instants
from app.recording.obstacles import obstacle_chunks
from app.recording.style import (
    BLUE,
    EFFECTS,
    ENERGIES,
    FORCE_TIMES,
    GREY,
    ORANGE,
    PURPLE,
    SAMPLES_U,
    STRIPS,
    VERMILION,
    Colour,
    Floats,
    chunk,
    drawable,
    line_style,
    scalars,
    time_ramp,
)
from dlocore import Iteration, effect_forces, energies

if TYPE_CHECKING:
    from rerun.chunk import Chunk


_SAME_ENERGY = 0.01  # a memory is taken as that of an iterate if it gives its elastic energy within this share


@dataclass(frozen=True)
class Line:
    """A quantity over the iterations; values that are not finite are left out."""

    entity: str
    name: str
    colour: Colour
    values: Floats


def solve_chunks(run: Run) -> "list[Chunk]":
    """Return everything on the timelines `iteration` and `solver_time`."""
    drawn = np.array([k for k, i in enumerate(run.iterations) if drawable(i.surface.control_points)], dtype=int)
    chunks = []
    for line in [*_records(run), *_balances(run, drawn)]:
        kept = np.flatnonzero(np.isfinite(line.values))
        chunks.append(line_style(line.entity, line.name, line.colour))
        if len(kept):
            chunks.append(scalars(line.entity, _indexes(run, kept), line.values[kept]))
    if len(drawn):
        chunks += _iterates(run, drawn)
    if run.iterations:
        chunks.append(_log(run))
    return chunks


def _indexes(run: Run, rows: NDArray[np.intp]) -> list[Any]:
    import rerun as rr

    numbers = [run.iterations[k].number for k in rows]
    times = [run.iterations[k].wall_time for k in rows]
    return [rr.TimeColumn("iteration", sequence=numbers), rr.TimeColumn("solver_time", duration=times)]


def _records(run: Run) -> list[Line]:
    """Return the quantities that every iteration records, norms as log10."""

    def of(field: str) -> Floats:
        return np.array([getattr(iteration, field) for iteration in run.iterations], dtype=float)

    return [
        Line("/convergence/update", "log10 update [m]", BLUE, _log10(of("update"))),
        Line("/convergence/residual", "log10 residual", VERMILION, _log10(of("residual"))),
        Line("/energy/elastic", "elastic [J]", PURPLE, of("energy")),
        Line("/step/damping", "damping", PURPLE, of("damping")),
        Line("/step/length", "step length", ORANGE, of("step_length")),
    ]


def _log10(values: Floats) -> Floats:
    return np.log10(values, out=np.full(len(values), np.nan), where=values > 0)


def _balances(run: Run, drawn: NDArray[np.intp]) -> list[Line]:
    """Return the energies at the end of the motion, and the log10 of the forces by effect, of every iterate.

    For a cable that yields, only the memory of the answer is known. Iterates with another memory are left out, unless
    they have none.
    """
    kept: dict[str, Floats] = {}
    for k in drawn:
        surface = run.iterations[k].surface
        memories = [run.material] if run.material is None else [run.material, None]
        for material in memories:
            terms = energies(run.scene, surface, [0.0, surface.horizon], material)
            if run.material is None or _adds_up(terms, run.iterations[k].energy):
                break
        else:
            continue
        forces = effect_forces(run.scene, surface, np.linspace(0.0, surface.horizon, FORCE_TIMES), material)
        values = {f"/forces/{name}": force for name, force in forces.items()}
        values |= {f"/energy/{name}": float(energy[-1]) for name, energy in terms.items()}
        for entity, value in values.items():
            kept.setdefault(entity, np.full(len(run.iterations), np.nan))[k] = value
    lines = []
    for entity, over in kept.items():
        kind, name = entity[1:].split("/")
        if kind == "forces":
            lines.append(Line(entity, f"log10 {name} [N]", EFFECTS.get(name, GREY), _log10(over)))
        else:
            lines.append(Line(entity, f"{name} [J]", ENERGIES.get(name, GREY), over))
    return lines


def _adds_up(terms: dict[str, Floats], elastic: float) -> bool:
    return abs(sum(terms[name][-1] for name in ("stretch", "bend", "twist")) - elastic) <= _SAME_ENERGY * elastic


def _iterates(run: Run, drawn: NDArray[np.intp]) -> "list[Chunk]":
    """Return the shape of every iterate at the instants of the answer, and its net of control points."""
    import rerun as rr

    surfaces = [run.iterations[k].surface for k in drawn]
    u, t = np.linspace(0.0, run.surface.length, SAMPLES_U), instants(run.surface, STRIPS)
    shapes = np.concatenate([surface.positions(u, t) for surface in surfaces])
    points = [surface.control_points[..., :3].reshape(-1, 3) for surface in surfaces]
    rows = [row for surface in surfaces for row in _net(surface.control_points[..., :3])]
    counts = [sum(surface.control_points.shape[:2]) for surface in surfaces]
    indexes = _indexes(run, drawn)
    thin = 0.004 * run.surface.length
    strips = rr.LineStrips3D.columns(strips=shapes).partition([STRIPS] * len(drawn))
    colours = time_ramp(t / run.surface.horizon)
    style = rr.LineStrips3D.columns(colors=colours, radii=[thin] * STRIPS).partition([STRIPS])
    dots = rr.Points3D.columns(positions=np.concatenate(points)).partition([len(net) for net in points])
    return [
        *obstacle_chunks(run.scene.environment.obstacles, "/iterate/obstacles"),
        chunk("/iterate/shape", indexes, strips),
        chunk("/iterate/shape", [], style),
        chunk("/iterate/net", indexes, dots),
        chunk("/iterate/net", [], rr.Points3D.columns(colors=[ORANGE], radii=[1.5 * thin])),
        chunk("/iterate/net/lines", indexes, rr.LineStrips3D.columns(strips=rows).partition(counts)),
        chunk("/iterate/net/lines", [], rr.LineStrips3D.columns(colors=[(*ORANGE, 70)], radii=[0.3 * thin])),
    ]


def _net(control: Floats) -> list[Floats]:
    """Return the lines of a net (n_t, n_u, 3): along the cable, then over time."""
    return [*control, *control.transpose(1, 0, 2)]


def _log(run: Run) -> "Chunk":
    """Return one line of text for every iteration."""
    import rerun as rr

    rows = np.arange(len(run.iterations))
    lines = [_words(iteration) for iteration in run.iterations]
    return chunk("/log", _indexes(run, rows), rr.TextLog.columns(text=lines, level=["INFO"] * len(lines)))


def _words(iteration: Iteration) -> str:
    update = f"update {iteration.update:.3g} m, " if math.isfinite(iteration.update) else ""
    grid = f"{iteration.n_u} x {iteration.n_t}"
    step = f"damping {iteration.damping:.2g}, step length {iteration.step_length:.2g}"
    note = f" ({iteration.note})" if iteration.note else ""
    return f"{update}residual {iteration.residual:.3g}, {step}, {grid}{note}"
