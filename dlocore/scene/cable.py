"""The cable: geometry, density and section stiffnesses, and presets of real cables."""

import math
from dataclasses import dataclass, fields
from typing import Any, cast

from numpy.typing import ArrayLike

from dlocore.errors import SceneError, choice, instances, number
from dlocore.pickling import Checked
from dlocore.scene.points import points_along

MIN_LENGTH, MAX_LENGTH = 0.01, 1000.0  # [m]
MAX_POINT_MASSES = 32
_UNITS = {
    "bending_stiffness": "N m^2", "axial_stiffness": "N", "torsional_stiffness": "N m^2", "youngs_modulus": "Pa",
    "shear_modulus": "Pa",
}  # fmt: skip
STIFFNESSES = {  # that each modulus gives
    "youngs_modulus": ("bending_stiffness", "axial_stiffness"),
    "shear_modulus": ("torsional_stiffness",),
}


@dataclass(frozen=True, kw_only=True)
class PointMass:
    """A connector, plug or clip: a `mass` [kg] on the centreline at the material coordinate `u` [m].

    It has weight and inertia, and adds to the contact and friction forces of the cable at that point. It has no size,
    no stiffness, no drag and no rotational inertia (docs/model.md eq. 9a).

    Raises:
        SceneError: a value is not a finite number, or negative, or too large.
    """

    u: float
    mass: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "u", number("u", self.u, at_least=0.0, at_most=MAX_LENGTH, unit="m"))
        object.__setattr__(self, "mass", number("mass", self.mass, at_least=0.0, at_most=1e4, unit="kg"))


