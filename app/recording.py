"""A run as a rerun recording: how the solve went by iteration, and the motion it found.

Timelines: `iteration` and `solver_time` for the solve, `motion` [s] for the predicted motion. Recordings are written
from chunks: a `RecordingStream` would keep two threads each for ever.
"""

import json
import platform
import tempfile
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from app.archive import Run

if TYPE_CHECKING:
    from rerun.chunk import Chunk

Floats = NDArray[np.float64]
APPLICATION = "dlo"
STRIPS = 9  # times at which an iterate is drawn
SAMPLES_U = 65
MAX_SCENE_TEXT = 20_000
MAX_COORDINATE = 1e6  # m; an iterate beyond it has diverged and isn't drawn

# Okabe-Ito
BLUE, ORANGE, GREEN, VERMILION, PURPLE, SKY = (
    (0, 114, 178),
    (230, 159, 0),
    (0, 158, 115),
    (213, 94, 0),
    (204, 121, 167),
    (86, 180, 233),
)
GREY = (150, 150, 150)
# field of an iteration: entity, name, colour; log10 where the entity is below /convergence
SERIES = {
    "update": ("/convergence/update", "log10 update [m]", BLUE),
    "residual": ("/convergence/residual", "log10 residual", VERMILION),
    "energy": ("/energy/elastic", "elastic energy [J]", GREEN),
    "damping": ("/step/damping", "damping", PURPLE),
    "step_length": ("/step/length", "step length", ORANGE),
}


def write_recording(run: Run, path: Path) -> None:
    """Write the recording of `run` to `path` (.rrd)."""
    import rerun as rr

    chunks = [_axes(), *_convergence(run), *_iterates(run), *_motion(run), _report(run)]
    stream = rr.chunk.LazyChunkStream.from_iter(chunks)
    stream.write_rrd(path, application_id=APPLICATION, recording_id=run.document["id"])


def _axes() -> "Chunk":
    import rerun as rr

    axes = rr.components.ViewCoordinates.RIGHT_HAND_Z_UP
    return rr.chunk.Chunk.from_columns("/", indexes=[], columns=rr.ViewCoordinates.columns(xyz=[axes]))


def _convergence(run: Run) -> "list[Chunk]":
    """Return the scalars of the solve; log10 for norms. Where a value can't be drawn there is no row."""
    chunks = []
    for field, (entity, name, color) in SERIES.items():
        values = np.array([getattr(iteration, field) for iteration in run.iterations], dtype=float)
        if entity.startswith("/convergence"):
            values = np.log10(values, out=np.full(len(values), np.nan), where=values > 0)
        drawn = np.flatnonzero(np.isfinite(values))
        chunks.append(_styled(entity, name, color))
        if len(drawn):
            chunks.append(_scalars(entity, run, drawn, values[drawn]))
    return chunks


def _styled(entity: str, name: str, color: tuple[int, int, int]) -> "Chunk":
    import rerun as rr

    style = rr.SeriesLines.columns(names=[name], colors=[color], widths=[2.0])
    return rr.chunk.Chunk.from_columns(entity, indexes=[], columns=style)


def _scalars(entity: str, run: Run, drawn: NDArray[np.intp], values: Floats) -> "Chunk":
    import rerun as rr

    return rr.chunk.Chunk.from_columns(entity, indexes=_indexes(run, drawn), columns=rr.Scalars.columns(scalars=values))


def _indexes(run: Run, drawn: NDArray[np.intp]) -> list[Any]:
    import rerun as rr

    numbers = [run.iterations[k].number for k in drawn]
    times = [run.iterations[k].wall_time for k in drawn]
    return [rr.TimeColumn("iteration", sequence=numbers), rr.TimeColumn("solver_time", duration=times)]


def _iterates(run: Run) -> "list[Chunk]":
    """Return the shape of every iterate at several times, and its net of control points."""
    import rerun as rr

    finite = [np.abs(iteration.surface.control_points).max() < MAX_COORDINATE for iteration in run.iterations]
    drawn = np.flatnonzero(finite)
    if not len(drawn):
        return []
    surfaces = [run.iterations[k].surface for k in drawn]
    shapes = np.concatenate([surface.sample(SAMPLES_U, STRIPS)[2][..., :3] for surface in surfaces])
    nets = [surface.control_points[..., :3].reshape(-1, 3) for surface in surfaces]
    indexes = _indexes(run, drawn)
    chunk = rr.chunk.Chunk.from_columns
    strips = rr.LineStrips3D.columns(strips=shapes).partition([STRIPS] * len(drawn))
    points = rr.Points3D.columns(positions=np.concatenate(nets)).partition([len(net) for net in nets])
    colors = np.linspace(SKY, BLUE, STRIPS).astype(np.uint8)  # light at the start of the motion, dark at its end
    thin = _length(run) * 0.003
    style = rr.LineStrips3D.columns(colors=colors, radii=[thin] * STRIPS).partition([STRIPS])
    dots = rr.Points3D.columns(colors=[ORANGE], radii=[2 * thin])
    return [
        chunk("/iterate/shape", indexes=indexes, columns=strips),
        chunk("/iterate/shape", indexes=[], columns=style),
        chunk("/iterate/net", indexes=indexes, columns=points),
        chunk("/iterate/net", indexes=[], columns=dots),
    ]


