"""Which grid follows another, and in which direction it is finer: regressions found by a cable laid on a table."""

from dataclasses import replace
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from dlocore.accuracy.budget import Means
from dlocore.accuracy.changes import refined
from dlocore.accuracy.refinement import _Climb
from dlocore.levels.level import Level, Size
from dlocore.levels.whole_march import march_level
from dlocore.problem.problem import pose
from dlocore.solvers.monitor import Monitor
from tests.solver.scenes import paper_scene


def marched(n_u: int, steps: int) -> Level:
    """Return a stand-in for a level, of which only the size of its march counts."""
    return cast(Level, SimpleNamespace(motion=SimpleNamespace(grid=SimpleNamespace(n_u=n_u), steps=steps)))


@pytest.mark.parametrize(
    ("n_u", "steps", "direction"), [(28, 320, "both"), (28, 160, "space"), (20, 320, "time"), (19, 160, "time")]
)
def test_in_which_direction_a_grid_is_finer_is_told_by_what_it_has_more_of(n_u: int, steps: int, direction: str):
    assert refined(marched(n_u, steps), marched(19, 160)) == direction


@pytest.mark.parametrize("size", [Size(42, 180, 700), Size(30, 80, 2816), Size(42, 180, 2816), Size(90, 80, 700)])
def test_a_grid_that_follows_one_that_needed_more_than_was_meant_is_finer_than_that(size: Size):
    # a grid of as many points and steps as the one before agreed with it to 0.03 mm, both 14 mm off
    problem = pose(paper_scene(0.25))
    climb = _Climb(problem=problem, means=Means(Monitor(), None, np.inf), target=1e-4, enough=1e-4, number=2)
    climb.best = level = march_level(problem, Size(9, 13, 40), Monitor(), free_knots=True)
    climb.changes.note("both", replace(level, change=0.05), level)
    following = climb._next(level, size, None)
    assert following is not None
    assert following.n_u > 1.1 * size.n_u or following.steps > 1.1 * size.steps
    assert following.n_u >= size.n_u
    assert following.steps >= size.steps
