"""The predicted motion on its own timeline: cable, grasps, obstacles, forces of grippers and contacts, energies."""

from typing import TYPE_CHECKING, Any

import numpy as np

from app.archive import Run
from app.instants import instants
from app.recording.obstacles import obstacle_chunks
from app.recording.style import (
    BLUE,
    EFFECTS,
    ENERGIES,
    GREY,
    ORANGE,
    PURPLE,
    SAMPLES_U,
    SKY,
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
from dlocore import energies

if TYPE_CHECKING:
    from rerun.chunk import Chunk

_LARGEST_ARROW = 0.25  # of the cable's length
_GRASPS = (VERMILION, PURPLE, BLUE, SKY, ORANGE)  # colours of the lines of their forces
_BOUND = 0.8  # width of the lines of the bounds of a force


def motion_chunks(run: Run) -> "list[Chunk]":
    """Return everything on the timeline `motion`, and the trace of the motion, which shows at every time."""
    import rerun as rr

    surface = run.document["surface"]
    positions = np.array(surface["positions"], dtype=float)  # (k_t, k_u, 3)
    if not drawable(positions):
        return []
    times = [rr.TimeColumn("motion", duration=surface["t"])]
    thick = 0.006 * run.surface.length
    cable = rr.LineStrips3D.columns(colors=[BLUE], radii=[thick])
    shown = instants(run.surface, STRIPS)
    shapes = list(run.surface.positions(np.linspace(0.0, run.surface.length, SAMPLES_U), shown))
    colours = time_ramp(shown / run.surface.horizon)
    trace = rr.LineStrips3D.columns(strips=shapes, colors=colours, radii=[0.4 * thick] * STRIPS)
    chunks = [
        chunk("/motion/trace/cable", [], trace.partition([STRIPS])),
        chunk("/motion/cable", times, rr.LineStrips3D.columns(strips=positions)),
        chunk("/motion/cable", [], cable),
    ]
    chunks += obstacle_chunks(run.scene.environment.obstacles, "/motion/obstacles")
    for k in range(len(run.document["grasps"])):
        chunks += _grasp(run, k, shown, thick)
    for k in range(len(run.document.get("contacts", []))):
        chunks += _contact(run, k)
    chunks += _masses(run, times, thick)
    for name, values in energies(run.scene, run.surface, surface["t"], run.material, run.stretch).items():
        entity = f"/over_time/energy/{name}"
        chunks += [line_style(entity, f"{name} [J]", ENERGIES.get(name, GREY)), scalars(entity, times, values)]
    return chunks


def _grasp(run: Run, k: int, shown: Floats, thick: float) -> "list[Chunk]":
    """Return a grasp and the force of its gripper over time, with error bounds, and arrows at times `shown` [s]."""
    import rerun as rr

    grasp, t = run.document["grasps"][k], run.document["surface"]["t"]
    times = [rr.TimeColumn("motion", duration=t)]
    held = run.surface.positions([grasp["u"]], t)[:, 0]  # (k_t, 3)
    forces = np.array(grasp["reaction"], dtype=float)
    vectors = forces * arrow_scale(run)
    path = rr.LineStrips3D.columns(strips=[held], colors=[ORANGE], radii=[0.4 * thick])
    along = rr.Arrows3D.columns(
        origins=run.surface.positions([grasp["u"]], shown)[:, 0],
        vectors=np.column_stack([np.interp(shown, t, vectors[:, axis]) for axis in range(3)]),
        colors=[VERMILION] * STRIPS,
        radii=[0.3 * thick] * STRIPS,
    )
    name = f"grasp at u = {grasp['u']:g} m"
    look = rr.Points3D.columns(colors=[ORANGE], radii=[2.5 * thick], labels=[name], show_labels=[False])
    return [
        chunk(f"/motion/trace/grasps/{k}", [], path),
        chunk(f"/motion/trace/reactions/{k}", [], along.partition([STRIPS])),
        chunk(f"/motion/grasps/{k}", times, rr.Points3D.columns(positions=held)),
        chunk(f"/motion/grasps/{k}", [], look),
        chunk(f"/motion/reactions/{k}", times, rr.Arrows3D.columns(origins=held, vectors=vectors)),
        chunk(f"/motion/reactions/{k}", [], rr.Arrows3D.columns(colors=[VERMILION], radii=[thick])),
        *_with_bounds(
            f"/over_time/reaction/{k}", name, _GRASPS[k % len(_GRASPS)], times, forces, grasp.get("reaction_error")
        ),
    ]


def _masses(run: Run, times: list[Any], thick: float) -> "list[Chunk]":
    """Return the point masses over time."""
    import rerun as rr

    masses = run.scene.cable.point_masses
    if not masses:
        return []
    at = run.surface.positions([one.u for one in masses], run.document["surface"]["t"])  # (k_t, masses, 3)
    names = [f"{one.mass:g} kg at u = {one.u:g} m" for one in masses]
    place = rr.Points3D.columns(positions=at.reshape(-1, 3)).partition([len(masses)] * len(at))
    look = rr.Points3D.columns(colors=[GREY] * len(masses), radii=[2.0 * thick] * len(masses), labels=names)
    return [
        chunk("/motion/point_masses", times, place),
        chunk("/motion/point_masses", [], look.partition([len(masses)])),
        chunk("/motion/point_masses", [], rr.Points3D.columns(show_labels=[False])),
    ]


def _contact(run: Run, k: int) -> "list[Chunk]":
    """Return the normal force and the friction of the table or an obstacle over time, with error bounds."""
    import rerun as rr

    contact, t = run.document["contacts"][k], run.document["surface"]["t"]
    times = [rr.TimeColumn("motion", duration=t)]
    entity = f"/over_time/reaction/contact_{k}"
    chunks = _with_bounds(entity, contact["name"], GREY, times, contact["force"], contact["force_error"])
    if np.any(contact.get("friction")):  # missing in runs that were stored by older versions
        name, error = f"friction of {contact['name']}", contact["friction_error"]
        chunks += _with_bounds(f"{entity}_friction", name, EFFECTS["friction"], times, contact["friction"], error)
    return chunks


def _with_bounds(entity: str, name: str, colour: Colour, times: list[Any], force: Any, errors: Any) -> "list[Chunk]":
    """Return the line of the magnitude of a force [N], and those of its bounds if its error is known."""
    sizes = np.linalg.norm(np.array(force, dtype=float), axis=1)
    chunks = [line_style(entity, f"{name} [N]", colour), scalars(entity, times, sizes)]
    if errors is None:
        return chunks
    for bound, values in (("least", np.maximum(sizes - errors, 0.0)), ("most", sizes + errors)):
        chunks.append(line_style(f"{entity}/{bound}", f"at {bound} [N]", colour, width=_BOUND))
        chunks.append(scalars(f"{entity}/{bound}", times, values))
    return chunks


def arrow_scale(run: Run) -> float:
    """Return the length of an arrow for 1 N [m/N]; the largest force gets a quarter of the cable's length."""
    forces = [np.linalg.norm(grasp["reaction"], axis=1).max() for grasp in run.document["grasps"]]
    largest = max(forces, default=0.0)
    return float(_LARGEST_ARROW * run.surface.length / largest) if largest > 0 else 1.0
