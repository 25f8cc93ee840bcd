"""The predicted motion on its own timeline: cable, grasps, obstacles, the forces of the grippers, the energies."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from app.archive import Run
from app.recording.obstacles import obstacle_chunks
from app.recording.style import (
    BLUE,
    ENERGIES,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    STRIPS,
    VERMILION,
    chunk,
    drawable,
    line_style,
    scalars,
    time_ramp,
)
from dlocore import energies

if TYPE_CHECKING:
    from rerun.chunk import Chunk

_LARGEST_ARROW = 0.25  # of the cable's length
_GRASPS = (VERMILION, PURPLE, BLUE, SKY, ORANGE)  # of the lines of their forces


def motion_chunks(run: Run) -> "list[Chunk]":
    """Return everything on the timeline `motion`, with the trace of the motion that stays whatever the time."""
    import rerun as rr

    surface = run.document["surface"]
    positions = np.array(surface["positions"], dtype=float)  # (k_t, k_u, 3)
    if not drawable(positions):
        return []
    times = [rr.TimeColumn("motion", duration=surface["t"])]
    thick = 0.006 * run.surface.length
    cable = rr.LineStrips3D.columns(colors=[BLUE], radii=[thick])
    shown = np.linspace(0, len(positions) - 1, STRIPS).astype(int)
    trace = rr.LineStrips3D.columns(strips=positions[shown], colors=time_ramp(), radii=[0.4 * thick] * STRIPS)
    chunks = [
        chunk("/motion/trace/cable", [], trace.partition([STRIPS])),
        chunk("/motion/cable", times, rr.LineStrips3D.columns(strips=positions)),
        chunk("/motion/cable", [], cable),
    ]
    chunks += obstacle_chunks(run.scene.environment.obstacles, "/motion/obstacles")
    for k in range(len(run.document["grasps"])):
        chunks += _grasp(run, k, shown, thick)
    for name, values in energies(run.scene, run.surface, surface["t"], run.material).items():
        entity = f"/over_time/energy/{name}"
        chunks += [line_style(entity, f"{name} [J]", ENERGIES.get(name, GREY)), scalars(entity, times, values)]
    return chunks


def _grasp(run: Run, k: int, shown: NDArray[np.intp], thick: float) -> "list[Chunk]":
    """Return a grasp and the force of its gripper: where and how large at every time, and all along the motion."""
    import rerun as rr

    grasp, t = run.document["grasps"][k], run.document["surface"]["t"]
    times = [rr.TimeColumn("motion", duration=t)]
    held = run.surface.positions([grasp["u"]], t)[:, 0]  # (k_t, 3)
    forces = np.array(grasp["reaction"], dtype=float)
    vectors = forces * arrow_scale(run)
    path = rr.LineStrips3D.columns(strips=[held], colors=[ORANGE], radii=[0.4 * thick])
    along = rr.Arrows3D.columns(
        origins=held[shown], vectors=vectors[shown], colors=[VERMILION] * STRIPS, radii=[0.3 * thick] * STRIPS
    )
    name = f"grasp at u = {grasp['u']:g} m"
    look = rr.Points3D.columns(colors=[ORANGE], radii=[2.5 * thick], labels=[name], show_labels=[False])
    entity = f"/over_time/reaction/{k}"
    return [
        chunk(f"/motion/trace/grasps/{k}", [], path),
        chunk(f"/motion/trace/reactions/{k}", [], along.partition([STRIPS])),
        chunk(f"/motion/grasps/{k}", times, rr.Points3D.columns(positions=held)),
        chunk(f"/motion/grasps/{k}", [], look),
        chunk(f"/motion/reactions/{k}", times, rr.Arrows3D.columns(origins=held, vectors=vectors)),
        chunk(f"/motion/reactions/{k}", [], rr.Arrows3D.columns(colors=[VERMILION], radii=[thick])),
        line_style(entity, f"{name} [N]", _GRASPS[k % len(_GRASPS)]),
        scalars(entity, times, np.linalg.norm(forces, axis=1)),
    ]


def arrow_scale(run: Run) -> float:
    """Return the length of an arrow for 1 N [m/N]: the largest force gets a quarter of the cable's length."""
    forces = [np.linalg.norm(grasp["reaction"], axis=1).max() for grasp in run.document["grasps"]]
    largest = max(forces, default=0.0)
    return float(_LARGEST_ARROW * run.surface.length / largest) if largest > 0 else 1.0
