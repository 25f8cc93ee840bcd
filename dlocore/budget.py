"""The grid that a time budget allows, chosen before solving from what solves cost on this machine."""

import numpy as np

from dlocore.cost import Cost
from dlocore.discretisation import smallest_n_u
from dlocore.problem import Problem
from dlocore.solvers.ladder import given_steps
from dlocore.solvers.march import smallest_n_t

MOST_N_U, MOST_N_T = 129, 513
_TIMES_PER_POINT = 1.5  # n_t over n_u: halves both parts of the error alike in a motion of about two seconds of a metre


def grid_within(
    problem: Problem, cost: Cost, budget: float, *, method: str = "march", estimate: bool = True
) -> tuple[int, int] | None:
    """Return the finest grid (n_u, n_t) whose solve should take no longer than a budget; None where none does.

    Args:
        problem: what is solved: its features set the least grid, its horizon the ratio of n_t to n_u.
        cost: what solves cost on this machine.
        budget: allowed time [s].
        method: "march" or "spacetime".
        estimate: whether the error is estimated within the budget, too.
    """
    natural = 2.0 * np.sqrt(problem.scene.cable.length)  # [s]: about the period of a cable that swings
    ratio = _TIMES_PER_POINT * float(np.clip(problem.horizon / natural, 1.0, 64.0))
    active = [name for name, choice in problem.choices.items() if choice.active]
    best = None
    for n_u in range(max(7, smallest_n_u(problem)), MOST_N_U + 1):
        n_t = min(max(round(ratio * n_u), smallest_n_t(problem)), MOST_N_T)
        expected = cost.time(
            method, n_u, n_t, given_steps(n_t), coordinates=problem.nc, effects=active, estimate=estimate
        )
        if expected > budget:
            break
        best = n_u, n_t
    return best
