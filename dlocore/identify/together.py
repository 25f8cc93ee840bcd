"""Whether recordings can be of one cable: none twice, none in other units, and facts that agree."""

from collections.abc import Sequence
from itertools import combinations
from typing import cast

import numpy as np
from numpy.typing import NDArray

from dlocore.errors import MILLIMETRES, SceneError
from dlocore.recordings import Recording

Floats = NDArray[np.float64]

LONGEST = 50.0  # [m] of a cable: a longer one was tracked in millimetres
_STRETCHED = 2.0  # times the length that its coordinates give: no cable is longer
_ALIKE = 0.02  # relative, within which lengths, diameters and densities of one cable agree


def check_together(recordings: Sequence[Recording]) -> None:
    """Refuse recordings that can't be of one cable, each given once, in metres.

    Raises:
        SceneError: one is in other units, is given twice, or differs from another in length, diameter, density or point
            masses.
    """
    for recording in recordings:
        _check_metres(recording)
    for first, second in combinations(recordings, 2):
        if _same(first.times, second.times) and _same(first.markers, second.markers):
            given = f"times and markers of {first.name!r} again"
            twice = "Data that count twice make the intervals too narrow"
            raise SceneError(second.place, given, "each recording once", twice)
        for name, unit in (("length", "m"), ("diameter", "m"), ("linear_density", "kg/m")):
            one, other = getattr(first, name), getattr(second, name)
            if one is not None and other is not None and abs(other - one) > _ALIKE * one:
                allowed = f"{one:.4g} {unit} as of {first.name!r}, to {_ALIKE:.0%}"
                raise SceneError(f"{second.place}.{name}", f"{other:.4g} {unit}", allowed, "All must be of one cable")
        if first.point_masses and second.point_masses and not _hang_alike(first, second):
            allowed = f"those of {first.name!r}, to {_ALIKE:.0%}"
            given = "; ".join(f"{one.mass:.4g} kg at {one.u:.4g} m" for one in second.point_masses)
            raise SceneError(f"{second.place}.point_masses", given, allowed, "All must be of one cable")


def _hang_alike(first: Recording, second: Recording) -> bool:
    """Tell whether the same point masses are on the cables of two recordings, in the same order."""
    if len(first.point_masses) != len(second.point_masses):
        return False
    return all(
        abs(other.mass - one.mass) <= _ALIKE * one.mass and abs(other.u - one.u) <= _ALIKE * cast(float, first.length)
        for one, other in zip(first.point_masses, second.point_masses, strict=True)
    )


def _check_metres(recording: Recording) -> None:
    length, u = cast(float, recording.length), cast(Floats, recording.u)
    if length > LONGEST:
        allowed = f"at most {LONGEST:g} m"
        raise SceneError(f"{recording.place}.length", f"{length:.4g} m", allowed, MILLIMETRES)
    steps = np.linalg.norm(np.diff(cast(Floats, recording.markers), axis=1), axis=2)
    tracked = float(np.nanmedian(np.nansum(steps, axis=1)))
    if tracked > _STRETCHED * (u[-1] - u[0]):
        allowed = f"about {u[-1] - u[0]:.4g} m, as `u` says"
        given = f"{tracked:.4g} m from the first to the last"
        raise SceneError(f"{recording.place}.markers", given, allowed, MILLIMETRES)


def _same(a: object, b: object) -> bool:
    return np.array_equal(cast(Floats, a), cast(Floats, b), equal_nan=True)
