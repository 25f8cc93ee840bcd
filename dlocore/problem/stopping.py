"""Drag so strong that it stops the velocity of a start within a time step or a few."""

import math

import numpy as np

from dlocore.problem.problem import Problem

_OFF = 1 / 32  # of that way: what steps as long as the time to stop are off, which goes with their square


def stopping_time(problem: Problem) -> float:
    """Return the time [s] after which linear drag leaves a start 1/e of its velocity; infinite where it has none."""
    dragged = problem.drag_coefficient() * problem.scene.cable.length
    moves = problem.start.velocity is not None and problem.inertia is not None
    return problem.scene.cable.mass / dragged if moves and dragged > 0.0 else math.inf


def unresolved_way(problem: Problem, step: float) -> float:
    """Return how far steps of `step` [s] are off while drag stops a start [m], about: all of its way, at most."""
    given, time = problem.start.velocity, stopping_time(problem)
    if given is None or time == math.inf:
        return 0.0
    speed = float(np.linalg.norm(given.control_points, axis=1).max())
    return speed * time * min(_OFF * (step / time) ** 2, 1.0)
