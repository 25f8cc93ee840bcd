"""The parameters that can be identified: how each enters a candidate, and on which scale it is sought."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from dlocore.errors import SceneError, instances
from dlocore.identify.candidate import Candidate

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Parameter:
    """One number of a candidate.

    Attributes:
        name: as in results, e.g. "bending_stiffness" or "rest_curvature[2][0]".
        unit: SI.
        logarithmic: it varies by factors, otherwise by `scale`.
        scale: [unit] a usual value, for parameters that are not logarithmic.
        least: lower bound for parameters that are not logarithmic.
        prior: standard deviation of its coordinate that is assumed before any recording; infinite if none is.
        centred: whether the search pulls the coordinate to 0, as the prior says; otherwise the prior only limits steps.
        get, put: read it from a candidate; return a candidate with it.
        first: [unit] the value to begin with if none is given; None: there always is one.
    """

    name: str
    unit: str
    logarithmic: bool
    scale: float
    least: float
    prior: float
    centred: bool
    get: Callable[[Candidate], float]
    put: Callable[[Candidate, float], Candidate]
    first: float | None = None

    def coordinate(self, value: float) -> float:
        """Return the value on the scale on which it is sought."""
        return float(np.log(value)) if self.logarithmic else value / self.scale

    def value(self, coordinate: float) -> float:
        """Return the value of a coordinate."""
        return float(np.exp(coordinate)) if self.logarithmic else coordinate * self.scale


DEFAULT = ("bending_stiffness", "drag", "drag_quadratic", "bending_damping")
_INDEXED = re.compile(r"(rest_curvature|clamp_angles|marker_offsets)\[(\d+)\]\[([01])\]")
_SEVERAL = {"rest_curvature": ("1/m", 2.0), "clamp_angles": ("rad", 0.2), "marker_offsets": ("m", 0.01)}
_NEEDED = {"clamp_angles": "where a recording has a clamp", "marker_offsets": "where a recording has free markers"}
_PRIOR_LOG = 3.0  # standard deviation of the logarithms: a factor of 20 either way is no surprise
_TURNING = ("torsional_stiffness", "turn", "yield_strain", "rest_curvature", "marker_offsets")
MEMORY_RATE = 100.0  # [1/s] of a cable whose yield strain is identified, if none is given
PLACES = 5  # along the cable at which its rest curvature is sought


def _of_cable(name: str, unit: str, first: float | None = None, **needs: float) -> Parameter:
    """Return a field of the cable as a parameter; `needs` are values for other fields, where those are None."""

    def put(c: Candidate, x: float) -> Candidate:
        missing = {field: value for field, value in needs.items() if getattr(c.cable, field) is None}
        changes: Any = {name: x, **missing}
        return replace(c, cable=replace(c.cable, **changes))

    return Parameter(
        name=name, unit=unit, logarithmic=True, scale=1.0, least=0.0, prior=_PRIOR_LOG, centred=False,
        get=lambda c: cast(float, getattr(c.cable, name)), put=put, first=first,
    )  # fmt: skip


def _of_environment(name: str, unit: str, scale: float) -> Parameter:
    """Return a field of the environment as a parameter, which begins with its usual value."""

    def put(c: Candidate, x: float) -> Candidate:
        changes: Any = {name: x}
        return replace(c, environment=replace(c.environment, **changes))

    return Parameter(
        name=name, unit=unit, logarithmic=False, scale=scale, least=0.0, prior=np.inf, centred=False,
        get=lambda c: cast(float, getattr(c.environment, name)), put=put, first=scale,
    )  # fmt: skip


_SCALARS = {
    p.name: p
    for p in (
        _of_cable("bending_stiffness", "N m^2"),
        _of_cable("bending_damping", "N m^2 s", first=1e-4),
        _of_environment("drag", "N s/m^2", 0.05),
        _of_environment("drag_quadratic", "N s^2/m^3", 0.02),
        _of_cable("torsional_stiffness", "N m^2"),
        _of_cable("linear_density", "kg/m"),
        Parameter(
            name="length_ratio", unit="", logarithmic=True, scale=1.0, least=0.0, prior=0.01, centred=True,
            get=lambda c: c.length_ratio, put=lambda c, x: replace(c, length_ratio=x),
        ),
        Parameter(
            name="turn", unit="rad", logarithmic=False, scale=1.0, least=-np.inf, prior=1.0, centred=True,
            get=lambda c: c.turn, put=lambda c, x: replace(c, turn=x),
        ),
        _of_cable("yield_strain", "", first=0.02, memory_rate=MEMORY_RATE),
    )
}  # fmt: skip
SCALARS = tuple(_SCALARS)


def parameters(
    names: tuple[str, ...], clamps: int, free: Sequence[int] = (), places: int = PLACES
) -> tuple[Parameter, ...]:
    """Return the parameters of the given names; "rest_curvature", "clamp_angles" and "marker_offsets" mean several.

    Args:
        names: of the parameters.
        clamps: their number.
        free: markers that nothing holds.
        places: number of places along the cable at which its rest curvature is sought.

    Raises:
        SceneError: a name is no text, is unknown, is given twice, or refers to a place, clamp or marker that does not
            exist.
    """
    there = {"rest_curvature": range(places), "clamp_angles": range(clamps), "marker_offsets": [int(i) for i in free]}
    found: list[Parameter] = []
    for name in instances("parameters", names, str, "names"):
        match = _INDEXED.fullmatch(name)
        several = match[1] if match else name
        if several in there and not there[several]:
            raise SceneError("parameters", name, _NEEDED[several])
        if match and int(match[2]) not in there[several]:
            numbers = ", ".join(str(i) for i in there[several])
            raise SceneError("parameters", name, f"{several}[i][0] and {several}[i][1] for i of {numbers}")
        if match:
            found.append(_component(several, int(match[2]), int(match[3])))
        elif several in there:
            found += [_component(several, i, d) for i in there[several] for d in range(2)]
        elif name in _SCALARS:
            found.append(_SCALARS[name])
        else:
            raise SceneError("parameters", name, "one of " + ", ".join([*SCALARS, *_SEVERAL]))
    if len({p.name for p in found}) != len(found):
        raise SceneError("parameters", names, "each parameter once")
    if not found:
        raise SceneError("parameters", names, "at least one parameter")
    return tuple(found)


def prepared(candidate: Candidate, names: tuple[str, ...], clamps: int, markers: int = 0) -> Candidate:
    """Return the candidate with everything that the parameters vary in place, for so many clamps and markers.

    Raises:
        SceneError: its cable is not straight when stress-free.
    """
    if not isinstance(candidate.cable.rest_shape, str) or candidate.cable.rest_shape != "straight":
        allowed = '"straight"; stress-free bends are identified as the parameter "rest_curvature"'
        raise SceneError("cable.rest_shape", candidate.cable.rest_shape, allowed)
    if any(n.startswith("rest_curvature") for n in names) and candidate.rest_curvature is None:
        candidate = replace(candidate, rest_curvature=np.zeros((PLACES, 2)), twist=True)
    if any(n.startswith("clamp_angles") for n in names) and candidate.clamp_angles is None:
        candidate = replace(candidate, clamp_angles=np.zeros((clamps, 2)))
    if any(n.startswith("marker_offsets") for n in names) and candidate.marker_offsets is None:
        candidate = replace(candidate, marker_offsets=np.zeros((markers, 2)))
    for name in names:
        parameter = _SCALARS.get(name)
        if parameter is not None and parameter.first is not None and not (parameter.get(candidate) or 0.0) > 0.0:
            candidate = parameter.put(candidate, parameter.first)
    if "turn" in names or "torsional_stiffness" in names or candidate.yields:
        candidate = replace(candidate, twist=True)
    return candidate


def clamp_needed(chosen: Sequence[Parameter], candidate: Candidate) -> str:
    """Return a message on what depends on the angle of the sections, which only a clamp shows; "" if nothing does."""
    sought = {p.name.partition("[")[0] for p in chosen}
    needing = [name for name in _TURNING if name in sought] or (["a cable that yields"] if candidate.twist else [])
    return f"Without a clamp nothing shows how the sections are turned, which {needing[0]} needs" if needing else ""


def _component(name: str, i: int, d: int) -> Parameter:
    unit, scale = _SEVERAL[name]

    def put(c: Candidate, x: float) -> Candidate:
        values = np.array(getattr(c, name))
        values[i, d] = x
        changes: Any = {name: values}
        return replace(c, **changes)

    return Parameter(
        name=f"{name}[{i}][{d}]", unit=unit, logarithmic=False, scale=scale, least=-np.inf, prior=1.0, centred=True,
        get=lambda c: float(getattr(c, name)[i, d]), put=put,
    )  # fmt: skip
