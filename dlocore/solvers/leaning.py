"""Friction at the beginning of a stretch of motion: anchors are placed where it holds the cable back from the start."""

import numpy as np
from numpy.typing import NDArray

from dlocore.effects.friction import SLIP_SPEED
from dlocore.kernels.assembly import History
from dlocore.kernels.banded import Elimination
from dlocore.kernels.march import constrained_mass_solve
from dlocore.problem.grid import Grid
from dlocore.problem.problem import Problem

Floats = NDArray[np.float64]

_RESTS = 0.05  # of the diameter above the table: nearer to it, the cable rests on it


def lean_on_anchors(
    problem: Problem, grid: Grid, v: Floats, a: Floats, mass: Floats, e: Elimination, G: Floats, history: History
) -> Floats:
    """Place the anchors of a lying cable where friction holds it back from the acceleration `a` without friction.

    With anchors right under it the cable would move until it sticks, and swing past. The function returns the remaining
    acceleration, and adds the friction to G, both (n_u, nc).
    """
    assert problem.friction is not None
    stick, _, limit = problem.friction.parameters()
    index = grid.tables.lying.first[:, None] + np.arange(4)
    acceleration, velocity = (np.einsum("pi,pid->pd", grid.tables.lying.b0, x[index]) for x in (a, v))
    pull = problem.scene.cable.linear_density * acceleration / limit
    pull = pull / np.maximum(np.linalg.norm(pull, axis=1, keepdims=True), 1.0)
    speed = np.linalg.norm(velocity, axis=1, keepdims=True)
    moves = speed > SLIP_SPEED  # friction on what slides is already in `a` and G
    history.slide[:] = history.slide - stick * np.where(moves, velocity / np.maximum(speed, SLIP_SPEED), pull)
    pull = np.where(moves, 0.0, pull)
    force = np.zeros_like(a)
    weights = limit * grid.tables.lying.w[:, None] * grid.tables.lying.b0
    np.add.at(force, index, weights[:, :, None] * pull[:, None, :])
    G += force
    return a + constrained_mass_solve(problem.nc, mass, e, np.zeros(len(e.held)), -force)


def lean_on_table(problem: Problem, grid: Grid, a: Floats, history: History) -> None:
    """Place the anchors of what rests on a table in space where friction holds it back, as `lean_on_anchors` does."""
    assert problem.friction is not None
    assert problem.table is not None
    fall = -float(problem.weight()[2]) / problem.scene.cable.linear_density
    if not fall > 0.0 or not problem.table.friction > 0.0:
        return
    index = grid.tables.contact.first[:, None] + np.arange(4)
    acceleration = np.einsum("pi,pid->pd", grid.tables.contact.b0, a[index])[:, :2]
    pull = acceleration / (problem.table.friction * fall)
    pull /= np.maximum(np.linalg.norm(pull, axis=1, keepdims=True), 1.0)
    rests = history.stick[:, 2] - problem.table.height < _RESTS * problem.scene.cable.diameter
    history.stick[:, :2] -= problem.friction.parameters()[0] * pull * rests[:, None]
