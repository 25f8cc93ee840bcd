"""Where a time budget begins to refine, chosen before solving from what solves cost on this machine."""

from dlocore.cost import Cost
from dlocore.problem import Problem
from dlocore.solvers.ladder import LEVELS, Size, stretched

GROWTH = 3.0  # of the time from one grid to the next, where nothing is known of this machine
_KEPT = 0.8  # of the budget: what the model may be sure of, as it knows nothing of the motion


def march_time(problem: Problem, cost: Cost, size: Size) -> float:
    """Return about how long a march on a grid takes [s]."""
    active = [name for name, choice in problem.choices.items() if choice.active]
    return cost.time("march", *size, coordinates=problem.nc, effects=active, estimate=False)


def first_level(problem: Problem, cost: Cost | None, budget: float) -> int:
    """Return the first grid, a number in `LEVELS`, of the marches within a time budget [s].

    It is the finest that leaves time for the next one, by which its error is told; the coarsest where nothing is known
    of this machine.
    """
    if cost is None or problem.nc not in cost.rates:
        return 0
    spent = [march_time(problem, cost, stretched(problem, level)) for level in range(len(LEVELS))]
    fitting = [k for k in range(len(LEVELS) - 1) if spent[k] + spent[k + 1] <= _KEPT * budget]
    return max(fitting, default=0)


def growth(problem: Problem, cost: Cost | None, size: Size, next_size: Size) -> float:
    """Return how many times as long a march on the next grid will take as on this one."""
    if cost is None or problem.nc not in cost.rates:
        return GROWTH
    return march_time(problem, cost, next_size) / march_time(problem, cost, size)
