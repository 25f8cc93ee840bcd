"""The response to a prediction, as data to serialise and as a schema."""

from collections.abc import Callable, Collection
from dataclasses import fields as dataclass_fields
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field

from app.schemas.ids import created_of
from dlocore import Prediction
from dlocore.answer.compared import at_times
from dlocore.answer.parts import ContactForce, GraspReaction, Iteration, Status
from dlocore.spline import DEGREE

Floats = NDArray[np.float64]
OptionalField = Literal[
    "surface", "control_points", "knots_u", "knots_t", "degree", "grasps", "contacts", "effects", "iterations", "start"
]
OPTIONAL_FIELDS: tuple[OptionalField, ...] = get_args(OptionalField)  # parts of an answer that a batch can leave out
_ID = "019b1f5a2c07f3e9d1c5b6a7e8f0"
_RUN = f"/v1/predictions/{_ID}"


class SurfaceModel(BaseModel):
    """The predicted space-time surface, sampled evenly."""

    u: list[float] = Field(description="Material coordinates [m].", examples=[[0.0, 0.01, 0.02]])
    t: list[float] = Field(description="Times [s].", examples=[[0.0, 0.05, 0.1]])
    positions: list[list[list[float]]] = Field(
        description="Positions [t][u][3] [m].", examples=[[[[0.0, 0.0, 0.0], [0.01, 0.0, 0.0]]]]
    )
    twist: list[list[float]] = Field(
        description="Angles of the sections relative to a frame without twist [t][u] [rad].", examples=[[[0.0, 0.0]]]
    )


class GraspModel(BaseModel):
    """Force and moment that a gripper must exert on the cable, in world axes; the moment is about the grasped point."""

    u: float = Field(description="Material coordinate [m].", examples=[0.25])
    reaction: list[list[float]] = Field(
        description="Force at the times of the surface [t][3] [N].", examples=[[[0.0, 0.12, 0.0]]]
    )
    moment: list[list[float]] = Field(
        description="Moment at the times of the surface [t][3] [N m].", examples=[[[0.0, 0.0, 0.0]]]
    )
    reaction_error: list[float] | None = Field(
        default=None,
        description="Estimated discretisation error of the force at these times [t] [N]; null if none was computed, as "
        "with the methods `paper` and `reference`.",
        examples=[[0.002]],
    )
    moment_error: list[float] | None = Field(
        default=None,
        description="Estimated discretisation error of the moment at these times [t] [N m]; null as for the force.",
        examples=[[0.0]],
    )
    peak_force: float | None = Field(
        default=None,
        description="Largest force over the whole motion, also between the times of the surface [N]. This and the "
        "other peaks are absent for a run that was stored before they were recorded.",
        examples=[0.31],
    )
    peak_force_time: float | None = Field(default=None, description="When the force is largest [s].", examples=[0.42])
    peak_moment: float | None = Field(
        default=None, description="Largest moment over the whole motion [N m].", examples=[0.0]
    )
    peak_moment_time: float | None = Field(default=None, description="When the moment is largest [s].", examples=[0.0])


class ContactModel(BaseModel):
    """Contact force and friction of the table or an obstacle on the cable."""

    name: str = Field(
        description="`table`, or `obstacles[i]` with the number of the obstacle in the request.",
        examples=["obstacles[0]"],
    )
    force: list[list[float]] = Field(
        description="Normal force on the cable, without friction, at the times of the predicted surface [t][3] [N].",
        examples=[[[0.0, 0.0, 0.32]]],
    )
    friction: list[list[float]] | None = Field(
        default=None,
        description="Friction on the cable at these times [t][3] [N]; null for a run that was stored before friction "
        "was recorded.",
        examples=[[[-0.06, 0.0, 0.0]]],
    )
    pressed: list[float] = Field(
        description="Sum of the magnitudes of the normal forces along the cable [t] [N]: more than the magnitude of "
        "`force` if the contact presses from several sides.",
        examples=[[0.33]],
    )
    force_error: list[float] | None = Field(
        default=None,
        description="Estimated error of the force at these times [t] [N]; null if none was computed.",
        examples=[[0.006]],
    )
    friction_error: list[float] | None = Field(
        default=None,
        description="Estimated error of the friction at these times [t] [N]; null if none was computed.",
        examples=[[0.002]],
    )


class EffectModel(BaseModel):
    """Whether an effect was simulated, and why."""

    name: str = Field(description="Name as in the request.", examples=["gravity"])
    active: bool = Field(description="Whether it was simulated.", examples=[True])
    reason: str = Field(description="Why, in words.", examples=["the cable has weight and hangs free"])
    magnitude: float | None = Field(
        description="Its size in the predicted motion; null if that has no meaning.", examples=[0.49]
    )
    unit: str = Field(description="Unit of the magnitude.", examples=["N"])


