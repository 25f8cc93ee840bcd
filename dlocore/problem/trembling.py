"""Paths through waypoints that tremble, as recorded ones do, faster than steps can see."""

from typing import cast

import numpy as np
from numpy.typing import NDArray

from dlocore.problem.problem import Problem
from dlocore.scene.paths import Waypoints

Floats = NDArray[np.float64]


def trembles(problem: Problem, step: float) -> float:
    """Return how far a cable is taken by what steps of `step` [s] do not see of the paths of its grasps [m], at most.

    That is how fast a path moves beside the way that it comes in a step, root mean square, for as long as a cable of
    that length needs to swing: a stiff one goes on with the speed of its gripper, however small the way of that was. 0
    where inertia is left out, as the cable only follows the way then.
    """
    scene, most = problem.scene, 0.0
    if problem.inertia is None:
        return 0.0
    lasts = min(problem.horizon, scene.swing)
    for grasp in scene.grasps:
        path = grasp.path
        if not isinstance(path, Waypoints) or path.profile != "spline":  # a program is no record
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
