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
    """A connector, plug or clip at one point of the cable: weight and inertia without size, drag or rotation."""

    u: Coordinate
    mass: Number = Field(ge=0.0, le=1e4, description="Mass [kg].", examples=[0.02])


class CableModel(Model):
    """A cable of round section. `length`, `diameter` and `linear_density` are required unless `preset` gives them.

    Give either the stiffnesses or the moduli; a modulus beside all the stiffnesses that it gives is refused. Moduli are
    converted as for a solid round section: EA = E pi D^2/4, EI = E pi D^4/64, GJ = G pi D^4/32. This is right for solid
    rods only, because the strands of a cable slide on each other: with the modulus of copper, a diameter of 6 mm gives
    an EI of 7 N m^2; measured wires of that size have 1e-4 to 1e-3.
    """

    preset: str | None = Field(
        default=None,
        description="Name of a preset (`GET /v1/cables`); other fields given here override its values, and moduli the "
        "stiffnesses that they give.",
        examples=list(PRESETS)[:2],
    )
    length: Number | None = Field(
        default=None, ge=MIN_LENGTH, le=MAX_LENGTH, description="Length L [m].", examples=[1.0]
    )
    diameter: Number | None = _positive("Diameter D, at most half the length", "m", 0.005, 500.0)
    linear_density: Number | None = _positive("Mass per length", "kg/m", 0.05, 1e4)
    bending_stiffness: Number | None = _positive("Bending stiffness EI", "N m^2", 1e-3)
    axial_stiffness: Number | None = _positive("Axial stiffness EA", "N", 640.0)
    torsional_stiffness: Number | None = _positive("Torsional stiffness GJ", "N m^2", 1e-3)
    youngs_modulus: Number | None = _positive("Young's modulus E; gives EA and EI, whichever is absent", "Pa", 2e7)
    shear_modulus: Number | None = _positive("Shear modulus G; gives GJ, which has to be absent", "Pa", 7e6)
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
            "slowest stretch wave critically; 0: stretch waves keep ringing."
        ),
        examples=[3.6],
    )
    yield_strain: Number | None = _yield(
        "Bending strain eps_M of the outermost fibre at which the cable yields, at a curvature of 2 eps_M/D", 0.01
    )
    yield_twist: Number | None = _yield(
        "Shear eps_M of the outermost fibre at which the cable yields in twist, at a twist rate of 2 eps_M/D", 0.02
    )
    yield_stretch: Number | None = _yield("Axial strain at which the cable yields", 0.005)
    memory_rate: Number | None = Field(
        default=None,
        gt=0.0,
        le=1e9,
        description="Rate k_eps at which a strain beyond yield is remembered [1/s]; only with a yield limit.",
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
            "The stress-free shape, without twist: `straight`, `initial` (the curve of the start shape) or points in "
            "order along the cable, 2D or 3D [m]. A start with angles of its sections is twisted against it."
        ),
        examples=["straight"],
    )
    point_masses: list[PointMassModel] = Field(
        default=[],
        max_length=MAX_POINT_MASSES,
        description="Parts attached to the cable, such as a connector at its end.",
        examples=[[{"u": 1.0, "mass": 0.02}]],
    )
