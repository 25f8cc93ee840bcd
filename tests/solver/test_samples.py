"""Where two marches are compared: their surfaces at evenly spaced times and places."""

import numpy as np
import pytest

from dlocore.kernels.timefit import sampled
from dlocore.spline import SplineSurface, uniform_knots


@pytest.mark.parametrize("nc", [2, 3, 4])
def test_samples_are_those_of_the_surface(nc: int) -> None:
    control = np.random.default_rng(nc).normal(size=(11, 9, nc))
    knots_u, knots_t = uniform_knots(9, 0.8), np.sort(np.concatenate([uniform_knots(10, 1.5), [0.6]]))
    found = sampled(knots_t, knots_u, control, 33)
    full = np.concatenate([control, np.zeros((11, 9, 4 - nc))], axis=2)
    surface = SplineSurface(full, knots_u, knots_t)
    expected = surface(np.linspace(0.0, 0.8, 33), np.linspace(0.0, 1.5, 33))
    np.testing.assert_allclose(found, expected[..., :nc], atol=1e-14)  # rounding
