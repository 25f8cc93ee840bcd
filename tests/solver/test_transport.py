"""Parallel transport by the smallest rotation, also where the tangent is reversed."""

import numpy as np
import pytest

from dlocore.shape.transport import transported


def turned(away: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return unit tangents, others nearly opposite to them, and unit vectors across the first (50, 3)."""
    r = np.random.default_rng(1)
    before = r.normal(size=(50, 3))
    after = away * r.normal(size=(50, 3)) - before
    x = np.cross(before, r.normal(size=(50, 3)))
    before, after, x = (v / np.linalg.norm(v, axis=1, keepdims=True) for v in (before, after, x))
    return before, after, x


@pytest.mark.parametrize("away", [0.05, 1.0, 100.0])
def test_a_vector_across_the_tangent_stays_across_it_and_keeps_its_length(away: float) -> None:
    before, after, x = turned(away)
    carried = transported(before, after, x)
    assert np.abs(np.linalg.norm(carried, axis=1) - 1.0).max() < 1e-9
    assert np.abs((carried * after).sum(axis=1)).max() < 1e-9


@pytest.mark.parametrize("away", [0.0, 1e-300, 1e-17, 1e-9, 1e-5])
def test_reversed_tangents_leave_it_as_it_is(away: float) -> None:
    before, after, x = turned(away)
    assert np.array_equal(transported(before, after, x), x)
