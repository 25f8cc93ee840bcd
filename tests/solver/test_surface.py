"""A surface is evaluated anywhere, in an order that suits its size."""

import tracemalloc

import numpy as np
import pytest

from dlocore.spline import SplineSurface, design_matrix, uniform_knots


def surface(n_u: int, n_t: int) -> SplineSurface:
    control = np.random.default_rng(n_u).normal(size=(n_t, n_u, 4))
    return SplineSurface(control, uniform_knots(n_u, 1.5), uniform_knots(n_t, 2.0))


@pytest.mark.parametrize("times", [5, 40], ids=["fewer times than control points", "more"])
@pytest.mark.parametrize(("du", "dt"), [(0, 0), (1, 0), (0, 1), (2, 1), (3, 3)])
def test_it_is_the_sum_of_products_of_the_bases(times: int, du: int, dt: int):
    q = surface(9, 20)
    u, t = np.linspace(0.0, 1.5, 31), np.linspace(0.0, 2.0, times)
    over_u, over_t = design_matrix(q.knots_u, u, du), design_matrix(q.knots_t, t, dt)
    expected = np.einsum("ui,tj,jic->tuc", over_u, over_t, q.control_points)
    np.testing.assert_allclose(q(u, t, du, dt), expected, rtol=0.0, atol=1e-12 * np.abs(expected).max())
    np.testing.assert_array_equal(q(u[3], t[2], du, dt).shape, (1, 1, 4))
    expected = np.einsum("tj,jic->tic", over_t, q.control_points)
    np.testing.assert_allclose(q.states(t, dt), expected, rtol=0.0, atol=1e-12 * np.abs(expected).max())


def test_a_long_motion_is_read_at_every_step_in_little_memory():
    """96:4306 has 9,728 control points in time and 477,920 steps: a matrix of both would have had 37 GB."""
    q, t = surface(9, 4000), np.linspace(0.0, 2.0, 100_000)
    tracemalloc.start()
    found = q([0.7], t, dt=1)
    _, most = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert found.shape == (100_000, 1, 4)
    assert most < 10 * found.nbytes
