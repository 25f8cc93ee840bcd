"""The form in which a run is stored: request, response document and control points; and its surface as .npz."""

import io
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.schemas import Motion, PredictionRequest, to_scene
from dlocore import (
    ControlPoints,
    Iteration,
    Material,
    MaterialMotion,
    Prediction,
    Scene,
    SplineSurface,
    StretchMotion,
)
from dlocore.machine import machine_line

Floats = NDArray[np.float64]
SCALARS = ("update", "residual", "energy", "wall_time", "damping", "step_length")  # of an iteration
PEAKS = ("peak_force", "peak_force_time", "peak_moment", "peak_moment_time")  # of a grasp


@dataclass(frozen=True, eq=False)
class Run:
    """A prediction with its request, as far as they are stored.

    Attributes:
        request: the request.
        document: the response.
        surface: the predicted surface.
        material: what the sections of the cable remember over the motion, if anything.
        stretch: how far it is stretched over the motion; None for a run stored before stretch was recorded.
        iterations: the iterates.
        start: the start shape if it was given by control points, or was the end of another run.
        machine: the machine that solved it.
    """

    request: dict[str, Any]
    document: dict[str, Any]
    surface: SplineSurface
    material: MaterialMotion | None
    stretch: StretchMotion | None
    iterations: tuple[Iteration, ...]
    start: ControlPoints | None
    machine: str

    @staticmethod
    def of(request: dict[str, Any], document: dict[str, Any], prediction: Prediction) -> "Run":
        """Return a run that was just solved here."""
        shape = prediction.scene.shape
        start = shape if isinstance(shape, ControlPoints) else None
        parts = prediction.surface, prediction.material, prediction.stretch, prediction.iterations
        return Run(request, document, *parts, start, machine_line())

    @cached_property
    def scene(self) -> Scene:
        """The scene that was solved; it needs no other run, even if it continued one.

        Raises:
            ValueError: it continued another run, and was stored without the shape that it took from that run.
        """
        if self.request["shape"]["kind"] != "prediction":
            return to_scene(PredictionRequest.model_validate(self.request), lambda id: None)
        if self.start is None:
            raise ValueError("The run was stored without the shape it continued from")
        elsewhere = {**self.request, "shape": {"kind": "straight"}}
        return replace(to_scene(PredictionRequest.model_validate(elsewhere), lambda id: None), shape=self.start)


def pack(prediction: Prediction) -> bytes:
    """Return the arrays of a prediction as .npz: the nets of control points of its answer and iterations, its start."""
    arrays: dict[str, Any] = {"machine": np.array(machine_line())}
    shape = prediction.scene.shape
    if isinstance(shape, ControlPoints):
        arrays |= _named("start_", replace(shape, material=None))
        arrays |= _named("remembered_", shape.material)
    arrays |= _named("material_", prediction.material)
    arrays |= _named("stretch_", prediction.stretch)
    surfaces = [prediction.surface, *(iteration.surface for iteration in prediction.iterations)]
    for k, surface in enumerate(surfaces):
        arrays[f"control_points_{k}"] = surface.control_points
        arrays[f"knots_u_{k}"] = surface.knots_u
        arrays[f"knots_t_{k}"] = surface.knots_t
    for name in SCALARS:
        arrays[name] = np.array([getattr(iteration, name) for iteration in prediction.iterations], dtype=float)
    return _npz(arrays)


def _named(prefix: str, part: object) -> dict[str, Any]:
    """Return the fields of a part as arrays, with `prefix` before their names; the part and any field may be None."""
    given = {} if part is None else vars(part)
    return {f"{prefix}{name}": np.asarray(value) for name, value in given.items() if value is not None}


def _part(prefix: str, arrays: Any) -> dict[str, Any]:
    """Return the arrays of an .npz whose names begin with `prefix`, by their names without it."""
    return {name.removeprefix(prefix): arrays[name] for name in arrays.files if name.startswith(prefix)}


def _surface(arrays: Any, k: int) -> SplineSurface:
    return SplineSurface(arrays[f"control_points_{k}"], arrays[f"knots_u_{k}"], arrays[f"knots_t_{k}"])


def _motion(arrays: Any) -> Motion:
    material, stretch = _part("material_", arrays), _part("stretch_", arrays)
    return Motion(
        _surface(arrays, 0),
        MaterialMotion(**material) if material else None,
        StretchMotion(**stretch) if stretch else None,
    )


def unpack_motion(nets: bytes) -> Motion:
    """Return the motion of a run from its stored nets."""
    with np.load(io.BytesIO(nets), allow_pickle=False) as arrays:
        return _motion(arrays)


