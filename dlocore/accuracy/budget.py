"""What refining may cost: which grid is worth its time, and where a time budget begins."""

from dataclasses import dataclass

import numpy as np

from dlocore.accuracy.cost import Cost
from dlocore.levels.level import LEVELS, Size, stretched
from dlocore.problem.problem import Problem
from dlocore.solvers.march import MOST_FRAMES
from dlocore.solvers.monitor import Monitor

_KEPT = 0.8  # of the budget: what the model may be sure of, as it knows nothing of the motion
MOST_WORK = 3.2e7  # control points times steps of one march in the plane
_COSTS = {2: 1.0, 3: 2.0, 4: 2.9}  # times the time, by coordinates: in space, and with twist, 1.4 times that
_FRAMES = 3  # a control point in time, at least, that are kept of a motion with twist: what its time spline needs
PATIENT = 64.0  # times as much, of a march that will end before a deadline or within a time budget, ...
MOST_STEPS = 1_000_000  # ... and has no more steps: what holds the cable is kept of all of them, see `Kept`
_DEAR = 0.25  # of the time left: a march that takes more is not done only to tell what steps err by
_MAY_BE = 2.0  # times as long as is left: a march that is expected to take that may be done by then
_SLOWER = 1.3  # times as long as its work tells, a march may take
CONTACT_COSTS = 2  # times as much work counts with contact, which takes more of the time of a step
AUTO_SHARE = 1 / 32  # of it for who asked for no target, once the estimated error is what is enough
_MOST_POINTS = 800  # along the cable, ...
_PATIENT_POINTS = 4  # ... or so many times as many, of a march that will end before a deadline


@dataclass
class Means:
    """What a climb may spend.

    Attributes:
        monitor: that of the solve, with its deadline.
        cost: what solves cost on this machine, where it is known.
        budget: time allowed [s], infinite where none was given.
        pace: time that the last march took for each of its points and steps [s].
    """

    monitor: Monitor
    cost: Cost | None
    budget: float
    pace: float = np.inf

    @property
    def left(self) -> float:
        """Time that is left [s], infinite where there is neither a deadline nor a budget."""
        return min(self.monitor.remaining(), self.budget - self.monitor.elapsed())

    @property
    def used_up(self) -> bool:
        """Whether a time budget is."""
        return self.monitor.elapsed() > self.budget

    def took(self, problem: Problem, size: Size, spent: float) -> None:
        """Note how long the march of a size took [s]."""
        self.pace = spent / _work(problem, size)

    def is_dear(self, problem: Problem, size: Size) -> bool:
        """Tell whether time is limited, and a march of a size takes much of what is left of it."""
        return self.left < np.inf and self.pace * _work(problem, size) > _DEAR * self.left

    def affordable(self, problem: Problem, size: Size, content: bool) -> Size | None:
        """Return a size, or None where a march of it takes too long, or longer than it is worth to who is `content`."""
        work, left = _work(problem, size), self.left
        in_time = left < np.inf and size.steps <= MOST_STEPS and _SLOWER * self.pace * work < left
        most = MOST_WORK * (AUTO_SHARE if content else PATIENT if in_time else 1.0)
        fits = problem.twist is None or _FRAMES * size.n_t * size.n_u <= MOST_FRAMES
        points = _MOST_POINTS * (_PATIENT_POINTS if in_time and not content else 1)
        return size if fits and size.n_u <= points and work <= most else None

    def next_fits(self, problem: Problem, size: Size, finer: Size, spent: float, checked: bool) -> bool:
        """Tell whether the next grid is done within the budget, if one of `size` took a time `spent` [s].

        One that was not `checked` by another yet is no answer: the next one is tried if it may be done.
        """
        left = self.budget - self.monitor.elapsed()
        return not growth(problem, self.cost, size, finer) * spent > (left if checked else _MAY_BE * left)


def _work(problem: Problem, size: Size) -> float:
    """Return the control points times steps of a march in the plane that takes as long as one of a size."""
    touches = problem.contact is not None or problem.self_contact is not None
    return size.n_u * size.steps * _COSTS[problem.nc] * (CONTACT_COSTS if touches else 1.0)


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
    """Return how many times as long a march on the next grid will take as on this one; by its work, if that is all."""
    if cost is None or problem.nc not in cost.rates:
        return _work(problem, next_size) / _work(problem, size)
    return march_time(problem, cost, next_size) / march_time(problem, cost, size)
