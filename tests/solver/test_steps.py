"""Parts of a time step: where it is predicted to go, and what inertia and drag add to its residual and tangent."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from dlocore.kernels.inertia import both_sides, effective, padded, residual
from dlocore.kernels.predictor import ORDERS, differences_of, predict_by, shift
from dlocore.spline import uniform_knots
from tests.tables import plain_tables

Floats = NDArray[np.float64]


def ahead(states: Floats) -> Floats:
    """Return the state predicted after those of a motion (k, n, nc)."""
    past = differences_of(states)
    return past[: predict_by(past, len(states))].sum(axis=0)


@pytest.mark.parametrize("degree", range(ORDERS - 1))
def test_a_polynomial_motion_is_predicted_exactly(degree: int) -> None:
    rng = np.random.default_rng(degree)
    motion = rng.normal(size=(degree + 1, 6, 3))
    t = np.arange(12)[:, None, None, None] / 12
    states = (t ** np.arange(degree + 1)[:, None, None] * motion).sum(axis=1)
    np.testing.assert_allclose(ahead(states[:-1]), states[-1], atol=1e-13)  # rounding of sixteen terms


def test_a_trembling_motion_is_predicted_by_fewer_differences_than_a_smooth_one() -> None:
    t = np.arange(20)[:, None, None] / 20
    smooth = np.sin(3.0 * t + np.arange(8).reshape(4, 2))
    trembling = smooth + 1e-2 * (-1.0) ** np.arange(20)[:, None, None]
    orders = [predict_by(differences_of(x), len(x)) for x in (smooth, trembling)]
    assert orders == [ORDERS, 2]


def test_prediction_turns_with_the_motion() -> None:
    rng = np.random.default_rng(3)
    states = np.cumsum(rng.normal(size=(9, 5, 3)), axis=0)
    turn = Rotation.from_rotvec([0.3, -1.1, 0.7]).as_matrix()
    np.testing.assert_allclose(ahead(states @ turn.T), ahead(states) @ turn.T, atol=1e-12)  # rounding of ten states


def test_differences_are_moved_on_as_they_are_taken_anew() -> None:
    states = np.random.default_rng(4).normal(size=(14, 5, 2))
    past = differences_of(states[:9])
    for q in states[9:]:
        shift(past, q)
    np.testing.assert_allclose(past, differences_of(states), atol=1e-13)  # rounding of thirty-two terms


def test_few_states_predict_nothing() -> None:
    states = np.random.default_rng(5).normal(size=(2, 5, 2))
    assert predict_by(differences_of(states), len(states)) == 0


@pytest.mark.parametrize("nc", [2, 3, 4])
def test_inertia_and_drag_are_those_of_the_dense_matrices(nc: int) -> None:
    rng = np.random.default_rng(nc)
    n, density, dragged, alpha_m, alpha_f = 9, 0.7, 0.3, 0.2, 0.4
    tables = plain_tables(uniform_knots(n, 1.0), masses=np.array([[0.31, 0.4], [1.0, 2.0]]))
    unit, heavy = tables.unit, tables.inertia
    U, H = np.zeros((n, n)), np.zeros((n, n))
    for i in range(n):
        for o in range(min(4, n - i)):
            U[i, i + o] = U[i + o, i] = unit[i, o]
            H[i, i + o] = H[i + o, i] = heavy[i, o]
    a, a1, v1, load, G, f = rng.normal(size=(6, n, nc))
    force, R = f.copy(), np.empty((n, nc))
    rows = both_sides(heavy), both_sides(unit)
    residual(nc, *rows, density, dragged, alpha_m, alpha_f, a, a1, v1, load, G, f, R, padded(n, nc))
    expected = force + dragged * U @ v1 - load
    np.testing.assert_allclose(f, expected, atol=1e-14)  # rounding
    inertia = density * H @ ((1.0 - alpha_m) * a1 + alpha_m * a)
    np.testing.assert_allclose(R, inertia + (1.0 - alpha_f) * expected + alpha_f * G, atol=1e-14)

    K = np.tril(rng.normal(size=(n * nc, 4 * nc)))
    before = K.copy()
    effective(nc, K, heavy, unit, 5.0, 0.6, 2.0)
    added = K - 0.6 * before
    for i in range(n):
        for o in range(min(4, n - i)):
            np.testing.assert_allclose(
                added[i * nc : (i + 1) * nc, o * nc], 5.0 * H[i, i + o] + 2.0 * U[i, i + o], atol=1e-14
            )
    added[:, ::nc] = 0.0
    assert np.abs(added).max() < 1e-15  # coordinates are not coupled
