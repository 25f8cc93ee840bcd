"""The response of the predictions, as data to serialise and as a schema to read."""

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
OPTIONAL_FIELDS: tuple[OptionalField, ...] = get_args(OptionalField)  # of an answer, which a batch may do without
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
        description="Angles of the sections against a frame without twist [t][u] [rad].", examples=[[[0.0, 0.0]]]
    )


class GraspModel(BaseModel):
    """What a gripper must give to the cable, in world axes; the moment is about the grasped point."""

    u: float = Field(description="Material coordinate [m].", examples=[0.25])
    reaction: list[list[float]] = Field(
        description="Force at the times of the surface [t][3] [N].", examples=[[[0.0, 0.12, 0.0]]]
    )
    moment: list[list[float]] = Field(
        description="Moment at the times of the surface [t][3] [N m].", examples=[[[0.0, 0.0, 0.0]]]
    )
    reaction_error: list[float] | None = Field(
        default=None,
        description="Estimated error of the force at these times, of the discretisation [t] [N]; none where none was "
        "computed, as by the methods paper and reference.",
        examples=[[0.002]],
    )
    moment_error: list[float] | None = Field(
        default=None, description="The same of the moment [t] [N m].", examples=[[0.0]]
    )
    peak_force: float | None = Field(
        default=None,
        description="Largest force over the whole motion, also between the times of the surface [N]; this and the "
        "other peaks are absent of a run that was stored before they were noted.",
        examples=[0.31],
    )
    peak_force_time: float | None = Field(default=None, description="When the force is largest [s].", examples=[0.42])
    peak_moment: float | None = Field(
        default=None, description="Largest moment over the whole motion [N m].", examples=[0.0]
    )
    peak_moment_time: float | None = Field(default=None, description="When the moment is largest [s].", examples=[0.0])


class ContactModel(BaseModel):
    """How hard the table or an obstacle presses on the cable, and how its friction holds it."""

    name: str = Field(
        description="`table`, or `obstacles[i]` with the number of the obstacle in the request.",
        examples=["obstacles[0]"],
    )
    force: list[list[float]] = Field(
        description="Force on the cable across its surface, without friction, at the times of the surface [t][3] [N].",
        examples=[[[0.0, 0.0, 0.32]]],
    )
    friction: list[list[float]] | None = Field(
        default=None,
        description="Friction on the cable at these times [t][3] [N]; none of a run stored before it was noted.",
        examples=[[[-0.06, 0.0, 0.0]]],
    )
    pressed: list[float] = Field(
        description="Sum of the sizes of the forces along the cable [t] [N]: more than the size of `force` where it "
        "presses from several sides.",
        examples=[[0.33]],
    )
    force_error: list[float] | None = Field(
        default=None,
        description="Estimated error of the force at these times [t] [N]; none where none was computed.",
        examples=[[0.006]],
    )
    friction_error: list[float] | None = Field(
        default=None,
        description="Estimated error of the friction at these times [t] [N]; none where none was computed.",
        examples=[[0.002]],
    )


class EffectModel(BaseModel):
    """Whether an effect was simulated, and why."""

    name: str = Field(description="As in the request.", examples=["gravity"])
    active: bool = Field(description="Whether it was simulated.", examples=[True])
    reason: str = Field(description="Why, in words.", examples=["the cable has weight and hangs free"])
    magnitude: float | None = Field(
        description="Its size on the predicted motion; null where that means nothing.", examples=[0.49]
    )
    unit: str = Field(description="Unit of the magnitude.", examples=["N"])


