"""The request and the answer of ``POST /v1/cables:identify``."""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, Field

from app.schemas.base import Count, Flag, Long, Model, Number, Vector
from app.schemas.cable import CableModel, PointMassModel
from app.schemas.fit import Coordinate
from dlocore.identify.parameters import DEFAULT
from dlocore.scene.cable import MAX_LENGTH, MAX_POINT_MASSES

Marker = Annotated[list[Coordinate], Field(min_length=2, max_length=3)]
Frame = Annotated[list[Marker | None], Field(min_length=3, max_length=200)]
Name = Annotated[str, Field(max_length=40)]


class RecordingModel(Model):
    """Tracked markers of one motion, or of shapes at rest."""

    times: Long[Number] = Field(
        min_length=1, max_length=5000, description="Time of each frame [s], increasing.", examples=[[0.0, 0.01, 0.02]]
    )
    markers: Long[Frame] = Field(
        min_length=1,
        max_length=5000,
        description="Position of each marker in each frame [m], in order along the cable; null where it was lost.",
        examples=[[[[0.0, 0.0, 0.0], None, [0.2, 0.0, -0.1]]]],
    )
    u: Long[Number] | None = Field(
        default=None,
        description="Material coordinate of each marker [m]; absent: found from the distances between neighbours.",
        examples=[[0.0, 0.1, 0.2]],
    )
    held: list[Count] = Field(
        default_factory=list,
        max_length=64,
        description="Indices of the markers that grippers hold; negative ones count from the end. Two close neighbours "
        "are one clamp.",
        examples=[[0, 1, -2, -1]],
    )
    length: Number | None = Field(
        default=None, gt=0.0, le=MAX_LENGTH, description="Length of the cable [m].", examples=[1.0]
    )
    diameter: Number | None = Field(
        default=None, gt=0.0, le=1.0, description="Diameter of the cable [m].", examples=[0.005]
    )
    linear_density: Number | None = Field(
        default=None,
        gt=0.0,
        le=1e4,
        description="Mass per length [kg/m]; absent: 0.04. Stiffnesses and drag are found in proportion to it.",
        examples=[0.04],
    )
    point_masses: list[PointMassModel] = Field(
        default=[],
        max_length=MAX_POINT_MASSES,
        description="Parts attached to the cable, such as a connector at its end.",
        examples=[[{"u": 1.0, "mass": 0.02}]],
    )
    gravity: Vector = Field(default=[0.0, 0.0, -9.81], description="Gravity [m/s^2].", examples=[[0.0, 0.0, -9.81]])
    static: Flag = Field(
        default=False, description="Whether every frame is a separate shape at rest.", examples=[False]
    )
    name: Annotated[str, Field(max_length=100)] | None = Field(
        default=None,
        description="Name in the answer, different for each recording; absent: `recordings[0]` and so on.",
        examples=["shaken"],
    )


class IdentifyRequest(Model):
    """Recordings of one cable, and what to find."""

    recordings: list[RecordingModel] = Field(min_length=1, max_length=16, description="Recordings of one cable.")
    parameters: list[Name] = Field(
        default=list(DEFAULT),
        min_length=1,
        max_length=40,
        description="Names of the parameters to find (docs/identification.md).",
        examples=[list(DEFAULT)],
    )
    cable: CableModel | None = Field(
        default=None,
        description="What is known of the cable, and first guesses of the parameters to find; absent: taken from the "
        "recordings. The length is always that of the first recording.",
        examples=[{"length": 1.0, "diameter": 0.005, "linear_density": 0.04, "bending_damping": 1e-4}],
    )
    n_u: Count = Field(default=13, ge=7, le=65, description="Control points along the cable.", examples=[13])


class EstimatedModel(BaseModel):
    """A parameter, and how well it is known."""

    name: str = Field(description="Name as in the request.", examples=["bending_stiffness"])
    unit: str = Field(description="Unit of the value and of the interval.", examples=["N m^2"])
    value: float = Field(
        description="Its value; the assumed one if the parameter is not identifiable.", examples=[1e-3]
    )
    low: float | None = Field(description="Lower end of the 95 % interval.", examples=[0.9e-3])
    high: float | None = Field(description="Upper end of the 95 % interval.", examples=[1.1e-3])
    identifiable: bool = Field(description="Whether the recordings determine it.", examples=[True])
    statement: str = Field(
        description="The result in words.", examples=["bending_stiffness = 0.001 N m^2, known to 10 %."]
    )
    rests_on: dict[str, float] = Field(
        description="Share of the information that comes from each recording.", examples=[{"shaken": 1.0}]
    )


class FitOfRecording(BaseModel):
    """Distances of the free markers from the prediction."""

    recording: str = Field(description="Name of the recording.", examples=["shaken"])
    mean: float = Field(description="Mean over markers and frames [m].", examples=[0.004])
    median: float = Field(description="Median over markers and frames [m].", examples=[0.003])
    worst: float = Field(description="Largest of any marker in any frame [m].", examples=[0.02])
    stalled: bool = Field(description="Whether the prediction ended early.", examples=[False])


class IdentifyResponse(BaseModel):
    """A cable with what is known of it; `cable` and `environment` can be used in a prediction."""

    status: Literal["converged", "max_iterations"] = Field(
        description="Whether the search converged.", examples=["converged"]
    )
    message: str = Field(description="The result in words, and what could not be identified.", examples=["Converged."])
    cable: dict[str, Any] = Field(description="The cable, for use in a prediction.", examples=[{"length": 1.0}])
    environment: dict[str, Any] = Field(description="Drag and gravity.", examples=[{"drag": 0.05}])
    parameters: list[EstimatedModel] = Field(description="The parameters, in the order of the request.")
    correlations: list[list[float | None]] = Field(
        description="Correlations of the parameters; null where not identifiable.", examples=[[[1.0]]]
    )
    fit: list[FitOfRecording] = Field(description="How well each window of the recordings is fitted.")
    deviation: float = Field(description="Robust deviation of a marker coordinate [m].", examples=[0.001])
    iterations: int = Field(description="Iterations of the search.", examples=[6])
    seconds: float = Field(description="Duration of the search [s].", examples=[4.2])
    rest_curvature: list[list[float]] | None = Field(
        default=None, description="Curvature of the stress-free shape [1/m], if requested.", examples=[[[0.1, 0.0]]]
    )
    turn: float | None = Field(
        default=None,
        description="Turn of the last clamp relative to the first about the cable [rad], if requested.",
        examples=[0.1],
    )
    clamp_angles: list[list[float]] | None = Field(
        default=None,
        description="Angles at which the cable leaves the direction of the markers of each clamp [rad], if requested.",
        examples=[[[0.05, -0.02]]],
    )
    marker_offsets: list[list[float]] | None = Field(
        default=None,
        description="Offsets of every marker from the centreline [m], if requested.",
        examples=[[[0.004, -0.001]]],
    )