@dataclass(frozen=True, kw_only=True, eq=False)
class Cable(Checked):
    """A cable of round section, nearly inextensible, with independent section stiffnesses.

    Give each stiffness itself, or give `youngs_modulus` and `shear_modulus`. The moduli give the stiffnesses of a solid
    round section: EA = E pi D^2/4, EI = E pi D^4/64, GJ = G pi D^4/32 (docs/model.md eq. 2). Use them for solid rods
    only, because the strands of a cable slide on each other; docs/cable.md explains how to measure EI.

    EI and GJ are independent, because real wires do not follow the isotropic rule between them. The defaults are
    EA = 16 EI/D^2 (the solid section of the same EI) and GJ = EI (measured wires have 0.8 to 1.6 times EI). The default
    axial damping, 2 L/pi sqrt(mu EA), is critical for the slowest wave of stretch, so that such waves die out as fast
    as they can (docs/model.md eq. 7a).

    Defaults are stored as numbers: `dataclasses.replace(cable, bending_stiffness=...)` leaves EA, GJ and the axial
    damping as they were. To derive them anew, also pass `axial_stiffness=None`, `torsional_stiffness=None` and
    `axial_damping=None`. Moduli are converted to stiffnesses and not stored. To replace one, also pass None for the
    stiffnesses that it gives.

    Args:
        length: L [m], 0.01 to 1000.
        diameter: D [m].
        linear_density: mu [kg/m].
        bending_stiffness: EI [N m^2].
        axial_stiffness: EA [N].
        torsional_stiffness: GJ [N m^2].
        youngs_modulus: E [Pa], for EI and EA, whichever is not given.
        shear_modulus: G [Pa], for GJ.
        bending_damping: internal damping on the rate of curvature [N m^2 s].
        torsional_damping: internal damping on the rate of twist [N m^2 s].
        axial_damping: eta_e, internal damping on the rate of the axial strain [N s]; with 0, waves of stretch persist.
        yield_strain: the paper's eps_M in bending, a strain of the outermost fibre: the cable yields at the curvature
            2 eps_M/D (docs/model.md). None: elastic in bending.
        yield_twist: eps_M in twist, a shear of the outermost fibre: it yields at the twist rate 2 eps_M/D.
        yield_stretch: eps_M of the axial strain.
        memory_rate: the paper's k_eps [1/s], the rate at which strain beyond yield becomes permanent; required with any
            yield strain.
        hardening: share of the remembered strain that acts as a back stress, 0 (the paper's law) to 1.
        rest_shape: the stress-free shape, without twist: "straight", "initial" (the curve of the start shape), or
            points (n, 2 or 3) [m], 4 to 100,000 of them. A start with theta is twisted against it.
        point_masses: attached parts, such as a connector at an end.

    Raises:
        SceneError: a value is missing, not finite or out of range; a modulus is given with all the stiffnesses that it
            gives; the points of `rest_shape` are too few or all the same.
    """

    length: float
    diameter: float
    linear_density: float
    bending_stiffness: float | None = None
    axial_stiffness: float | None = None
    torsional_stiffness: float | None = None
    youngs_modulus: float | None = None
    shear_modulus: float | None = None
    bending_damping: float = 0.0
    torsional_damping: float = 0.0
    axial_damping: float | None = None
    yield_strain: float | None = None
    yield_twist: float | None = None
    yield_stretch: float | None = None
    memory_rate: float | None = None
    hardening: float = 0.1
    rest_shape: str | ArrayLike = "straight"
    point_masses: tuple[PointMass, ...] = ()

    def __post_init__(self) -> None:
        def put(name: str, value: Any) -> None:
            object.__setattr__(self, name, value)

        length = number("length", self.length, at_least=MIN_LENGTH, at_most=MAX_LENGTH, unit="m")
        diameter = number("diameter", self.diameter, above=0.0, at_most=length / 2, unit="m")
        put("length", length)
        put("diameter", diameter)
        put("linear_density", number("linear_density", self.linear_density, above=0.0, at_most=1e4, unit="kg/m"))
        for name, unit in _UNITS.items():
            if getattr(self, name) is not None:
                put(name, number(name, getattr(self, name), above=0.0, at_most=1e15, unit=unit))
        self._check_moduli()
        if self.bending_stiffness is None:
            if self.youngs_modulus is None:
                raise SceneError("bending_stiffness", None, "EI [N m^2], or youngs_modulus [Pa]", "It is missing")
            put("bending_stiffness", self.youngs_modulus * math.pi * diameter**4 / 64)
        if self.axial_stiffness is None:
            modulus = self.youngs_modulus
            solid = self.solid_axial_stiffness
            put("axial_stiffness", solid if modulus is None else modulus * math.pi * diameter**2 / 4)
        if self.torsional_stiffness is None:
            modulus = self.shear_modulus
            put(
                "torsional_stiffness",
                self.bending_stiffness if modulus is None else modulus * math.pi * diameter**4 / 32,
            )
        put("youngs_modulus", None)
        put("shear_modulus", None)
        put("bending_damping", number("bending_damping", self.bending_damping, at_least=0.0, unit="N m^2 s"))
        put("torsional_damping", number("torsional_damping", self.torsional_damping, at_least=0.0, unit="N m^2 s"))
        axial_damping = self.axial_damping
        if axial_damping is None:
            axial_damping = 2 * length / math.pi * math.sqrt(self.linear_density * cast(float, self.axial_stiffness))
        put("axial_damping", number("axial_damping", axial_damping, at_least=0.0, unit="N s"))
        yields = ("yield_strain", "yield_twist", "yield_stretch")
        for name in yields:
            if getattr(self, name) is not None:
                put(name, number(name, getattr(self, name), above=0.0, at_most=10.0))
                if self.memory_rate is None:
                    raise SceneError("memory_rate", None, f"k_eps [1/s], since {name} is given", "It is missing")
        if self.memory_rate is not None:
            put("memory_rate", number("memory_rate", self.memory_rate, above=0.0, at_most=1e9, unit="1/s"))
            if all(getattr(self, name) is None for name in yields):
                raise SceneError("yield_strain", None, "eps_M, since memory_rate is given", "It is missing")
        put("hardening", number("hardening", self.hardening, at_least=0.0, at_most=1.0))
        if isinstance(self.rest_shape, str):
            choice("rest_shape", self.rest_shape, ("straight", "initial"))
        else:
            put("rest_shape", points_along("rest_shape", self.rest_shape))
        put("point_masses", instances("point_masses", self.point_masses, PointMass, "PointMass"))
        if len(self.point_masses) > MAX_POINT_MASSES:
            raise SceneError("point_masses", f"{len(self.point_masses)} point masses", f"at most {MAX_POINT_MASSES}")
        for i, one in enumerate(self.point_masses):
            if not one.u <= length:
                raise SceneError(f"point_masses[{i}].u", one.u, f"0 to the cable's length, {length:g} [m]")

    def _check_moduli(self) -> None:
        """Refuse a modulus that changes nothing, because all the stiffnesses that it gives are given."""
        for modulus, stiffnesses in STIFFNESSES.items():
            if getattr(self, modulus) is not None and all(getattr(self, name) is not None for name in stiffnesses):
                both = " and ".join(stiffnesses)
                raise SceneError(modulus, getattr(self, modulus), f"either {modulus}, or {both}", "Both are given")

    @property
    def yields(self) -> bool:
        """Whether a yield strain is given, so that the cable may keep bends, twist or stretch."""
        return any(x is not None for x in (self.yield_strain, self.yield_twist, self.yield_stretch))

    @property
    def mass(self) -> float:
        """Total mass of the cable and its point masses [kg]."""
        return self.linear_density * self.length + sum(one.mass for one in self.point_masses)

    @property
    def solid_axial_stiffness(self) -> float:
        """EA of a solid section with the cable's EI, 16 EI/D^2 [N]: the default if no EA is given."""
        return 16 * cast(float, self.bending_stiffness) / self.diameter**2

    @staticmethod
    def preset(name: str, **overrides: Any) -> "Cable":
        """Return the preset `name` with the given fields replaced; a modulus replaces the stiffnesses that it gives.

        Raises:
            SceneError: no such preset or field.
        """
        choice("preset", name, tuple(PRESETS))
        unknown = set(overrides) - {f.name for f in fields(Cable)}
        if unknown:
            raise SceneError(sorted(unknown)[0], overrides[sorted(unknown)[0]], "a field of Cable")
        given = [modulus for modulus in STIFFNESSES if overrides.get(modulus) is not None]
        replaced = dict.fromkeys(stiffness for modulus in given for stiffness in STIFFNESSES[modulus])
        return Cable(**{**PRESETS[name].values, **replaced, **overrides})


