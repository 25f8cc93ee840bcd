"""How deep points of the cable are in the table and the obstacles that a problem simulates."""

import numpy as np
from numpy.typing import NDArray

from dlocore.effects.distance import distances
from dlocore.problem.problem import Problem
from dlocore.problem.standing import obstacle_rows

Floats = NDArray[np.float64]


def depths_by_name(problem: Problem, points: Floats) -> dict[str, Floats]:
    """Return how deep a cable at points (k, 3) [m] is in each obstacle and in the table (k,) [m], by their names."""
    scene, table, found = problem.scene, problem.scene.environment.table, dict[str, Floats]()
    if problem.obstacles:
        gaps = distances(obstacle_rows(scene, problem.obstacles), points)
        names = [f"obstacles[{scene.environment.obstacles.index(o)}]" for o in problem.obstacles]
        found |= zip(names, 0.5 * scene.cable.diameter - gaps.T, strict=True)
    if table is not None and problem.table is not None:
        found["the table"] = table.height - points[:, 2]
    return found
