"""The cable of a request."""

from typing import Annotated, Any, Literal

from pydantic import Field

from app.schemas.base import BY_FORM, LIST, TEXT, Coordinate, Model, Number, Point
from dlocore import PRESETS
from dlocore.scene.cable import MAX_LENGTH, MAX_POINT_MASSES, MIN_LENGTH
from dlocore.scene.points import MAX_POINTS, MIN_POINTS

RestPoints = Annotated[list[Point], Field(min_length=MIN_POINTS, max_length=MAX_POINTS)]
RestShape = Annotated[
    Annotated[Literal["straight", "initial"], TEXT] | Annotated[RestPoints, LIST],
    BY_FORM,
]


def _positive(what: str, unit: str, example: float, most: float = 1e15) -> Any:
    return Field(default=None, gt=0.0, le=most, description=f"{what} [{unit}].", examples=[example])


def _yield(what: str, example: float) -> Any:
    description = f"{what}; absent: elastic. Needs `memory_rate`."
    return Field(default=None, gt=0.0, le=10.0, description=description, examples=[example])


class PointMassModel(Model):
    """A connector, plug or clip in one place of the cable: weight and inertia without size, drag or rotation."""

    u: Coordinate
    mass: Number = Field(ge=0.0, le=1e4, description="Mass [kg].", examples=[0.02])


class CableModel(Model):
    """A cable of round section. `length`, `diameter` and `linear_density` are required unless `preset` gives them.

    Give the stiffnesses themselves, or the moduli and the solid round section gives them: EA = E pi D^2/4,
    EI = E pi D^4/64, GJ = G pi D^4/32. That is right for solid rods only. Strands slide on each other: by the
    modulus of copper 6 mm have an EI of 7 N m^2, measured wires of that size have 1e-4 to 1e-3.
    """

    preset: str | None = Field(
        default=None,
        description="Name of a preset (`GET /v1/cables`); fields given beside it override its values.",
        examples=list(PRESETS)[:2],
    )
    length: Number | None = Field(
        default=None, ge=MIN_LENGTH, le=MAX_LENGTH, description="Length L [m].", examples=[1.0]
    )
    diameter: Number | None = _positive("Diameter D, at most half the length", "m", 0.005, 500.0)
    linear_density: Number | None = _positive("Mass per length", "kg/m", 0.05, 1e4)
    bending_stiffness: Number | None = _positive("EI", "N m^2", 1e-3)
    axial_stiffness: Number | None = _positive("EA", "N", 640.0)
    torsional_stiffness: Number | None = _positive("GJ", "N m^2", 1e-3)
    youngs_modulus: Number | None = _positive("E, gives EA and EI where they are absent", "Pa", 2e7)
    shear_modulus: Number | None = _positive("G, gives GJ where it is absent", "Pa", 7e6)
    bending_damping: Number = Field(
        default=0.0, ge=0.0, description="Internal damping on the rate of curvature [N m^2 s].", examples=[1e-4]
    )
    torsional_damping: Number = Field(
        default=0.0, ge=0.0, description="Internal damping on the rate of twist [N m^2 s].", examples=[0.0]
    )
    axial_damping: Number | None = Field(
        default=None,
        ge=0.0,
        description=(
            "Internal damping on the rate of the axial strain [N s]; absent: 2 L/pi sqrt(mu EA), which damps the "
            "slowest wave of stretch critically; 0: waves of stretch ring on."
        ),
        examples=[3.6],
    )
    yield_strain: Number | None = _yield(
        "Bending strain of the outermost fibre at which the cable yields, eps_M: the curvature 2 eps_M/D", 0.01
    )
    yield_twist: Number | None = _yield(
        "Shear of the outermost fibre at which the cable yields in twist: the twist rate 2 eps_M/D", 0.02
    )
    yield_stretch: Number | None = _yield("Axial strain at which the cable yields", 0.005)
    memory_rate: Number | None = Field(
        default=None,
        gt=0.0,
        le=1e9,
        description="Rate at which a strain beyond yield is remembered, k_eps [1/s]; given with a yield strain only.",
        examples=[50.0],
    )
    hardening: Number = Field(
        default=0.1,
        ge=0.0,
        le=1.0,
        description="Share of the remembered strain that resists further yield, 0 (the paper's law) to 1.",
        examples=[0.1],
    )
    rest_shape: RestShape = Field(
        default="straight",
        description=(
            "The stress-free shape: `straight`, `initial` (that of the start shape) or points in order along the cable,"
            " 2D or 3D [m]."
        ),
        examples=["straight"],
    )
    point_masses: list[PointMassModel] = Field(
        default=[],
        max_length=MAX_POINT_MASSES,
        description="What else hangs on the cable, as a connector at its end.",
        examples=[[{"u": 1.0, "mass": 0.02}]],
    )