class IterationModel(BaseModel):
    """One iteration of the solve, or one refinement level of a march. Null where a value is not finite."""

    number: int = Field(description="From 0.", examples=[0])
    update: float | None = Field(
        description="Norm of the change of the control points, the paper's eq. (25) [m].", examples=[8.9e-4]
    )
    residual: float | None = Field(
        description="Root mean square residual over the motion [m]; method `paper`: [N].", examples=[2.7e-7]
    )
    energy: float | None = Field(description="Elastic energy at the end of the motion [J].", examples=[2.9e-5])
    wall_time: float = Field(description="Since the solve began [s].", examples=[0.002])
    damping: float | None = Field(
        description="Share by which the diagonal of the normal equations of a `spacetime` step was raised, where they "
        "had lost their positive factors to rounding; else 0.",
        examples=[0.0],
    )
    step_length: float | None = Field(description="Fraction of the full step taken.", examples=[1.0])
    n_u: int = Field(description="Control points along the cable.", examples=[13])
    n_t: int = Field(description="Control points in time.", examples=[19])
    note: str = Field(description="What happened, in words.", examples=["march"])


class AccuracyModel(BaseModel):
    """What the answer is worth and what it cost."""

    method: str = Field(description="Method that gave the answer.", examples=["spacetime"])
    error_estimate: float | None = Field(
        description="Error of position at the worst point [m]; null where unknown.", examples=[8.9e-4]
    )
    error_parts: dict[str, float] = Field(
        description='What it adds up from [m]: "grid" (or "space" and "time", where they are known apart), '
        '"iteration" and "neglected", "start" where the scene does not determine its motion, and "contact" where how '
        "stiff contact is decides on it; empty where it is unknown.",
        examples=[{"grid": 8.8e-4, "iteration": 1e-8, "neglected": 0.0}],
    )
    neglected: float = Field(
        description="The part of it that effects left out by `auto` may have, about [m].", examples=[0.0]
    )
    wall_time: float = Field(description="Time of the solve [s].", examples=[0.004])
    n_u: int = Field(description="Control points along the cable.", examples=[13])
    n_t: int = Field(description="Control points in time.", examples=[19])
    delta: float = Field(description="Threshold on the update [m].", examples=[1e-5])
    steps: int = Field(description="Time steps of the march.", examples=[64])
    dimensions: int = Field(description="2 where the motion is planar, else 3.", examples=[2])
    dimensions_reason: str = Field(
        description="Why, in words.", examples=["the cable lies on the table and moves in its plane"]
    )
    phases: dict[str, float] = Field(description="Time by phase [s].", examples=[{"setup": 0.001, "march": 0.003}])


class StartModel(BaseModel):
    """The start shape as the solver took it."""

    elastic_energy: float = Field(description="Elastic energy stored in the start shape [J].", examples=[0.0])
    fit_error: float = Field(description="Root mean square distance from the given points [m].", examples=[0.0])


class LinksModel(BaseModel):
    """Addresses on this service."""

    self: str = Field(description="This document.", examples=[_RUN])
    recording: str = Field(
        description="The iterations and the motion, for rerun (.rrd).", examples=[_RUN + "/recording.rrd"]
    )
    surface: str = Field(description="The surface for NumPy (.npz).", examples=[_RUN + "/surface.npz"])
    scene: str = Field(description="The request, to be sent again.", examples=[_RUN + "/scene.json"])
    viewer: str = Field(description="The recording in the browser.", examples=[_RUN + "/viewer"])
    events: str = Field(description="The course of the solve as server-sent events.", examples=[_RUN + "/events"])


class PredictionResponse(BaseModel):
    """A predicted motion."""

    id: str = Field(description="Id of the run.", examples=[_ID])
    state: Literal["done"] = Field(description="There is an answer.")
    created: str = Field(description="When it was asked for, ISO 8601 in UTC.", examples=["2026-01-31T12:00:00.000Z"])
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
    grasps: list[GraspModel] = Field(description="What each gripper must give, in the order of `primitives`.")
    contacts: list[ContactModel] = Field(
        default=[],
        description="How hard the table, and each obstacle that was simulated, presses and rubs; empty of a run "
        "that was stored before it was noted, and of method reference.",
    )
    effects: list[EffectModel] = Field(description="What was simulated, and why.")
    iterations: list[IterationModel] = Field(description="How the solve went.")
    accuracy: AccuracyModel = Field(description="What the answer is worth and what it cost.")
    start: StartModel = Field(description="The start shape as the solver took it.")
    links: LinksModel | None = Field(
        description="Addresses of its parts; null where the run is not stored or can't be."
    )


