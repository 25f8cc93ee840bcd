"""Starts that may settle in any of many directions, because nothing keeps them from turning as a whole on the way."""

import numpy as np
from numpy.typing import NDArray

from dlocore.problem.events import closed_grasps
from dlocore.problem.grid import Grid
from dlocore.problem.problem import Problem
from dlocore.spline import design_matrix

Floats = NDArray[np.float64]

_FLAT = 1e-6  # of the length: points this near to a line, or a plane, lie in it
_MOVES = 1e-3  # of the length: a start that settles within this of the given one has hardly turned
_LOOKS = 33


def turns_freely(problem: Problem) -> str:
    """Return in words what a start that settles may turn about because nothing prevents it, or "".

    This is the vertical through a grasp that holds a position, or through several above each other; without weight it
    is the line through such grasps, or a single grasp. A start in a plane through that line turns to neither side.
    """
    scene = problem.scene
    held = closed_grasps(scene, 0.0, 0.0)
    if not scene.shape.settle or problem.touches or problem.obstacles or not held:
        return ""
    if scene.loads or any(g.hold != "point" for g in held):
        return ""
    length = scene.cable.length
    places = problem.start(np.array([g.u for g in held]))
    points = problem.start(np.linspace(0.0, length, _LOOKS)) - places[0]
    weight = problem.gravity.weight() if problem.gravity is not None else np.zeros(3)
    apart = places[1:] - places[0]
    fixed = [x for x in (weight, *apart) if np.linalg.norm(x) > 0.0]
    if not fixed:
        straight = np.linalg.svd(points, compute_uv=False)[1] <= _FLAT * length
        return "" if straight else "its grasp"
    if problem.plane.dimensions == 2:
        return ""
    axis = fixed[0] / np.linalg.norm(fixed[0])
    if any(np.linalg.norm(np.cross(axis, x)) > _FLAT * np.linalg.norm(x) for x in fixed):
        return ""
    across = points - np.outer(points @ axis, axis)
    if np.linalg.svd(across, compute_uv=False)[1] <= _FLAT * length:
        return ""
    return "the vertical through its grasp" if np.any(weight) else "the line through its grasps"


def turn_notes(problem: Problem, grid: Grid) -> list[str]:
    """Return a note if the direction in which the start of a grid has come to rest is one of many."""
    about = turns_freely(problem)
    if not about:
        return []
    u = np.linspace(0.0, problem.scene.cable.length, _LOOKS)
    at_rest = design_matrix(grid.knots, u) @ grid.start[:, : problem.plane.dimensions]
    moved = problem.plane.world(at_rest) - problem.start(u)
    if np.linalg.norm(moved, axis=1).max() <= _MOVES * problem.scene.cable.length:
        return []
    return [f"nothing keeps the start from turning about {about}: how far it turns as it settles depends on the way"]
