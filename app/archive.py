"""A run as stored: request, response document, and the nets of control points; and the surface as .npz."""

import io
from dataclasses import dataclass
from functools import cached_property
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from app.machine import machine_line
from app.schemas import PredictionRequest, to_scene
from dlocore import ControlPoints, Iteration, Prediction, Scene, SplineSurface

Floats = NDArray[np.float64]
SCALARS = ("update", "residual", "energy", "wall_time", "damping", "step_length")  # of an iteration


@dataclass(frozen=True, eq=False)
class Run:
    """A prediction with what was asked, as far as it is stored.

    Attributes:
        request: the request.
        document: the response.
        surface: the predicted surface.
        iterations: the iterates.
        start: the start shape where it was given by control points, also as the end of another run.
        machine: what it was solved on.
    """

    request: dict[str, Any]
    document: dict[str, Any]
    surface: SplineSurface
    iterations: tuple[Iteration, ...]
    start: ControlPoints | None
    machine: str

    @staticmethod
    def of(request: dict[str, Any], document: dict[str, Any], prediction: Prediction) -> "Run":
        """Return a run that was just solved here."""
        shape = prediction.scene.shape
        start = shape if isinstance(shape, ControlPoints) else None
        return Run(request, document, prediction.surface, prediction.iterations, start, machine_line())

    @cached_property
    def scene(self) -> Scene:
        """The scene that was solved; it needs no other run, even where it continued from one."""
        request = self.request
        if request["shape"]["kind"] == "prediction":
            request = {**request, "shape": _as_request(self.start)}
        return to_scene(PredictionRequest.model_validate(request), lambda id: None)


def _as_request(start: ControlPoints | None) -> dict[str, Any]:
    if start is None:
        raise ValueError("The run was stored without the shape it continued from")
    shape: dict[str, Any] = {"kind": "control_points", "settle": start.settle}
    shape["control_points"] = cast(Floats, start.control_points).tolist()
    if start.knots is not None:
        shape["knots"] = cast(Floats, start.knots).tolist()
    if start.velocity is not None:
        velocity = cast(Floats, start.velocity).tolist()
        shape["velocity"] = {"kind": "control_points", "control_points": velocity}
    return shape


def pack(prediction: Prediction) -> bytes:
    """Return the nets of a prediction, of its answer, its iterations and its start, as .npz."""
    arrays: dict[str, Any] = {"machine": np.array(machine_line())}
    shape = prediction.scene.shape
    if isinstance(shape, ControlPoints):
        given = {name: value for name, value in vars(shape).items() if value is not None}
        arrays |= {f"start_{name}": np.asarray(value) for name, value in given.items()}
    surfaces = [prediction.surface, *(iteration.surface for iteration in prediction.iterations)]
    for k, surface in enumerate(surfaces):
        arrays[f"control_points_{k}"] = surface.control_points
        arrays[f"knots_u_{k}"] = surface.knots_u
        arrays[f"knots_t_{k}"] = surface.knots_t
    for name in SCALARS:
        arrays[name] = np.array([getattr(iteration, name) for iteration in prediction.iterations], dtype=float)
    return _npz(arrays)


def unpack(request: dict[str, Any], document: dict[str, Any], nets: bytes) -> Run:
    """Return the run that was stored as these parts."""
    with np.load(io.BytesIO(nets), allow_pickle=False) as arrays:
        surfaces = [
            SplineSurface(arrays[f"control_points_{k}"], arrays[f"knots_u_{k}"], arrays[f"knots_t_{k}"])
            for k in range(len(document["iterations"]) + 1)
        ]
        scalars = {name: arrays[name] for name in SCALARS}
        start = {name.removeprefix("start_"): arrays[name] for name in arrays.files if name.startswith("start_")}
        machine = str(arrays["machine"]) if "machine" in arrays.files else "unknown"  # stored before it was noted
    iterations = tuple(
        Iteration(
            number=shown["number"],
            **{name: float(values[k]) for name, values in scalars.items()},
            n_u=shown["n_u"],
            n_t=shown["n_t"],
            surface=surfaces[k + 1],
            note=shown["note"],
        )
        for k, shown in enumerate(document["iterations"])
    )
    shape = ControlPoints(**{**start, "settle": bool(start["settle"])}) if start else None
    return Run(request, document, surfaces[0], iterations, shape, machine)


def surface_npz(document: dict[str, Any]) -> bytes:
    """Return the surface, the spline and the reactions of a response document as .npz.

    Arrays: `u` (k_u,), `t` (k_t,), `positions` (k_t, k_u, 3), `twist` (k_t, k_u), `control_points` (n_t, n_u, 4),
    `knots_u`, `knots_t`, `degree`, `grasp_u` (g,), `reaction` and `moment` (g, k_t, 3); SI units.
    """
    surface, grasps = document["surface"], document["grasps"]
    times = len(surface["t"])
    return _npz(
        {
            **{name: np.asarray(surface[name], dtype=float) for name in ("u", "t", "positions", "twist")},
            **{name: np.asarray(document[name], dtype=float) for name in ("control_points", "knots_u", "knots_t")},
            "degree": np.array(document["degree"]),
            "grasp_u": np.array([grasp["u"] for grasp in grasps], dtype=float),
            "reaction": np.array([grasp["reaction"] for grasp in grasps], dtype=float).reshape(-1, times, 3),
            "moment": np.array([grasp["moment"] for grasp in grasps], dtype=float).reshape(-1, times, 3),
        }
    )


def _npz(arrays: dict[str, Any]) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()
