"""What refinement may cost: which grid is worth its time, and where to begin within a time budget."""

from dataclasses import dataclass

import numpy as np

from dlocore.accuracy.cost import Cost
from dlocore.levels.level import LEVELS, Size, stretched
from dlocore.problem.problem import Problem
from dlocore.solvers.march import MOST_FRAMES
from dlocore.solvers.monitor import Monitor

_KEPT = 0.8  # of the budget: the share that is planned for, because the cost model knows nothing of the motion
MOST_WORK = 3.2e7  # control points times steps of one march in the plane
_COSTS = {2: 1.0, 3: 2.0, 4: 2.9}  # relative time by coordinates: space, and twist, take 1.4 times that
_FRAMES = 3  # control points in time kept of a motion with twist, at least: its time spline needs them
PATIENT = 64.0  # times MOST_WORK, for a march that will end before a deadline or within a time budget, ...
MOST_STEPS = 1_000_000  # ... with no more steps than this: `Kept` stores the reactions of all of them
_DEAR = 0.25  # of the time left: a march that takes more is not done just to find the error of the steps
_MAY_BE = 2.0  # times the time left: a march expected to take this long may still finish
_SLOWER = 1.3  # times the time that its work suggests: what a march may take
CONTACT_COSTS = 2  # times: work with contact counts as this much more, because a step takes longer
AUTO_SHARE = 1 / 32  # of MOST_WORK, if no target was requested and the estimated error is already good enough
_MOST_POINTS = 800  # along the cable, ...
_PATIENT_POINTS = 4  # ... times this, for a march that will end before a deadline


@dataclass
class Means:
    """What a refinement may spend.

    Attributes:
        monitor: of the solve, with its deadline.
        cost: cost of solves on this machine, if known.
        budget: time allowed [s]; infinite if none was given.
        pace: time of the last march per point and step [s].
    """

    monitor: Monitor
    cost: Cost | None
    budget: float
    pace: float = np.inf

    @property
    def left(self) -> float:
        """Time left [s]; infinite if there is neither a deadline nor a budget."""
        return min(self.monitor.remaining(), self.budget - self.monitor.elapsed())

    @property
    def used_up(self) -> bool:
        """Whether a time budget is used up."""
        return self.monitor.elapsed() > self.budget

    def took(self, problem: Problem, size: Size, spent: float) -> None:
        """Record how long the march of a size took [s]."""
        self.pace = spent / _work(problem, size)

    def is_dear(self, problem: Problem, size: Size) -> bool:
        """Tell whether time is limited and a march of this size takes much of what is left."""
        return self.left < np.inf and self.pace * _work(problem, size) > _DEAR * self.left

    def affordable(self, problem: Problem, size: Size, content: bool) -> Size | None:
        """Return the size, or None if its march takes too long, or longer than a `content` caller would wait."""
        work, left = _work(problem, size), self.left
        in_time = left < np.inf and size.steps <= MOST_STEPS and _SLOWER * self.pace * work < left
        most = MOST_WORK * (AUTO_SHARE if content else PATIENT if in_time else 1.0)
        fits = problem.twist is None or _FRAMES * size.n_t * size.n_u <= MOST_FRAMES
        points = _MOST_POINTS * (_PATIENT_POINTS if in_time and not content else 1)
        return size if fits and size.n_u <= points and work <= most else None

    def next_fits(self, problem: Problem, size: Size, finer: Size, spent: float, checked: bool) -> bool:
        """Tell whether the next grid can be done within the budget, if one of `size` took `spent` [s].

        A grid that has not been `checked` by another is no answer yet, so the next one is tried even if it only may
        finish.
        """
        left = self.budget - self.monitor.elapsed()
        return not growth(problem, self.cost, size, finer) * spent > (left if checked else _MAY_BE * left)


def _work(problem: Problem, size: Size) -> float:
    """Return the equivalent work of a march of a size: control points times steps of a march in the plane."""
    touches = problem.contact is not None or problem.self_contact is not None
    return size.n_u * size.steps * _COSTS[problem.nc] * (CONTACT_COSTS if touches else 1.0)


def march_time(problem: Problem, cost: Cost, size: Size) -> float:
    """Return the approximate time of a march on a grid [s]."""
    active = [name for name, choice in problem.choices.items() if choice.active]
    return cost.time("march", *size, coordinates=problem.nc, effects=active, estimate=False)


def first_level(problem: Problem, cost: Cost | None, budget: float) -> int:
    """Return the first grid of the marches within a time budget [s], as an index into `LEVELS`.

    It is the finest that leaves time for the next one, which gives its error; the coarsest if nothing is known about
    this machine.
    """
    if cost is None or problem.nc not in cost.rates:
        return 0
    spent = [march_time(problem, cost, stretched(problem, level)) for level in range(len(LEVELS))]
    fitting = [k for k in range(len(LEVELS) - 1) if spent[k] + spent[k + 1] <= _KEPT * budget]
    return max(fitting, default=0)


def growth(problem: Problem, cost: Cost | None, size: Size, next_size: Size) -> float:
    """Return the ratio of march times of the next grid and this one; the ratio of work if no more is known."""
    if cost is None or problem.nc not in cost.rates:
        return _work(problem, next_size) / _work(problem, size)
    return march_time(problem, cost, next_size) / march_time(problem, cost, size)
