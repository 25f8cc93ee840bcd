"""Drag so strong that it stops the initial velocity within one or a few time steps."""

import math

import numpy as np

from dlocore.problem.problem import Problem

_OFF = 1 / 32  # of the stopping way: error of steps as long as the stopping time; it goes with their square


def stopping_time(problem: Problem) -> float:
    """Return the time [s] in which linear drag reduces the initial velocity to 1/e; infinite if either is zero."""
    dragged = problem.drag_coefficient() * problem.scene.cable.length
    moves = problem.start.velocity is not None and problem.inertia is not None
    return problem.scene.cable.mass / dragged if moves and dragged > 0.0 else math.inf


def unresolved_way(problem: Problem, step: float) -> float:
    """Return the approximate error [m] of steps of `step` [s] while drag stops the cable: at most its whole way."""
    given, time = problem.start.velocity, stopping_time(problem)
    if given is None or time == math.inf:
        return 0.0
    speed = float(np.linalg.norm(given.control_points, axis=1).max())
    return speed * time * min(_OFF * (step / time) ** 2, 1.0)
