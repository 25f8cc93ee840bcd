"""Newton's steps with an incomplete tangent: what earlier steps taught makes up for what is missing in it."""

import numpy as np
import pytest
from numpy.typing import NDArray

from dlocore.kernels.mixing import DEPTH, mixed, room

Floats = NDArray[np.float64]
N = 30


def steps_to_rest(outliers: list[float], mixes: bool, limit: int = DEPTH) -> Floats:
    """Return the errors of iterations with the identity as tangent of a matrix with some eigenvalues that are not 1."""
    rng = np.random.default_rng(5)
    basis = np.linalg.qr(rng.normal(size=(N, N)))[0]
    matrix = basis * np.array([*outliers, *[1.0] * (N - len(outliers))]) @ basis.T
    answer = rng.normal(size=N)
    x, known, errors = np.zeros(N), -1, []
    mixing = room(N)
    for _ in range(limit):
        f = matrix @ (answer - x)
        if mixes:
            known = mixed(mixing, known, f)
        x = x + f
        errors.append(float(np.abs(x - answer).max()))
    return np.array(errors)


@pytest.mark.parametrize("outliers", [[5.3], [5.3, 0.01], [9.0, 4.0, 2.5, 0.3, 0.02]])
def test_each_misjudged_motion_takes_two_more_iterations_at_most(outliers: list[float]) -> None:
    errors = steps_to_rest(outliers, mixes=True)
    # rounding, times the square of the largest eigenvalue over the least
    assert errors[2 * len(outliers) + 1] < 1e-9
    assert steps_to_rest(outliers, mixes=False)[-1] > 1e6  # without, the tangent's iteration diverges


def test_a_complete_tangent_is_left_alone() -> None:
    assert steps_to_rest([], mixes=True)[0] < 1e-14  # rounding
    assert steps_to_rest([], mixes=True)[-1] < 1e-14