def unpack(request: dict[str, Any], document: dict[str, Any], nets: bytes) -> Run:
    """Return the run that these parts were stored for."""
    with np.load(io.BytesIO(nets), allow_pickle=False) as arrays:
        motion = _motion(arrays)
        iterates = [_surface(arrays, k + 1) for k in range(len(document["iterations"]))]
        scalars = {name: arrays[name] for name in SCALARS}
        start, remembered = _part("start_", arrays), _part("remembered_", arrays)
        machine = str(arrays["machine"]) if "machine" in arrays.files else "unknown"  # stored before it was recorded
    iterations = tuple(
        Iteration(
            number=shown["number"],
            **{name: float(values[k]) for name, values in scalars.items() if name != "energy"},
            n_u=shown["n_u"],
            n_t=shown["n_t"],
            find_surface=partial(iterates.__getitem__, k),
            find_energy=partial(float, scalars["energy"][k]),
            note=shown["note"],
        )
        for k, shown in enumerate(document["iterations"])
    )
    shape = None
    if start:
        material = Material(**remembered) if remembered else None
        shape = ControlPoints(**{**start, "settle": bool(start["settle"])}, material=material)
    return Run(request, document, *motion, iterations, shape, machine)


def surface_npz(document: dict[str, Any], material: MaterialMotion | None) -> bytes:
    """Return the surface, the spline and the reactions of a response document, and the material, as .npz.

    Arrays, in SI units:

    - `u` (k_u,), `t` (k_t,), `positions` (k_t, k_u, 3), `twist` (k_t, k_u);
    - `control_points` (n_t, n_u, 4), `knots_u`, `knots_t`, `degree`;
    - `grasp_u` (g,), `reaction` and `moment` (g, k_t, 3), `reaction_error` and `moment_error` (g, k_t), and the peaks
      `peak_force`, `peak_force_time`, `peak_moment` and `peak_moment_time` (g,), NaN if the document lacks them;
    - `contact` (c,), the names of what presses on the cable, `contact_force` and `contact_friction` (c, k_t, 3),
      `contact_pressed`, `contact_force_error` and `contact_friction_error` (c, k_t), NaN where unknown;
    - with a material, each field of `MaterialMotion` with `material_` before its name.
    """
    surface, grasps, contacts = document["surface"], document["grasps"], document.get("contacts", [])
    times = len(surface["t"])
    return _npz(
        {
            **{name: np.asarray(surface[name], dtype=float) for name in ("u", "t", "positions", "twist")},
            **{name: np.asarray(document[name], dtype=float) for name in ("control_points", "knots_u", "knots_t")},
            "degree": np.array(document["degree"]),
            "grasp_u": np.array([grasp["u"] for grasp in grasps], dtype=float),
            "reaction": np.array([grasp["reaction"] for grasp in grasps], dtype=float).reshape(-1, times, 3),
            "moment": np.array([grasp["moment"] for grasp in grasps], dtype=float).reshape(-1, times, 3),
            **{name: _errors(grasps, name, times) for name in ("reaction_error", "moment_error")},
            **{name: np.array([grasp.get(name, np.nan) for grasp in grasps], dtype=float) for name in PEAKS},
            "contact": np.array([contact["name"] for contact in contacts], dtype=str),
            "contact_force": np.array([contact["force"] for contact in contacts], dtype=float).reshape(-1, times, 3),
            "contact_friction": np.array([_friction(one, times) for one in contacts], dtype=float).reshape(
                -1, times, 3
            ),
            "contact_pressed": np.array([contact["pressed"] for contact in contacts], dtype=float).reshape(-1, times),
            **{f"contact_{name}": _errors(contacts, name, times) for name in ("force_error", "friction_error")},
            **_named("material_", material),
        }
    )


def _errors(givers: list[dict[str, Any]], name: str, times: int) -> NDArray[np.float64]:
    """Return the errors of the forces or moments of grasps or contacts (n, times), NaN if there are none."""
    found = np.full((len(givers), times), np.nan)
    for row, giver in zip(found, givers, strict=True):
        if giver.get(name) is not None:
            row[:] = giver[name]
    return found


def _friction(contact: dict[str, Any], times: int) -> Any:
    """Return the friction of a contact (times, 3), NaN for a document stored before friction was recorded."""
    known = contact.get("friction")
    return np.full((times, 3), np.nan) if known is None else known


def _npz(arrays: dict[str, Any]) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()