class JobLinksModel(BaseModel):
    """Addresses of a prediction under way, relative to the service."""

    self: str = Field(description="This document; the prediction once it is done.", examples=[_RUN])
    events: str = Field(description="Its progress as server-sent events.", examples=[_RUN + "/events"])


class JobItem(BaseModel):
    """A prediction that has no answer in a list."""

    id: str = Field(description="Id of the run.", examples=["019b1f5a2c07f3e9d1c5b6a7e8f0"])
    created: str = Field(description="When it was asked for, ISO 8601 in UTC.", examples=["2026-01-31T12:00:00.000Z"])
    state: Literal["queued", "running", "failed", "cancelled"] = Field(
        description="How far it is.", examples=["running"]
    )
    links: JobLinksModel = Field(description="Addresses of its parts.")


class JobResponse(JobItem):
    """A prediction that has no answer: not yet, or not any more."""

    iterations: list[IterationModel] = Field(description="The iterations so far.")
    problem: "ProblemDocument | None" = Field(description="Why it failed.")


class RunSummary(BaseModel):
    """A stored run in a list."""

    id: str = Field(description="Its id.", examples=[_ID])
    name: str = Field(description="What the request calls it.", examples=["Lay the cable along the wall"])
    created: str = Field(description="When it was asked for, ISO 8601 in UTC.", examples=["2026-01-31T12:00:00.000Z"])
    status: Status = Field(description="`converged`, or why not.", examples=["converged"])
    method: str = Field(description="Method that gave the answer.", examples=["march"])
    error_estimate: float | None = Field(description="Error of position at the worst point [m].", examples=[8.9e-4])
    wall_time: float = Field(description="Time of the solve [s].", examples=[0.004])
    links: LinksModel = Field(description="Addresses of its parts.")


class PredictionList(BaseModel):
    """Stored runs, newest first."""

    predictions: list[RunSummary] = Field(description="The runs on this page.")
    total: int = Field(description="How many stored runs match, on all pages.", examples=[42])
    limit: int = Field(description="At most so many are listed.", examples=[20])
    offset: int = Field(description="So many newer ones were passed over.", examples=[0])
    next: str | None = Field(
        description="Address of the next page, or null.", examples=["/v1/predictions?limit=20&cursor=" + _ID]
    )
    under_way: list[JobItem] = Field(description="All predictions that run or wait, newest first.")


class BadFieldModel(BaseModel):
    """One wrong field."""

    field: str = Field(description="Path of the field; `body` for the whole.", examples=["primitives[0].u"])
    given: str = Field(description="What was given, shortened.", examples=["2.0"])
    allowed: str = Field(description="What would be accepted.", examples=["0 to the cable's length, 1 [m]"])
    message: str = Field(description="What is wrong, in words.", examples=["Got 2.0. Allowed: 0 to 1 [m]."])


class ProblemDocument(BaseModel):
    """What went wrong (RFC 9457)."""

    type: str = Field(description="A name of the kind of problem.", examples=["urn:dlo:problem:bad-request"])
    title: str = Field(description="The phrase of the status.", examples=["Unprocessable Content"])
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
        fields: which of `OPTIONAL_FIELDS` it has; the others are not worked out.
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
    """Return an iteration without its surface, with None where a value is not finite."""
    named = [f.name for f in dataclass_fields(iteration) if f.name not in ("find_surface", "find_energy")]
    document = {name: getattr(iteration, name) for name in (*named, "energy")}
    for name in ("update", "residual", "energy", "damping", "step_length"):
        document[name] = _finite(document[name])
    return document


def _finite(value: float | None) -> float | None:
    return float(value) if value is not None and np.isfinite(value) else None


def _grasp_document(grasp: GraspReaction, t: Floats) -> dict[str, Any]:
    """Return what a gripper must give: at the times `t` (k,) [s], and at most."""
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
    """Return what the table or an obstacle gives to the cable at the times `t` (k,) [s]."""

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