class IterationModel(BaseModel):
    """One iteration of the solve, or one refinement level of a march. A value that is not finite is null."""

    number: int = Field(description="Number of the iteration, from 0.", examples=[0])
    update: float | None = Field(
        description="Norm of the change of the control points, the paper's eq. (25) [m].", examples=[8.9e-4]
    )
    residual: float | None = Field(
        description="Root mean square residual over the motion [m]; with the method `paper` [N].", examples=[2.7e-7]
    )
    energy: float | None = Field(description="Elastic energy at the end of the motion [J].", examples=[2.9e-5])
    wall_time: float = Field(description="Time since the solve began [s].", examples=[0.002])
    damping: float | None = Field(
        description="Share by which the diagonal of the normal equations of a `spacetime` step was raised because "
        "rounding had made their factors not positive; otherwise 0.",
        examples=[0.0],
    )
    step_length: float | None = Field(description="Fraction of the full step that was taken.", examples=[1.0])
    n_u: int = Field(description="Control points along the cable.", examples=[13])
    n_t: int = Field(description="Control points in time.", examples=[19])
    note: str = Field(description="What happened, in words.", examples=["march"])


class AccuracyModel(BaseModel):
    """Accuracy and cost of the answer."""

    method: str = Field(description="Method that gave the answer.", examples=["spacetime"])
    error_estimate: float | None = Field(
        description="Estimated position error at the worst point [m]; null if unknown.", examples=[8.9e-4]
    )
    error_parts: dict[str, float] = Field(
        description='The parts that the estimate is the sum of [m]: "grid" (or "space" and "time", if they are known '
        'separately), "iteration" and "neglected"; also "start" if the scene does not determine its motion, and '
        '"contact" if the stiffness of contact decides on the motion. Empty if the estimate is unknown. An effect that '
        "the scene switches off has no part: a note in `message` reports it if it matters.",
        examples=[{"grid": 8.8e-4, "iteration": 1e-8, "neglected": 0.0}],
    )
    neglected: float = Field(
        description="The part of the estimate for effects that `auto` left out, approximately [m].", examples=[0.0]
    )
    wall_time: float = Field(description="Time of the solve [s].", examples=[0.004])
    n_u: int = Field(description="Control points along the cable.", examples=[13])
    n_t: int = Field(description="Control points in time.", examples=[19])
    delta: float = Field(description="Threshold on the update [m].", examples=[1e-5])
    steps: int = Field(description="Time steps of the march.", examples=[64])
    dimensions: int = Field(description="2 if the motion is planar, otherwise 3.", examples=[2])
    dimensions_reason: str = Field(
        description="Why the motion has so many dimensions, in words.",
        examples=["the cable lies on the table and moves in its plane"],
    )
    phases: dict[str, float] = Field(description="Time by phase [s].", examples=[{"setup": 0.001, "march": 0.003}])


class StartModel(BaseModel):
    """The start shape as the solver used it."""

    elastic_energy: float = Field(description="Elastic energy stored in the start shape [J].", examples=[0.0])
    fit_error: float = Field(description="Root mean square distance from the given points [m].", examples=[0.0])


class LinksModel(BaseModel):
    """Addresses on this service."""

    self: str = Field(description="This document.", examples=[_RUN])
    recording: str = Field(
        description="The iterations and the motion, for rerun (.rrd).", examples=[_RUN + "/recording.rrd"]
    )
    surface: str = Field(description="The surface for NumPy (.npz).", examples=[_RUN + "/surface.npz"])
    scene: str = Field(description="The request, which can be sent again.", examples=[_RUN + "/scene.json"])
    viewer: str = Field(description="The recording in the browser.", examples=[_RUN + "/viewer"])
    events: str = Field(description="The progress of the solve as server-sent events.", examples=[_RUN + "/events"])


