"""A start with less room between two grippers than the cable is long there: it bows out in long waves.

Which waves it takes up its length with is not given. Moved as little as possible it wrinkles as finely as its grid
allows. Wrinkles may leave the plane, and then the cable, smoothed out, is twisted by their writhe: clamps at a start
that settles were turned by 0.3 rad against each other on 486 control points, and not on 64.
"""

from itertools import pairwise
from typing import cast

import numpy as np
from numpy.typing import NDArray

from dlocore.kernels.basis import Tables
from dlocore.problem.problem import Problem
from dlocore.scene.paths import Waypoints

Floats = NDArray[np.float64]

_SQUEEZED = 5e-3  # of the length between two grasps: a start that lacks less room hardly wrinkles
_WAVE = 0.05  # of the length: in shorter waves a displacement costs more
_SPRING = 1e-2  # of EA/L^2: the spring that holds a displacement back
_PLACES = 65  # between two grasps at which the length of the start is measured


def is_squeezed(problem: Problem) -> bool:
    """Tell whether a start has less room between two grasps than the cable is long there.

    Only moving it to first waypoints (`brought`) takes room away from it: otherwise it has the length of the cable.
    """
    held = [g for g in problem.scene.grasps if g.start == 0.0]
    if len(held) < 2 or not any(isinstance(g.path, Waypoints) for g in held):
        return False
    start = problem.start
    for a, b in pairwise(sorted(g.u for g in held)):
        u = np.linspace(a, b, _PLACES)
        speed = np.linalg.norm(start(u, 1), axis=1)
        if np.mean(speed / (1.0 + start.strain_at(u))) < 1.0 - _SQUEEZED:
            return True
    return False


def in_long_waves(tables: Tables, axial_stiffness: float, length: float) -> tuple[Tables, float]:
    """Return tables whose `unit` also weighs how a displacement d bends, and the strength of the spring [N/m^2].

    The energy of the spring is strength/2 times the integral of |d|^2 + w^4 |d''|^2 along the cable, with w of `_WAVE`.
    """
    points = tables.curvature
    unit = cast(Floats, tables.unit).copy()
    for i in range(4):
        for o in range(4 - i):
            bends = points.w * points.b2[:, i] * points.b2[:, i + o]
            np.add.at(unit[:, o], points.first + i, (_WAVE * length) ** 4 * bends)
    return tables._replace(unit=unit), _SPRING * axial_stiffness / length**2
