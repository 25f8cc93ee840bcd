"""The environment, the effects and the requested quality of a request."""

from typing import Annotated, Literal

from pydantic import Field

from app.schemas.base import BY_FORM, OBJECT, TEXT, Count, CountOrNone, Flag, Model, Number, Vector
from dlocore.scene.scene import MAX_N_T, MAX_N_U, MAX_OBSTACLES, Method, Switch

Length = Annotated[Number, Field(gt=0.0, le=1e4)]
Friction = Annotated[
    Number, Field(ge=0.0, le=10.0, description="Coefficient of Coulomb friction; absent: none.", examples=[0.3])
]


class TableModel(Model):
    """A horizontal table."""

    height: Number = Field(
        default=0.0,
        ge=-1e4,
        le=1e4,
        description="Height of the centreline of a cable lying on it [m]: the surface plus half the diameter.",
        examples=[0.0],
    )
    friction: Friction = 0.0


class Cylinder(Model):
    """A solid cylinder with flat ends."""

    kind: Literal["cylinder"]
    center: Vector = Field(description="Centre [m].", examples=[[0.55, 0.2, 0]])
    axis: Vector = Field(
        default=[0.0, 0.0, 1.0], description="Direction of its axis; any length but zero.", examples=[[0, 0, 1]]
    )
    radius: Length = Field(description="Radius [m].", examples=[0.02])
    height: Length = Field(description="Length along the axis [m].", examples=[0.1])
    friction: Friction = 0.0


class Box(Model):
    """A solid box."""

    kind: Literal["box"]
    center: Vector = Field(description="Centre [m].", examples=[[0.5, 0.2, 0.05]])
    size: Annotated[list[Length], Field(min_length=3, max_length=3)] = Field(
        description="Edge lengths [m].", examples=[[0.1, 0.1, 0.1]]
    )
    orientation: Annotated[list[Number], Field(min_length=4, max_length=4)] | None = Field(
        default=None, description="Unit quaternion (w, x, y, z); absent: axis-aligned.", examples=[[1, 0, 0, 0]]
    )
    friction: Friction = 0.0


class Sphere(Model):
    """A solid sphere."""

    kind: Literal["sphere"]
    center: Vector = Field(description="Centre [m].", examples=[[0.5, 0.2, 0.05]])
    radius: Length = Field(description="Radius [m].", examples=[0.05])
    friction: Friction = 0.0


class Capsule(Model):
    """A solid capsule: all points within `radius` of a segment."""

    kind: Literal["capsule"]
    start: Vector = Field(description="One end of the segment [m].", examples=[[0.5, 0, 0]])
    end: Vector = Field(description="Its other end [m].", examples=[[0.5, 0.2, 0]])
    radius: Length = Field(description="Radius [m].", examples=[0.02])
    friction: Friction = 0.0


ObstacleModel = Annotated[Cylinder | Box | Sphere | Capsule, Field(discriminator="kind")]


class EnvironmentModel(Model):
    """What surrounds the cable. The world frame is right-handed with z up."""

    gravity: Vector = Field(default=[0.0, 0.0, -9.81], description="Gravity [m/s^2].", examples=[[0, 0, -9.81]])
    drag: Number = Field(
        default=0.0, ge=0.0, le=1e6, description="Linear drag per unit length [N s/m^2].", examples=[0.05]
    )
    drag_quadratic: Number = Field(
        default=0.0, ge=0.0, le=1e6, description="Quadratic drag per unit length [N s^2/m^3].", examples=[0.0]
    )
    table: TableModel | None = Field(default=None, description="A table, or null.")
    obstacles: list[ObstacleModel] = Field(
        default=[],
        max_length=MAX_OBSTACLES,
        description="Solid obstacles, given by their true surfaces; the cable touches them with its radius.",
    )


class EffectsModel(Model):
    """Which effects to simulate; with `auto` the scene decides."""

    inertia: Switch = Field(default="auto", description="Inertia of the cable.", examples=["auto"])
    drag: Switch = Field(default="auto", description="Drag of the surrounding air or liquid.", examples=["auto"])
    damping: Switch = Field(default="auto", description="Internal damping of bending and twist.", examples=["auto"])
    gravity: Switch = Field(default="auto", description="Weight.", examples=["auto"])
    stretch: Switch = Field(default="auto", description="Axial stretch, which keeps the length.", examples=["auto"])
    bend: Switch = Field(default="auto", description="Bending stiffness.", examples=["auto"])
    twist: Switch = Field(default="auto", description="Twist and its stiffness.", examples=["auto"])
    plasticity: Switch = Field(default="auto", description="Yield, and the memory of it.", examples=["auto"])
    table: Switch = Field(default="auto", description="Contact with the table.", examples=["auto"])
    friction: Switch = Field(default="auto", description="Friction on the table and on obstacles.", examples=["auto"])
    obstacles: Switch = Field(default="auto", description="Contact with obstacles.", examples=["auto"])
    self_contact: Switch = Field(default="auto", description="Contact of the cable with itself.", examples=["auto"])


class QualityModel(Model):
    """A grid (`n_u` with `n_t`), a target error or a time budget; and how to solve."""

    n_u: CountOrNone = Field(
        default=None,
        ge=5,
        le=MAX_N_U,
        description="Control points along the cable. If the estimated error on this grid is more than 1 % of the "
        "length, or the solve does not come to its end, the answer is on finer grids that reach 1 %, and its message "
        "says so. If no grids settle the motion, this lasts until the time limit of the service; `keep_grid` prevents "
        "it.",
        examples=[9],
    )
    n_t: CountOrNone = Field(default=None, ge=5, le=MAX_N_T, description="Control points in time.", examples=[13])
    keep_grid: Flag = Field(
        default=False,
        description="Whether to keep the result of a given grid, and of a requested least squares, whatever its error "
        "is and whether or not it converges. Only with a given grid.",
        examples=[False],
    )
    delta: Number | None = Field(
        default=None,
        ge=1e-10,
        le=1e-2,
        description="Threshold on the control-point update of a least squares [m]; absent: 1e-5. Only with a given "
        "grid.",
        examples=[1e-5],
    )
    target_error: Number | None = Field(
        default=None,
        ge=1e-6,
        le=10.0,
        description="Target for the error at the worst point of the surface [m].",
        examples=[0.002],
    )
    time_budget: Number | None = Field(
        default=None,
        ge=1e-4,
        le=3600.0,
        description="Time that the solve may take [s]; a first grid that takes longer is still marched to its end. "
        "With a time budget, `converged` means that the estimated error is within 1 % of the length.",
        examples=[0.02],
    )
    method: Method = Field(
        default="auto",
        description="How to solve; the answer names the method used. `auto` is `march`, or `spacetime` if a grid is "
        "given with a `delta` and nothing touches, slips or yields. If `spacetime` does not converge, `march` gives "
        "the answer, and the message says so.",
        examples=["auto"],
    )


Effects = Annotated[Annotated[Literal["auto"], TEXT] | Annotated[EffectsModel, OBJECT], BY_FORM]
Quality = Annotated[Annotated[Literal["auto"], TEXT] | Annotated[QualityModel, OBJECT], BY_FORM]


class OutputModel(Model):
    """How finely the answer is sampled, evenly."""

    samples_u: Count = Field(default=101, ge=2, le=2001, description="Samples along the cable.", examples=[101])
    samples_t: Count = Field(default=33, ge=2, le=2001, description="Samples in time.", examples=[33])
