"""Translate the solver's messages into the panel's words: its labels for fields, its names for grippers."""

import re
from collections.abc import Sequence

from dlocore.errors import MILLIMETRES

LABELS = {  # the panel's labels by field of a scene's document; [] stands for any index
    "cable.preset": "Preset",
    "cable.length": "Length [m]",
    "cable.diameter": "Diameter [mm]",
    "cable.linear_density": "Density [g/m]",
    "cable.bending_stiffness": "EI [10⁻³ N m²]",
    "cable.torsional_stiffness": "GJ [10⁻³ N m²]",
    "cable.axial_stiffness": "EA [N]",
    "cable.bending_damping": "Damping [10⁻³ N m² s]",
    "cable.torsional_damping": "Twist damping [10⁻³ N m² s]",
    "cable.axial_damping": "Stretch damping [N s]",
    "cable.yield_strain": "Yields at strain [%]",
    "cable.memory_rate": "Memory rate [1/s]",
    "cable.rest_shape": "Stress-free shape",
    "cable.point_masses[].mass": "Connector [g]",
    "cable.point_masses[].u": "Placed at u [m]",
    "shape.settle": "Let it settle first",
    "primitives[].u": "Grasp u [m]",
    "primitives[].hold": "Holds",
    "primitives[].grasp_time": "Closes at [s]",
    "primitives[].release_time": "Opens at [s]",
    "primitives[].path.displacement": "Target [m]",
    "primitives[].path.rotation": "Turn [°]",
    "primitives[].path.duration": "Duration [s]",
    "primitives[].path.profile": "Speed profile",
    "horizon": "Predict until [s]",
    "loads[].u": "Acts at u [m]",
    "loads[].force": "Force [N]",
    "loads[].force.times": "Until [s]",
    "environment.gravity": "Gravity [m/s²]",
    "environment.drag": "Drag [N s/m²]",
    "environment.drag_quadratic": "Drag [N s²/m³]",
    "environment.table.height": "Table height [m]",
    "environment.table.friction": "Table friction",
    "environment.obstacles[].center": "Centre [m]",
    "environment.obstacles[].radius": "Radius [mm]",
    "environment.obstacles[].size": "Size [mm]",
    "environment.obstacles[].height": "Length [mm]",
    "environment.obstacles[].friction": "Obstacle friction",
    "quality.target_error": "Target error [mm]",
    "quality.time_budget": "Time budget [ms]",
    "quality.n_u": "Points along n_u",
    "quality.n_t": "Points in time n_t",
    "quality.delta": "Threshold δ",
    "quality.method": "Method",
    "quality.keep_grid": "Keep this grid",
}
_ALONE = [label.partition(" [")[0] for label in LABELS.values()]  # without units; some labels differ only in those
_NAMES = {
    field: name if _ALONE.count(name) == 1 else label
    for (field, label), name in zip(LABELS.items(), _ALONE, strict=True)
}
_BARE = {field.rpartition(".")[2]: name for field, name in _NAMES.items()}
_BARE = {field: name for field, name in _BARE.items() if "_" in field and field not in name}  # others are plain words
_QUALITIES = ("target error", "time budget")  # choices on that tab, which have a field only if they are chosen
_BARE |= {name.replace(" ", "_"): f"{name} on the tab Quality" for name in _QUALITIES}
_PART = r"[a-z_]+(?:\[\d+\])*"
_FIELD = re.compile(
    rf"\b(?:(?:cable|environment|shape|quality|effects)(?:\.{_PART})+"
    rf"|(?:primitives|loads|obstacles)\[\d+\](?:\.{_PART})*"
    rf"|horizon(?=: got)|{'|'.join(sorted(_BARE, key=len, reverse=True))})"
    r"(?!\w)"
)


def gripper_name(number: int, u: float) -> str:
    """Return the panel's name of gripper `number` (from 0), which holds the cable at `u` [m]."""
    return f"{number + 1} at {u:.3g} m"


def in_labels(text: str, places: Sequence[float]) -> str:
    """Return a text in which the panel's labels replace the fields of the API.

    Args:
        text: message of the solver.
        places: where the grippers hold the cable [m].
    """
    return _FIELD.sub(lambda found: _label(found[0], places), text)


def problem_in_labels(problem: str, details: str, places: Sequence[float]) -> tuple[str, str]:
    """Return a problem and its details (field, value, what is allowed) with the panel's labels."""
    if problem == MILLIMETRES and details.startswith("quality.target_error:"):  # the panel takes it in millimetres
        problem = "quality.target_error"
    told = (in_labels(text, places) for text in (problem, details))
    problem, details = (new if new in (problem, details) else new[:1].upper() + new[1:] for new in told)
    return problem, details


def _label(field: str, places: Sequence[float]) -> str:
    if field.startswith("effects."):
        return f"the effect {field.removeprefix('effects.').replace('_', ' ')}"
    key = re.sub(r"\[\d+\]", "[]", field)
    label = _NAMES.get(key, _NAMES.get(key.removesuffix("[]"), ""))
    whose = re.match(r"(?:environment\.)?(primitives|loads|obstacles)\[(\d+)\]\.?", field)
    if whose is None:
        return label or _BARE.get(field, field)
    number, rest = int(whose[2]), field[whose.end() :]
    if whose[1] == "primitives":
        owner = f"gripper {gripper_name(number, places[number]) if number < len(places) else number + 1}"
    else:
        owner = f"{'force' if whose[1] == 'loads' else 'obstacle'} {number + 1}"
    return f"{label or rest} of {owner}" if rest else owner
