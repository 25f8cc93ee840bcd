"""Where along the cable knots are needed: at grasps, loads, point masses and sharp bends, and closer beside them."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from dlocore.scene.scene import AUTO_TARGET, Scene

Floats = NDArray[np.float64]

# Grading of the knots towards a feature: exponent and width. An interior point force makes r''' jump and bends sharply
# beside it; at an end or at a held direction a weaker grading serves better (docs/model.md).
_INTERIOR = (0.6, 0.02)
_END = (0.3, 0.04)
OPENING = (1.0, 0.01)  # a start that turns sharply: the corner would be another one on every grid
LASTING = (1.3, 0.005)  # ... and may be free of stress, so that it stays and swings: it needs several spans for that
SAME = 1e-9  # of the length: features this close are one
_TIP = 2e-3  # of the length: the longest end beyond a point that is held or loaded that needs no span of its own, ...
_ALONE = 0.1  # ... where nothing else holds or loads the cable so near to that end
_OF_TARGET = 0.1  # of the error that is aimed at: the longest such end beyond a held direction


class Features(NamedTuple):
    """Places that knots are needed at and graded towards, as `kernels.basis.graded_knots` takes them.

    Attributes:
        u: (m,) [m], sorted.
        multiplicity: of the knot at each (m,).
        power, width: grading exponent, and width in parts of the length (m,).
        least: number of control points that has them all; with kinks, two spans between any two, as they cost one.
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
        apart: one knot serves a bend and what is no farther from it [m].
        kinks: the angle of the sections may have kinks where directions are held, for which these knots are triple.
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
    """Return how long an end beyond what is held, loaded or heavy at `u` [m] may be that needs no span of its own [m].

    A tip, no longer than half a diameter, has no moment and does not bend: nothing is lost where it has no span of its
    own. That would be so short that it folds, or strains, before it bends, and that what the time spline misses of the
    motion is many times as long. Where a direction is held the tip has to bend with the cable, whose end that makes
    stiffer: the motion is off by about half of what the tip is long, a twentieth of the error that is aimed at.
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
    """Return where a knot for what is at `u` [m] belongs: at an end that only a tip lies beyond."""
    end = _end_near(scene, u)
    return end if abs(u - end) <= longest_tip(scene, u, directed) else u


def free_ends(scene: Scene) -> tuple[bool, bool]:
    """Return whether the direction of the cable is free, at least for a time, at its two ends."""
    length = scene.cable.length

    def free(end: float) -> bool:
        for g in scene.grasps:
            if g.hold != "point" and abs(_without_tip(scene, g.u, True) - end) <= SAME * length:
                return g.start > 0 or g.release_time is not None
        return True

    return free(0.0), free(length)
