"""Where along the cable knots are needed: at grasps, loads, point masses and sharp bends, and denser near them."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dlocore.scene.scene import AUTO_TARGET, Scene

Floats = NDArray[np.float64]

# Grading of the knots towards a feature: exponent and width. At an interior point force r''' jumps, and the cable bends
# sharply beside it; at an end or a held direction a weaker grading is better (docs/model.md).
_INTERIOR = (0.6, 0.02)
_END = (0.3, 0.04)
OPENING = (1.0, 0.01)  # a start that turns sharply: the corner would be a different one on every grid
LASTING = (1.3, 0.005)  # ... if the corner may be stress-free, so that it stays and swings, which needs several spans
SAME = 1e-9  # of the length: features this close are one
_TIP = 2e-3  # of the length: longest tip beyond a grasp, load or point mass that needs no span of its own, ...
_ALONE = 0.1  # ... if no other one is within this part of the length from that end
_OF_TARGET = 0.1  # of the target error: longest such tip beyond a held direction


class Features(NamedTuple):
    """Places that knots are needed at and graded towards, as `kernels.basis.graded_knots` takes them.

    Attributes:
        u: (m,) [m], sorted.
        multiplicity: of the knot at each (m,).
        power, width: grading exponent, and width in parts of the length (m,).
        least: number of control points needed for all of them; with kinks, also for two spans between each two.
    """

    u: Floats
    multiplicity: NDArray[np.int64]
    power: Floats
    width: Floats
    least: int


def find_features(
    scene: Scene,
    bends: Sequence[float] = (),
    grading: tuple[float, float] = OPENING,
    apart: float = 0.0,
    kinks: bool = False,
) -> Features:
    """Return the features of a scene, with the sharp `bends` of its start.

    Args:
        bends: (k,) [m].
        grading: towards them, exponent and width.
        apart: a bend shares the knot of a feature that is no farther from it [m].
        kinks: whether the knots at held directions are triple, so that the angle of the sections may have kinks there.
    """
    length = scene.cable.length
    found: dict[float, tuple[int, float, float]] = {}
    directed = 3 if kinks else 2
    places = [(g.u, 1 if g.hold == "point" else directed) for g in scene.grasps]
    places += [(load.u, 1) for load in scene.loads] + [(one.u, 1) for one in scene.cable.point_masses]
    for at, multiplicity in places:
        place = _without_tip(scene, at, multiplicity > 1)
        u = next((v for v in found if abs(v - place) <= SAME * length), place)
        at_end = min(u, length - u) <= SAME * length
        power, width = _END if at_end or multiplicity > 1 else _INTERIOR
        before = found.get(u, (0, 0.0, 1.0))
        found[u] = (max(before[0], multiplicity), max(before[1], power), min(before[2], width))
    for u in bends:
        near = [v for v in found if abs(v - u) <= apart]
        place = min(near, key=lambda v: abs(v - u)) if near else u
        multiplicity, power, width = found.get(place, (1, *grading))
        found[place] = (multiplicity, max(power, grading[0]), min(width, grading[1]))
    order = sorted(found)
    rows = [found[u] for u in order]
    inside = [row[0] for u, row in zip(order, rows, strict=True) if 0.0 < u < length]
    return Features(
        np.array(order, float),
        np.array([row[0] for row in rows], np.int64),
        np.array([row[1] for row in rows], float),
        np.array([row[2] for row in rows], float),
        max(5, 4 + sum(inside) + (len(inside) + 1 if kinks else 0)),
    )


def longest_tip(scene: Scene, u: float, directed: bool) -> float:
    """Return the longest tip of the cable [m] beyond a grasp, load or point mass at `u` [m] without a span of its own.

    A tip of up to half a diameter carries no moment and does not bend, so nothing is lost without a span for it. Such a
    short span would fold, or strain, before it bends, and the error of the time spline would be many times its length.
    If a direction is held, the tip has to bend with the cable, which makes the cable's end stiffer. The error of the
    motion is then about half the length of the tip, and at most a twentieth of the target error.
    """
    length = scene.cable.length
    if [v for v in scene.places if abs(v - _end_near(scene, u)) <= _ALONE * length] != [u]:
        return 0.0
    tip = min(0.5 * scene.cable.diameter, _TIP * length)
    return min(tip, _OF_TARGET * (scene.quality.target_error or AUTO_TARGET * length)) if directed else tip


def _end_near(scene: Scene, u: float) -> float:
    length = scene.cable.length
    return 0.0 if u < 0.5 * length else length


def _without_tip(scene: Scene, u: float, directed: bool) -> float:
    """Return where to put the knot for a feature at `u` [m]: at the end of the cable if only a tip lies beyond it."""
    end = _end_near(scene, u)
    return end if abs(u - end) <= longest_tip(scene, u, directed) else u


def free_ends(scene: Scene) -> tuple[bool, bool]:
    """Return for both ends of the cable whether its direction there is free, at least for a time."""
    length = scene.cable.length

    def free(end: float) -> bool:
        for g in scene.grasps:
            if g.hold != "point" and abs(_without_tip(scene, g.u, True) - end) <= SAME * length:
                return g.start > 0 or g.release_time is not None
        return True

    return free(0.0), free(length)
