"""The search for the fastest rod that errs as little as a march."""

from itertools import product
from typing import cast

import numpy as np
import pytest

from benchmarks import equal_error
from benchmarks.equal_error import RODS, STEPS, Trial
from dlocore.problem.problem import Problem
from dlocore.study.judge import Truth


@pytest.mark.parametrize("error", [1e-2, 1e-3, 1e-4, 3e-5])
def test_no_rod_that_errs_as_little_is_faster(monkeypatch: pytest.MonkeyPatch, error: float) -> None:
    def simulated(_problem: Problem, _truth: Truth, elements: int, tolerance: float) -> Trial:
        steps = round(20.0 * (1e-2 / tolerance) ** 0.25)
        return Trial(1e-5 * elements * steps, elements**-2.0 + 3.0 * tolerance, elements, steps)

    monkeypatch.setattr(equal_error, "_simulated", simulated)
    unused = (cast(Problem, None), cast(Truth, None))
    every = [simulated(*unused, elements, share * error) for elements, share in product(RODS, STEPS)]
    fastest = min(trial for trial in every if trial.error <= error)
    found = list(equal_error._trials(*unused, error, np.inf))
    assert min(found) == fastest
    assert len(found) < len(RODS)
