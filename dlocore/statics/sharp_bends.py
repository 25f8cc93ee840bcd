"""Moments of grippers beside which a cable bends more sharply than its grid can show."""

import numpy as np
from numpy.typing import NDArray

from dlocore.problem.features import SAME
from dlocore.problem.problem import Problem
from dlocore.spline import spline_at

Floats = NDArray[np.float64]

_SHARE = 0.5  # of what the curvature misses: the error of a moment was less on grids that agree


def missing_moments(problem: Problem, knots: Floats, control_points: Floats, moments: Floats) -> Floats:
    """Return a least error of the moment (grasps, 3) [N m] of each grasp on a cable at rest; (grasps,) [N m].

    A gripper that holds a direction bends the cable by its moment: EI times the curvature beside it, EI times its jump
    inside the cable. The curvature of the spline falls short of that where the cable bends within a span or two. Two
    grids may agree on the moment there and both err, but not on the curvature. Only for a cable whose stress-free shape
    is straight; otherwise zero.

    Args:
        problem: the posed scene.
        knots: (n_u + 4,) [m].
        control_points: in the world (n_u, 4) [m, m, m, rad].
        moments: moment of each grasp (grasps, 3) [N m].
    """
    scene, length = problem.scene, problem.scene.cable.length
    found = np.zeros(len(scene.grasps))
    if problem.bend is None or not problem.rests_straight or problem.start.material is not None:
        return found
    for i, grasp in enumerate(scene.grasps):
        if not moments[i].any() or np.sum(np.abs(knots - grasp.u) <= SAME * length) < 2:
            continue  # open, or in a tip without a span of its own
        u = grasp.u + SAME * length * np.array([-1.0, 1.0])
        inside = (u > 0.0) & (u < length)
        slope, second = (spline_at(knots, control_points[:, :3], u, order) for order in (1, 2))
        bend = np.cross(slope, second) / np.sum(slope**2, axis=1, keepdims=True)  # t x kappa
        tangent = slope[inside][0] / np.linalg.norm(slope[inside][0])
        across = moments[i] - (moments[i] @ tangent) * tangent
        shown = problem.bend.bending_stiffness * np.array([1.0, -1.0])[inside] @ bend[inside]
        found[i] = _SHARE * np.linalg.norm(across - shown)
    return found
