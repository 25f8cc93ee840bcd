"""The start shape of a request."""

from typing import Annotated, Literal

from pydantic import Discriminator, Field, Tag

from app.schemas.base import Flag, Long, Model, Number, Point, Vector
from dlocore.scene.points import MAX_POINTS, MIN_POINTS
from dlocore.scene.scene import MAX_CONTROL_POINTS, MAX_STRAIN

ControlPoint = Annotated[list[Number], Field(min_length=3, max_length=4)]
Settle = Annotated[
    Flag,
    Field(
        description="Whether the cable relaxes to static equilibrium before t = 0, with the grippers in their first "
        "poses.",
        examples=[False],
    ),
]


class PointVelocities(Model):
    """Velocities at points: at the points of the shape, or evenly spaced along a straight one."""

    kind: Literal["points"]
    points: Long[Vector] = Field(min_length=4, description="Velocities [m/s].", examples=[[[0, 0.1, 0]] * 4])


class ControlVelocities(Model):
    """Control points of the velocity, one for each control point of the shape."""

    kind: Literal["control_points"]
    control_points: Long[ControlPoint] = Field(
        min_length=4,
        description=(
            "[m/s, m/s, m/s] or [m/s, m/s, m/s, rad/s]; the fourth is the rate of the angle theta. With three, the "
            "sections do not spin about their tangent."
        ),
        examples=[[[0, 0.1, 0]] * 4],
    )


def _velocity_form(value: object) -> str:
    if isinstance(value, dict | Model):
        return "~object"
    return "~rows" if isinstance(value, list) and value and isinstance(value[0], list) else "~one"


Velocity = Annotated[
    Annotated[Vector, Tag("~one")]
    | Annotated[Annotated[Long[Vector], Field(min_length=4)], Tag("~rows")]
    | Annotated[
        Annotated[PointVelocities | ControlVelocities, Field(discriminator="kind")],
        Tag("~object"),
    ],
    Discriminator(_velocity_form),
    Field(
        description=(
            "Initial velocity [m/s]: one vector for the whole cable, one for each point (or control point) of the "
            "shape, or an object whose kind suits the shape. Absent: at rest."
        ),
        examples=[[0.0, 0.1, 0.0]],
    ),
]


class StraightShape(Model):
    """A straight cable."""

    kind: Literal["straight"]
    start: Vector = Field(default=[0.0, 0.0, 0.0], description="Where u = 0 lies [m].", examples=[[0, 0, 0]])
    direction: Vector = Field(
        default=[1.0, 0.0, 0.0], description="Direction from there; any length but zero.", examples=[[1, 0, 0]]
    )
    settle: Settle = False
    velocity: Velocity | None = Field(default=None, description="Initial velocity [m/s]; absent: at rest.")


class PointsShape(Model):
    """Points in order along the whole cable, as a vision system gives them: noisy, unevenly spaced, 2D or 3D."""

    kind: Literal["points"]
    points: list[Point] = Field(
        min_length=MIN_POINTS,
        max_length=MAX_POINTS,
        description="Points [m], all 2D (z = 0) or all 3D.",
        examples=[[[0.02, 0.01], [0.24, 0.05], [0.47, -0.03], [0.74, 0.13]]],
    )
    settle: Settle = False
    velocity: Velocity | None = Field(default=None, description="Initial velocity [m/s]; absent: at rest.")


class ControlPointsShape(Model):
    """A clamped cubic spline, given by its control points.

    The cable lies along its curve at its own length, however the control points are spaced. Only with `strain` the
    parameter of the spline is the material coordinate u.
    """

    kind: Literal["control_points"]
    control_points: list[ControlPoint] = Field(
        min_length=4,
        max_length=MAX_CONTROL_POINTS,
        description=(
            "Control points [m, m, m] or [m, m, m, rad]; the fourth is the angle of the sections relative to a frame "
            "without twist. A curve up to 10 % longer or shorter than the cable is scaled to it about its middle."
        ),
        examples=[[[0, 0, 0], [0.32, 0.1, 0], [0.665, 0.1, 0], [0.985, 0, 0]]],
    )
    knots: Long[Number] | None = Field(
        default=None,
        description="Knots [m], four more than control points, from 0 to the cable's length; absent: uniform.",
        examples=[[0, 0, 0, 0, 1, 1, 1, 1]],
    )
    settle: Settle = False
    velocity: Velocity | None = Field(default=None, description="Initial velocity [m/s]; absent: at rest.")
    strain: Long[Annotated[Number, Field(ge=-MAX_STRAIN, le=MAX_STRAIN)]] | None = Field(
        default=None,
        description=(
            "Axial strain, one number for each control point, at the mean of three successive inner knots. The control "
            "points are then those of r(u), with u the material coordinate. Absent: the cable lies along the curve of "
            "the spline without strain."
        ),
        examples=[[0.001, 0.001, 0.0, 0.0]],
    )


class PredictionShape(Model):
    """Continue a stored prediction with its shape, velocity, stretch and twist, and what the cable remembers."""

    kind: Literal["prediction"]
    id: str = Field(description="Id of a stored prediction.", examples=["0193b1f5a2c07f3e9d1c5b6a7e8f"])
    t: Number | None = Field(
        default=None, ge=0.0, description="Time in that prediction [s]; absent: its end.", examples=[1.6]
    )
    settle: Settle = False


ShapeModel = Annotated[StraightShape | PointsShape | ControlPointsShape | PredictionShape, Field(discriminator="kind")]
