"""The strain memory of one section, integrated over a step: paper eq. 9 with hardening, docs/model.md eq. 20."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from dlocore.effects.plasticity import BendingMemory, elastic_part, yielded

IDENTITY = (1.0, 1.0, 1.0, 0.0, 0.0, 0.0)


def test_elastic_strain_after_a_step_solves_the_law_and_its_derivative_is_consistent():
    rng = np.random.default_rng(0)
    for _ in range(100):
        begin, end = rng.uniform(-4.0, 4.0, 2)
        h, k = rng.uniform(0.01, 2.0), rng.uniform(0.1, 20.0)

        def law(t, x, rate=(end - begin) / h, k=k):
            return rate - k * np.sign(x) * np.maximum(np.abs(x) - 1.0, 0.0)

        exact = solve_ivp(law, [0.0, h], [begin], rtol=1e-10, atol=1e-12, max_step=h / 50).y[0, -1]
        x, slope = elastic_part(begin, end, h, 1.0, k)
        assert x == pytest.approx(exact, abs=2e-6)  # of the integrator, at the kink of the law
        near = [elastic_part(begin, end + s * 1e-6, h, 1.0, k)[0] for s in (-1, 1)]
        assert slope == pytest.approx((near[1] - near[0]) / 2e-6, abs=1e-6)
        assert 0.0 < slope <= 1.0


def test_nothing_yields_below_the_threshold():
    e, De = yielded((0.3, -0.4, 0.0), (0.2, 0.1, 0.0), (0.0, 0.0, 0.0), 0.1, 1.0, 50.0)
    assert e == (0.3, -0.4, 0.0)
    assert De == IDENTITY


def test_a_curvature_vector_returns_along_its_direction_and_at_most_to_the_threshold():
    e, De = yielded((3.0, 4.0, 0.0), (3.0, 4.0, 0.0), (0.0, 0.0, 0.0), 1e3, 1.0, 50.0)
    np.testing.assert_allclose(e, (0.6, 0.8, 0.0), rtol=1e-12)
    eigenvalues = np.linalg.eigvalsh([[De[0], De[3], De[4]], [De[3], De[1], De[5]], [De[4], De[5], De[2]]])
    assert eigenvalues[0] > 0.0
    assert eigenvalues[-1] <= 1.0


def test_hardening_keeps_a_share_of_the_memory_as_back_stress():
    threshold, k, soft = BendingMemory(2.0, 50.0, 0.1).parameters()
    assert (threshold, k, soft) == pytest.approx((2.0, 55.0, 1.0 / 1.1))
