"""Paths through waypoints that tremble faster than the steps of a march resolve, as recorded ones may."""

from typing import cast

import numpy as np
from numpy.typing import NDArray

from dlocore.problem.problem import Problem
from dlocore.scene.paths import Waypoints

Floats = NDArray[np.float64]


def trembles(problem: Problem, step: float) -> float:
    """Return a bound on how far the cable is moved by what steps of `step` [s] miss of its grasps' paths [m].

    It is the root mean square of a path's velocity less its mean over a step, times the period of a swing: a stiff
    cable keeps the speed of its gripper, however short the gripper's own way was. It is 0 if inertia is left out,
    because then only the way matters.
    """
    scene, most = problem.scene, 0.0
    if problem.inertia is None:
        return 0.0
    lasts = min(problem.horizon, scene.swing)
    for grasp in scene.grasps:
        path = grasp.path
        if not isinstance(path, Waypoints) or path.profile != "spline":  # a robot program is not a recorded path
            continue
        end = min(grasp.release_time or problem.horizon, problem.horizon) - grasp.start
        times = cast(Floats, path.times)[1:-1]
        times = times[(times > step) & (times < end - step)]
        if len(times) == 0:
            continue
        start = cast(Floats, path.positions)[0]
        way = path.at(times + 0.5 * step, start) - path.at(times - 0.5 * step, start)
        near = 1e-3 * step
        speed = (path.at(times + near, start) - path.at(times - near, start)) / (2.0 * near)
        most = max(most, float(np.sqrt(((speed - way / step) ** 2).sum(axis=1).mean())))
    return most * lasts
