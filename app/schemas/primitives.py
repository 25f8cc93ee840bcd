"""Grasps with their paths, and loads."""

from typing import Annotated, Literal

from pydantic import Field

from app.schemas.base import BY_FORM, LIST, OBJECT, Coordinate, Long, Model, Number, Vector
from dlocore.scene.paths import MAX_STOPS, MAX_WAYPOINTS, Profile, Start, Through
from dlocore.scene.scene import Hold

Quaternion = Annotated[list[Number], Field(min_length=4, max_length=4)]
Instant = Annotated[Number, Field(ge=0.0, le=1e4)]


class StillPath(Model):
    """Stay where the cable is grasped."""

    kind: Literal["still"]


class MovePath(Model):
    """Move by a displacement, and turn, in a given time."""

    kind: Literal["move"]
    displacement: Vector = Field(description="Displacement [m].", examples=[[0, 0.5, 0]])
    rotation: Vector | None = Field(
        default=None,
        description="Final rotation vector [rad], in world axes; not with the hold `point`.",
        examples=[[0, 0, 0.8]],
    )
    duration: Number = Field(gt=1e-4, le=1e4, description="Duration [s].", examples=[1.6])
    profile: Profile = Field(default="minimum_jerk", description="Position law in time.", examples=["minimum_jerk"])


class WaypointsPath(Model):
    """Pass through positions at given times along a C2 spline, or stop at each of them."""

    kind: Literal["waypoints"]
    times: Long[Instant] = Field(
        min_length=2,
        max_length=MAX_WAYPOINTS,
        description="Increasing times since the grasp [s].",
        examples=[[0, 0.5, 1]],
    )
    positions: Long[Vector] = Field(
        min_length=2,
        description="One position for each time [m]; the first is where the cable is grasped.",
        examples=[[[0.25, 0, 0], [0.25, 0.1, 0], [0.25, 0.3, 0]]],
    )
    orientations: Long[Quaternion] | None = Field(
        default=None,
        description="One unit quaternion (w, x, y, z) for each time, in world axes. Only the rotation since the first "
        "one counts, R(t) R(0)^-1. The gripper turns the shorter way to the next one, with the profile `spline` as "
        "smoothly as possible.",
        examples=[[[1, 0, 0, 0]] * 3],
    )
    start: Start = Field(
        default="rest",
        description="`rest`: the gripper starts at rest; `moving`: with the speed that the first positions show, as "
        "for a recorded path.",
        examples=["rest"],
    )
    profile: Through = Field(
        default="spline",
        description="`spline`: smoothly through all positions. With any other profile: straight from each position to "
        "the next, as a `move` with that profile. This is a program of moves, in which two equal positions are a "
        f"pause; it has at most {MAX_STOPS:,} positions.",
        examples=["spline"],
    )


PathModel = Annotated[StillPath | MovePath | WaypointsPath, Field(discriminator="kind")]


class PrimitiveModel(Model):
    """A gripper that holds the cable and moves it."""

    u: Coordinate
    hold: Hold = Field(
        default="point",
        description="`point` holds the position, `tangent` also the direction, `clamp` also the twist.",
        examples=["point"],
    )
    path: PathModel = Field(description="Where the gripper goes; the time of the path starts at `grasp_time`.")
    grasp_time: Instant | None = Field(
        default=None, description="When the gripper closes [s]; absent: it holds from the start.", examples=[0.0]
    )
    release_time: Instant | None = Field(
        default=None, description="When the gripper opens [s]; absent: never.", examples=[2.0]
    )


class ForceOverTime(Model):
    """A force given at times: linear between them, and constant before the first and after the last."""

    times: Long[Number] = Field(
        min_length=1,
        description="Increasing times [s]; two equal ones are a jump. The first force also acts before the first time, "
        "and the last force after the last time.",
        examples=[[0, 1]],
    )
    values: Long[Vector] = Field(
        min_length=1, description="One force for each time [N].", examples=[[[0, 0, 0], [0, 1, 0]]]
    )


class LoadModel(Model):
    """A known force on a point of the cable whose motion is not known."""

    u: Coordinate
    force: Annotated[Annotated[Vector, LIST] | Annotated[ForceOverTime, OBJECT], BY_FORM] = Field(
        description="Force [N], constant or over time.", examples=[[0, 0, 0.1]]
    )