@dataclass(frozen=True)
class Preset:
    """Measured values of a real cable and where they come from."""

    values: dict[str, float]
    source: str


_WIRES = "measured wires of github.com/qj25/adapteddlo_muj (MIT), middle of the published range; length 1 m assumed"
_ELECTRIC = (
    "identified electric cables of github.com/sebtiburzio/floating_PAC_model, middle of the published range; "
    "length 1 m assumed"
)


def _wire(density: float, diameter: float, EI: float, GJ: float | None) -> dict[str, float]:
    values = {"length": 1.0, "linear_density": density, "diameter": diameter, "bending_stiffness": EI}
    return values if GJ is None else values | {"torsional_stiffness": GJ}


PRESETS: dict[str, Preset] = {
    "paper": Preset(
        _wire(0.05, 0.005, 1e-3, 1e-3) | {"axial_stiffness": 640.0},
        "the planar case of the paper's Fig. 1 with the material chosen in docs/model.md (the paper gives none)",
    ),
    "white-wire": Preset(_wire(0.0174, 0.006, 8.8e-5, 6.9e-5), _WIRES),
    "black-wire": Preset(_wire(0.0272, 0.006, 1.1e-3, 1.4e-3), _WIRES),
    "red-wire": Preset(_wire(0.0215, 0.006, 7.9e-4, 1.3e-3), _WIRES),
    "black-electric-cable": Preset(_wire(1.0, 0.020, 0.12, None), _ELECTRIC),
    "orange-electric-cable": Preset(_wire(0.55, 0.015, 0.09, None), _ELECTRIC),
    "tent-pole": Preset(
        _wire(0.069, 0.007, 3.54, 2.36),
        "simulator settings of github.com/burakaksoy (deformable pole); length 1 m assumed",
    ),
}