def _motion(run: Run) -> "list[Chunk]":
    """Return the predicted motion: the cable, its grasps, and the forces of the grippers as arrows."""
    import rerun as rr

    surface, grasps = run.document["surface"], run.document["grasps"]
    positions = np.array(surface["positions"], dtype=float)  # (k_t, k_u, 3)
    if not np.abs(positions).max() < MAX_COORDINATE:  # a diverged solve has no motion to show
        return []
    times = [rr.TimeColumn("motion", duration=surface["t"])]
    chunk, thick = rr.chunk.Chunk.from_columns, _length(run) * 0.004
    style = rr.LineStrips3D.columns(colors=[BLUE], radii=[thick])
    trace = positions[np.linspace(0, len(positions) - 1, STRIPS).astype(int)]  # whatever the time, as a backdrop
    backdrop = rr.LineStrips3D.columns(strips=trace, colors=[GREY] * STRIPS, radii=[0.3 * thick] * STRIPS)
    chunks = [
        chunk("/motion/trace", indexes=[], columns=backdrop.partition([STRIPS])),
        chunk("/motion/cable", indexes=times, columns=rr.LineStrips3D.columns(strips=positions)),
        chunk("/motion/cable", indexes=[], columns=style),
    ]
    for k, grasp in enumerate(grasps):
        held = run.surface.positions([grasp["u"]], surface["t"])[:, 0]  # (k_t, 3)
        forces = np.array(grasp["reaction"], dtype=float)
        arrows = rr.Arrows3D.columns(origins=held, vectors=forces * _arrow_scale(run))
        points = rr.Points3D.columns(positions=held)
        look = rr.Points3D.columns(colors=[ORANGE], radii=[2.5 * thick], labels=[f"u = {grasp['u']:g} m"])
        chunks += [
            chunk(f"/motion/grasps/{k}", indexes=times, columns=points),
            chunk(f"/motion/grasps/{k}", indexes=[], columns=look),
            chunk(f"/motion/reactions/{k}", indexes=times, columns=arrows),
            chunk(f"/motion/reactions/{k}", indexes=[], columns=rr.Arrows3D.columns(colors=[VERMILION], radii=[thick])),
        ]
    return chunks


def _length(run: Run) -> float:
    return run.surface.length


def _arrow_scale(run: Run) -> float:
    """Return the length of an arrow for 1 N [m/N]: the largest force gets a quarter of the cable's length."""
    forces = [np.linalg.norm(grasp["reaction"], axis=1).max() for grasp in run.document["grasps"]]
    largest = max(forces, default=0.0)
    return 0.25 * _length(run) / largest if largest > 0 else 1.0


def _report(run: Run) -> "Chunk":
    import rerun as rr

    text = rr.TextDocument.columns(text=[report(run)], media_type=["text/markdown"])
    return rr.chunk.Chunk.from_columns("/report", indexes=[], columns=text)


def report(run: Run) -> str:
    """Return the scene, the settings, the status and the machine as markdown."""
    document, accuracy = run.document, run.document["accuracy"]
    error = accuracy["error_estimate"]
    effects = [_row(effect) for effect in document["effects"]]
    return "\n".join(
        [
            f"# {document['status']}",
            document["message"],
            "",
            f"- method: {accuracy['method']}, {accuracy['n_u']} x {accuracy['n_t']} control points, "
            f"{accuracy['dimensions']}D",
            f"- estimated error: {'unknown' if error is None else f'{1e3 * error:.3g} mm'}",
            f"- solve time: {1e3 * accuracy['wall_time']:.3g} ms",
            f"- start shape: {document['start']['elastic_energy']:.3g} J elastic energy, "
            f"{1e3 * document['start']['fit_error']:.3g} mm rms from the given points",
            f"- arrows: {_arrow_scale(run):.3g} m for 1 N",
            f"- machine: {platform.machine()}, {platform.system()}, Python {platform.python_version()}",
            f"- run: {document['id'] or 'not stored'}, {document['created']}",
            "",
            "## Effects",
            "| effect | active | why | magnitude |",
            "|---|---|---|---|",
            *effects,
            "",
            "## Scene",
            "```json",
            _cut(json.dumps(run.request)),
            "```",
        ]
    )


def _cut(text: str) -> str:
    return text if len(text) <= MAX_SCENE_TEXT else f"{text[:MAX_SCENE_TEXT]} ... ({len(text)} characters)"


def _cell(text: str) -> str:
    return text.replace("|", "/").replace("\n", " ")


def _row(effect: dict[str, Any]) -> str:
    active = "yes" if effect["active"] else "no"
    return f"| {effect['name']} | {active} | {_cell(effect['reason'])} | {_magnitude(effect)} |"


def _magnitude(effect: dict[str, Any]) -> str:
    return "" if effect["magnitude"] is None else f"{effect['magnitude']:.3g} {effect['unit']}"


@cache
def layout() -> bytes:
    """Return the layout of the viewer for these recordings, as the bytes of an .rbl file."""
    import rerun.blueprint as rrb

    blueprint = rrb.Blueprint(
        rrb.Horizontal(
            rrb.Vertical(
                rrb.Spatial3DView(origin="/iterate", name="Iterates (timeline: iteration)"),
                rrb.Spatial3DView(origin="/motion", name="Motion (timeline: motion)"),
            ),
            rrb.Vertical(
                rrb.TimeSeriesView(origin="/convergence", name="Update and residual, log10"),
                rrb.Tabs(
                    rrb.TimeSeriesView(origin="/energy", name="Energy"),
                    rrb.TimeSeriesView(origin="/step", name="Damping and step length"),
                ),
                rrb.TextDocumentView(origin="/report", name="Report"),
                row_shares=[3, 2, 3],
            ),
            column_shares=[3, 2],
        ),
        rrb.TimePanel(timeline="iteration", state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
    )
    with tempfile.TemporaryDirectory() as directory:
        path = Path(directory) / "layout.rbl"
        blueprint.save(APPLICATION, path)
        return path.read_bytes()
