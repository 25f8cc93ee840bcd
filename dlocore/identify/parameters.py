"""The parameters that can be identified: how each enters a candidate, and on which scale it is sought."""

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from dlocore.errors import SceneError
from dlocore.identify.candidate import Candidate

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Parameter:
    """One number of a candidate.

    Attributes:
        name: as in results, e.g. "bending_stiffness" or "rest_curvature[2][0]".
        unit: SI.
        logarithmic: it varies by factors, otherwise by `scale`.
        scale: [unit] a usual value; the prior's standard deviation for parameters that may have either sign.
        least: lower bound for parameters that are not logarithmic.
        get, put: read it from a candidate; return a candidate with it.
    """

    name: str
    unit: str
    logarithmic: bool
    scale: float
    least: float
    get: Callable[[Candidate], float]
    put: Callable[[Candidate, float], Candidate]

    def coordinate(self, value: float) -> float:
        """Return the value on the scale on which it is sought."""
        return float(np.log(value)) if self.logarithmic else value / self.scale

    def value(self, coordinate: float) -> float:
        """Return the value of a coordinate."""
        return float(np.exp(coordinate)) if self.logarithmic else coordinate * self.scale


SCALARS = (
    "bending_stiffness",
    "bending_damping",
    "drag",
    "drag_quadratic",
    "torsional_stiffness",
    "linear_density",
    "length_ratio",
    "turn",
    "yield_strain",
)
DEFAULT = ("bending_stiffness", "drag", "drag_quadratic", "bending_damping")
_FIRST = {"bending_damping": 1e-4, "drag": 0.05, "drag_quadratic": 0.02, "yield_strain": 0.02}  # if none is given
_INDEXED = re.compile(r"(rest_curvature|clamp_angles|marker_offsets)\[(\d+)\]\[([01])\]")
_SEVERAL = {"rest_curvature": ("1/m", 2.0), "clamp_angles": ("rad", 0.2), "marker_offsets": ("m", 0.01)}
_NEEDED = {"clamp_angles": "where a recording has a clamp", "marker_offsets": "where a recording has free markers"}
PLACES = 5  # along the cable at which its rest curvature is sought


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
        SceneError: a name is unknown, is given twice, or refers to a place, clamp or marker that does not exist.
    """
    there = {"rest_curvature": range(places), "clamp_angles": range(clamps), "marker_offsets": [int(i) for i in free]}
    found: list[Parameter] = []
    for name in names:
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
        elif name in SCALARS:
            found.append(_scalar(name))
        else:
            raise SceneError("parameters", name, "one of " + ", ".join([*SCALARS, *_SEVERAL]))
    if len({p.name for p in found}) != len(found):
        raise SceneError("parameters", names, "each parameter once")
    if not found:
        raise SceneError("parameters", names, "at least one parameter")
    return tuple(found)


def prepared(candidate: Candidate, names: tuple[str, ...], clamps: int, markers: int = 0) -> Candidate:
    """Return the candidate with everything that the parameters vary in place, for so many clamps and markers."""
    if any(n.startswith("rest_curvature") for n in names) and candidate.rest_curvature is None:
        candidate = replace(candidate, rest_curvature=np.zeros((PLACES, 2)), twist=True)
    if any(n.startswith("clamp_angles") for n in names) and candidate.clamp_angles is None:
        candidate = replace(candidate, clamp_angles=np.zeros((clamps, 2)))
    if any(n.startswith("marker_offsets") for n in names) and candidate.marker_offsets is None:
        candidate = replace(candidate, marker_offsets=np.zeros((markers, 2)))
    for name in names:
        if name in _FIRST:
            parameter = _scalar(name)
            if not (parameter.get(candidate) or 0.0) > 0.0:
                candidate = parameter.put(candidate, _FIRST[name])
    if "turn" in names or "torsional_stiffness" in names or candidate.yields:
        candidate = replace(candidate, twist=True)
    return candidate


def _scalar(name: str) -> Parameter:
    if name in ("drag", "drag_quadratic"):
        unit, scale = ("N s/m^2", 0.05) if name == "drag" else ("N s^2/m^3", 0.02)

        def put(c: Candidate, x: float) -> Candidate:
            changes: Any = {name: x}
            return replace(c, environment=replace(c.environment, **changes))

        return Parameter(name, unit, False, scale, 0.0, lambda c: cast(float, getattr(c.environment, name)), put)
    if name == "turn":
        return Parameter(
            name, "rad", False, 1.0, -np.inf, lambda c: c.turn, lambda c, x: replace(c, turn=x)
        )  # fmt: skip
    if name == "length_ratio":
        return Parameter(name, "", True, 0.01, 0.0, lambda c: c.length_ratio, lambda c, x: replace(c, length_ratio=x))
    units = {"bending_stiffness": "N m^2", "torsional_stiffness": "N m^2", "bending_damping": "N m^2 s"}

    def put_cable(c: Candidate, x: float) -> Candidate:
        changes: dict[str, Any] = {name: x}
        if name == "yield_strain" and c.cable.memory_rate is None:
            changes["memory_rate"] = 100.0
        return replace(c, cable=replace(c.cable, **changes))

    unit = units.get(name, "kg/m" if name == "linear_density" else "")
    return Parameter(name, unit, True, 1.0, 0.0, lambda c: cast(float, getattr(c.cable, name)), put_cable)


def _component(name: str, i: int, d: int) -> Parameter:
    unit, scale = _SEVERAL[name]

    def put(c: Candidate, x: float) -> Candidate:
        values = np.array(getattr(c, name))
        values[i, d] = x
        changes: Any = {name: values}
        return replace(c, **changes)

    return Parameter(
        f"{name}[{i}][{d}]", unit, False, scale, -np.inf, lambda c: float(getattr(c, name)[i, d]), put
    )  # fmt: skip