class PredictionResponse(BaseModel):
    """A predicted motion."""

    id: str = Field(description="Id of the run.", examples=[_ID])
    state: Literal["done"] = Field(description="The prediction has an answer.")
    created: str = Field(description="When it was requested, ISO 8601 in UTC.", examples=["2026-01-31T12:00:00.000Z"])
    status: Status = Field(description="`converged`, or why not.", examples=["converged"])
    message: str = Field(
        description="The status in words, and what to do about it.",
        examples=["Two grids agree to 0.89 mm; the estimated error is 0.4 mm, target 2 mm."],
    )
    surface: SurfaceModel = Field(description="The predicted surface, sampled as `output` asks.")
    control_points: list[list[list[float]]] = Field(
        description="Control points of the bivariate spline [n_t][n_u][4] [m, m, m, rad].",
        examples=[[[[0.0, 0.0, 0.0, 0.0]]]],
    )
    knots_u: list[float] = Field(
        description="Knots along the cable [m].", examples=[[0.0, 0.0, 0.0, 0.0, 1.0, 1.0, 1.0, 1.0]]
    )
    knots_t: list[float] = Field(description="Knots in time [s].", examples=[[0.0, 0.0, 0.0, 0.0, 1.6, 1.6, 1.6, 1.6]])
    degree: int = Field(description="Degree of the spline.", examples=[3])
    grasps: list[GraspModel] = Field(
        description="Force and moment that each gripper must exert, in the order of `primitives`."
    )
    contacts: list[ContactModel] = Field(
        default=[],
        description="Contact force and friction of the table and of each obstacle that was simulated; empty for a run "
        "that was stored before they were recorded, and with the method `reference`.",
    )
    effects: list[EffectModel] = Field(description="What was simulated, and why.")
    iterations: list[IterationModel] = Field(description="How the solve went.")
    accuracy: AccuracyModel = Field(description="Accuracy and cost of the answer.")
    start: StartModel = Field(description="The start shape as the solver used it.")
    links: LinksModel | None = Field(
        description="Addresses of its parts; null if the run is not stored or can't be stored."
    )


class JobLinksModel(BaseModel):
    """Addresses of a prediction under way, relative to the service."""

    self: str = Field(description="This document; the prediction once it is done.", examples=[_RUN])
    events: str = Field(description="Its progress as server-sent events.", examples=[_RUN + "/events"])


class JobItem(BaseModel):
    """A prediction without an answer, as an item of a list."""

    id: str = Field(description="Id of the run.", examples=["019b1f5a2c07f3e9d1c5b6a7e8f0"])
    created: str = Field(description="When it was requested, ISO 8601 in UTC.", examples=["2026-01-31T12:00:00.000Z"])
    state: Literal["queued", "running", "failed", "cancelled"] = Field(description="Its state.", examples=["running"])
    links: JobLinksModel = Field(description="Its addresses.")


class JobResponse(JobItem):
    """A prediction without an answer: queued, running, failed or cancelled."""

    iterations: list[IterationModel] = Field(description="The iterations so far.")
    problem: "ProblemDocument | None" = Field(description="Why it failed or was cancelled.")


class RunSummary(BaseModel):
    """A stored run, as an item of a list."""

    id: str = Field(description="Id of the run.", examples=[_ID])
    name: str = Field(description="Name that the request gives it.", examples=["Lay the cable along the wall"])
    created: str = Field(description="When it was requested, ISO 8601 in UTC.", examples=["2026-01-31T12:00:00.000Z"])
    status: Status = Field(description="`converged`, or why not.", examples=["converged"])
    method: str = Field(description="Method that gave the answer.", examples=["march"])
    error_estimate: float | None = Field(
        description="Estimated position error at the worst point [m]; null if unknown.", examples=[8.9e-4]
    )
    wall_time: float = Field(description="Time of the solve [s].", examples=[0.004])
    links: LinksModel = Field(description="Addresses of its parts.")


class PredictionList(BaseModel):
    """Stored runs, newest first."""

    predictions: list[RunSummary] = Field(description="The runs on this page.")
    total: int = Field(description="Number of stored runs that match, on all pages.", examples=[42])
    limit: int = Field(description="Largest number of runs on a page.", examples=[20])
    offset: int = Field(description="Number of newer runs that were skipped.", examples=[0])
    next: str | None = Field(
        description="Address of the next page, or null.", examples=["/v1/predictions?limit=20&cursor=" + _ID]
    )
    under_way: list[JobItem] = Field(description="All predictions that are running or waiting, newest first.")


class BadFieldModel(BaseModel):
    """One wrong field."""

    field: str = Field(
        description="Path of the field; `body` for the request as a whole.", examples=["primitives[0].u"]
    )
    given: str = Field(description="What was given, shortened.", examples=["2.0"])
    allowed: str = Field(description="What would be accepted.", examples=["0 to the cable's length, 1 [m]"])
    message: str = Field(description="What is wrong, in words.", examples=["Got 2.0. Allowed: 0 to 1 [m]."])


class ProblemDocument(BaseModel):
    """What went wrong (RFC 9457)."""

    type: str = Field(description="Name of the kind of problem.", examples=["urn:dlo:problem:bad-request"])
    title: str = Field(description="The phrase of the HTTP status.", examples=["Unprocessable Content"])
    status: int = Field(description="The HTTP status.", examples=[422])
    detail: str = Field(
        description="What went wrong and what to do, in words.",
        examples=["primitives[0].u: Got 2.0. Allowed: 0 to the cable's length, 1 [m]."],
    )
    errors: list[BadFieldModel] | None = Field(default=None, description="The wrong fields, with status 422.")
    prediction: str | None = Field(
        default=None, description="Address of the best iterate, with status 504.", examples=[_RUN]
    )


