"""Bends beside grippers that are sharper than a grid can show.

A gripper that holds a direction bends the cable by its moment: beside it EI times the curvature, inside the cable EI
times the jump of the curvature, is the part of the moment across the cable. The curvature of the spline falls short of
that where the cable bends within a span or two. This holds for a cable whose stress-free shape is straight.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from dlocore.answer.parts import GraspReaction
from dlocore.problem.features import SAME
from dlocore.problem.problem import Problem
from dlocore.spline import SplineSurface, spline_at

Floats = NDArray[np.float64]

FALLS_SHORT = 0.25  # of the curvature by the moment: a surface that shows so much less of it gets a note, if the ...
GENTLE = 50.0  # ... radius is less than this many diameters
_SHARE = 0.5  # of what the curvature misses: the error of a moment was less on grids that agree
_DAMPED = 0.1  # of the curvature by the moment: with more from damping, it does not tell the curvature
_WHILE = 10  # part of the motion in whose middle damping is judged: a rate passes through zero now and then
_INSTANT = 1e-5  # of the horizon, between two curvatures of which the rate is found


def missing_moments(problem: Problem, knots: Floats, control_points: Floats, moments: Floats) -> Floats:
    """Return a least error of the moment (grasps, 3) [N m] of each grasp on a cable at rest; (grasps,) [N m].

    Two grids may agree on the moment where both err, but not on the curvature. It is zero where the moment says nothing
    of the curvature.

    Args:
        problem: the posed scene.
        knots: (n_u + 4,) [m].
        control_points: in the world (n_u, 4) [m, m, m, rad].
        moments: moment of each grasp (grasps, 3) [N m].
    """

    def derivative(u: Floats, order: int) -> Floats:
        return spline_at(knots, control_points[:, :3], u, order)[None]

    found = np.zeros(len(moments))
    for i in _bending(problem, knots, list(moments)):
        tangent, shown = _beside(problem, i, derivative)
        found[i] = _SHARE * _stiffness(problem) * np.linalg.norm(_by_moment(problem, moments[i], tangent) - shown)
    return found


class HiddenBend(NamedTuple):
    """A bend beside the grasp with the index `grasp`.

    Attributes:
        by_moment, error: its curvature by the moment, and the error of that, if it is known [1/m].
        shown: its curvature on the surface [1/m].
    """

    grasp: int
    by_moment: float
    error: float | None
    shown: float


def sharpest_hidden(problem: Problem, surface: SplineSurface, grasps: tuple[GraspReaction, ...]) -> HiddenBend | None:
    """Return the sharpest bend beside a gripper of which the surface shows too little, if there is one.

    Each gripper is judged at the time of the largest curvature by its moment, while bending damping is but a small part
    of that.
    """
    found = []
    cable, stiffness = problem.scene.cable, _stiffness(problem)
    gentle = 1.0 / (GENTLE * cable.diameter)
    plastic = problem.choices["plasticity"].active
    for i in [] if plastic else _bending(problem, surface.knots_u, [grasp.moment for grasp in grasps]):
        grasp = grasps[i]
        if np.linalg.norm(grasp.moment, axis=1).max() <= gentle * stiffness:
            continue
        times = grasp.times.clip(0.0, surface.horizon)
        tangents, shown = _beside(problem, i, partial(_derivative, surface, times))
        sizes = np.linalg.norm(_by_moment(problem, grasp.moment, tangents), axis=1)
        if cable.bending_damping > 0.0:
            from scipy.ndimage import maximum_filter1d  # slow to import

            around = (times + _INSTANT * surface.horizon * np.array([[-1.0], [1.0]])).clip(0.0, surface.horizon)
            was, becomes = (_beside(problem, i, partial(_derivative, surface, t))[1] for t in around)
            rates = np.linalg.norm(becomes - was, axis=1) / (around[1] - around[0])
            damped = cable.bending_damping / stiffness * maximum_filter1d(rates, 1 + len(rates) // _WHILE)
            sizes[damped > _DAMPED * sizes] = 0.0
        k = int(np.argmax(sizes))
        error = None if grasp.moment_error is None else float(grasp.moment_error[k]) / stiffness
        bend = HiddenBend(i, float(sizes[k]), error, float(np.linalg.norm(shown[k])))
        if bend.by_moment > gentle and bend.shown < (1.0 - FALLS_SHORT) * bend.by_moment:
            found.append(bend)
    return max(found, key=lambda bend: bend.by_moment, default=None)


def _derivative(surface: SplineSurface, times: Floats, u: Floats, order: int) -> Floats:
    return surface(u, times, du=order)[..., :3]


def _stiffness(problem: Problem) -> float:
    return cast(float, problem.scene.cable.bending_stiffness)


def _bending(problem: Problem, knots: Floats, moments: Sequence[Floats]) -> list[int]:
    """Return the grasps whose moment (3,) or (k, 3) [N m] tells the curvature beside them."""
    if problem.bend is None or not problem.rests_straight or problem.start.material is not None:
        return []
    length = problem.scene.cable.length
    return [
        i
        for i, grasp in enumerate(problem.scene.grasps)
        if moments[i].any()  # else it is open, or holds a point
        and np.sum(np.abs(knots - grasp.u) <= SAME * length) >= 2  # else in a tip without a span of its own
    ]


def _by_moment(problem: Problem, moments: Floats, tangents: Floats) -> Floats:
    """Return the curvatures t x kappa (k, 3) [1/m] beside a grasp by its moments (3,) or (k, 3) [N m]."""
    return (moments - np.sum(moments * tangents, axis=-1, keepdims=True) * tangents) / _stiffness(problem)


def _beside(problem: Problem, i: int, derivative: Callable[[Floats, int], Floats]) -> tuple[Floats, Floats]:
    """Return the tangents (k, 3) and the curvatures t x kappa (k, 3) [1/m] that are shown beside the grasp i.

    `derivative` returns the derivative (k, m, 3) of an order, 1 or 2, of the cable's shape at u (m,) [m].
    """
    length = problem.scene.cable.length
    sides = np.array([-1.0, 1.0])
    u = problem.scene.grasps[i].u + SAME * length * sides
    inside = (u > 0.0) & (u < length)
    slope, second = derivative(u[inside], 1), derivative(u[inside], 2)
    bend = np.cross(slope, second) / np.sum(slope**2, axis=-1, keepdims=True)
    tangent = slope[:, 0] / np.linalg.norm(slope[:, 0], axis=-1, keepdims=True)
    return tangent, np.einsum("s,ksd->kd", -sides[inside], bend)
