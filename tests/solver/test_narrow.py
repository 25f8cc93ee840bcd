"""The bands of a march, of widths that the compiler knows: factors and solutions of dense matrices."""

import numpy as np
import pytest
from numpy.typing import NDArray

from dlocore.kernels.banded import factor
from dlocore.kernels.narrow import ROOM, factor_step, solve_step

Floats = NDArray[np.float64]


def positive(n: int, width: int, seed: int) -> tuple[Floats, Floats]:
    """Return a dense positive definite matrix (n, n), and its band with room behind it (n + ROOM, width)."""
    lower = np.tril(np.random.default_rng(seed).normal(size=(n, n)))
    lower[np.subtract.outer(np.arange(n), np.arange(n)) >= width] = 0.0
    A = lower @ lower.T + np.eye(n)
    band = np.zeros((n + ROOM, width))
    for j in range(n):
        band[j, : min(width, n - j)] = A[j : j + width, j]
    return A, band


@pytest.mark.parametrize("width", [8, 9, 12, 16])
@pytest.mark.parametrize("n", [1, 5, 8, 9, 40])
def test_a_system_is_solved(n: int, width: int) -> None:
    A, band = positive(n, width, n)
    b = np.random.default_rng(n + 1).normal(size=n)
    x = np.concatenate([b, np.zeros(ROOM)])
    assert factor_step(band, n) == -1
    solve_step(band, n, x)
    # rounding: a matrix of these has a condition of up to 1e4
    np.testing.assert_allclose(x[:n], np.linalg.solve(A, b), rtol=1e-10, atol=1e-12)
    assert not band[n:].any()  # for the next factorisation
    assert not x[n:].any()


@pytest.mark.parametrize("width", [8, 12, 16])
@pytest.mark.parametrize("n", [8, 40])
def test_factors_are_those_of_any_band(n: int, width: int) -> None:
    _, band = positive(n, width, 3)
    other = band[:n].copy()
    assert factor_step(band, n) == factor(other) == -1
    np.testing.assert_allclose(band[:n], other, atol=1e-13 * np.abs(other).max())  # a division for each column


@pytest.mark.parametrize("width", [8, 12, 16])
@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan])
@pytest.mark.parametrize("place", [0, 7, 19])
def test_a_pivot_that_is_not_positive_is_told(place: int, bad: float, width: int) -> None:
    _, band = positive(20, width, 4)
    band[place, 0] = bad
    assert factor_step(band, 20) == place