def problem_document(description: str) -> dict[str, Any]:
    """Return the OpenAPI entry of a response that is a problem document."""
    reference = {"$ref": "#/components/schemas/ProblemDocument"}
    return {"description": description, "content": {"application/problem+json": {"schema": reference}}}


def links(id: str) -> dict[str, str]:
    """Return the addresses of the run `id`, relative to the service."""
    base = f"/v1/predictions/{id}"
    return {
        "self": base,
        "recording": f"{base}/recording.rrd",
        "surface": f"{base}/surface.npz",
        "scene": f"{base}/scene.json",
        "viewer": f"{base}/viewer",
        "events": f"{base}/events",
    }


def job_links(id: str) -> dict[str, str]:
    """Return the addresses of the prediction `id` under way, relative to the service."""
    return {name: address for name, address in links(id).items() if name in JobLinksModel.model_fields}


def from_prediction(
    prediction: Prediction,
    id: str,
    samples_u: int = 101,
    samples_t: int = 33,
    fields: Collection[str] = OPTIONAL_FIELDS,
) -> dict[str, Any]:
    """Return the response document of `prediction`, with NumPy arrays in it.

    Args:
        prediction: what the solver returned.
        id: id of the stored run.
        samples_u: samples along the cable.
        samples_t: samples in time.
        fields: the members of `OPTIONAL_FIELDS` that it has; the others are not computed.
    """
    u, t, q = prediction.surface.sample(samples_u, samples_t)
    accuracy = vars(prediction.accuracy)
    parts: dict[str, Callable[[], Any]] = {
        "surface": lambda: {
            "u": u,
            "t": t,
            "positions": np.ascontiguousarray(q[..., :3]),
            "twist": q[..., 3].copy(),
        },
        "control_points": lambda: np.ascontiguousarray(prediction.surface.control_points, dtype=float),
        "knots_u": lambda: prediction.surface.knots_u,
        "knots_t": lambda: prediction.surface.knots_t,
        "degree": lambda: DEGREE,
        "grasps": lambda: [_grasp_document(grasp, t) for grasp in prediction.grasps],
        "contacts": lambda: [_contact_document(contact, t) for contact in prediction.contacts],
        "effects": lambda: [{**vars(effect), "magnitude": _finite(effect.magnitude)} for effect in prediction.effects],
        "iterations": lambda: [iteration_document(iteration) for iteration in prediction.iterations],
        "start": lambda: {"elastic_energy": prediction.start_energy, "fit_error": prediction.start_fit},
    }
    return {
        "id": id,
        "state": "done",
        "created": created_of(id),
        "status": prediction.status,
        "message": prediction.message,
        **{name: part() for name, part in parts.items() if name in fields},
        "accuracy": {**accuracy, "error_estimate": _finite(prediction.accuracy.error_estimate)},
        "links": links(id),
    }


def iteration_document(iteration: Iteration) -> dict[str, Any]:
    """Return an iteration without its surface; values that are not finite are None."""
    named = [f.name for f in dataclass_fields(iteration) if f.name not in ("find_surface", "find_energy")]
    document = {name: getattr(iteration, name) for name in (*named, "energy")}
    for name in ("update", "residual", "energy", "damping", "step_length"):
        document[name] = _finite(document[name])
    return document


def _finite(value: float | None) -> float | None:
    return float(value) if value is not None and np.isfinite(value) else None


def _grasp_document(grasp: GraspReaction, t: Floats) -> dict[str, Any]:
    """Return the force and moment of a gripper at the times `t` (k,) [s], and their peaks."""
    document: dict[str, Any] = {
        "u": grasp.u,
        "reaction": at_times(t, grasp.times, grasp.reaction),
        "moment": at_times(t, grasp.times, grasp.moment),
    }
    for name, errors in (("reaction_error", grasp.reaction_error), ("moment_error", grasp.moment_error)):
        document[name] = None if errors is None else np.interp(t, grasp.times, errors)
    for name, values in (("peak_force", grasp.reaction), ("peak_moment", grasp.moment)):
        sizes = np.linalg.norm(values, axis=1)
        k = int(sizes.argmax())
        document |= {name: float(sizes[k]), f"{name}_time": float(grasp.times[k])}
    return document


def _contact_document(contact: ContactForce, t: Floats) -> dict[str, Any]:
    """Return the force and friction of the table or an obstacle on the cable at the times `t` (k,) [s]."""

    def error(values: Floats | None) -> Floats | None:
        return None if values is None else np.interp(t, contact.times, values)

    return {
        "name": contact.name,
        "force": at_times(t, contact.times, contact.force),
        "friction": at_times(t, contact.times, contact.friction),
        "pressed": np.interp(t, contact.times, contact.pressed),
        "force_error": error(contact.force_error),
        "friction_error": error(contact.friction_error),
    }
