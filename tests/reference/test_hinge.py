"""The geometry of a hinge: its derivatives, and that it is objective."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dlocore.reference.hinge import add_curvature_of_strains, carry, gradients, strains

STEP = 1e-4


def unit(x):
    return x / np.linalg.norm(x)


def hinge(seed, bend=0.8):
    """Return two edge vectors and a director across each."""
    rng = np.random.default_rng(seed)
    e0 = rng.normal(size=3)
    e1 = unit(e0) + bend * rng.normal(size=3)
    return e0, e1, unit(np.cross(e0, rng.normal(size=3))), unit(np.cross(e1, rng.normal(size=3)))


def framed(e, director, by=None):
    """Return tangent and both directors of an edge, moved and spun by `by` (4,) without a spin of their own."""
    t = unit(e)
    if by is None:
        return t, director, np.cross(t, director)
    moved = unit(e + by[:3])
    first, second = np.empty(3), np.empty(3)
    carry(t, moved, director, by[3], first, second)
    return moved, first, second


def strain(e0, e1, a0, a1, y=None):
    y = np.zeros(8) if y is None else y
    s = np.empty(3)
    strains(*framed(e0, a0, y[[0, 1, 2, 6]]), *framed(e1, a1, y[[3, 4, 5, 7]]), 0.0, s)
    return s


@pytest.mark.parametrize("seed", range(5))
def test_first_derivatives_are_those_of_the_strains(seed):
    e0, e1, a0, a1 = hinge(seed)
    B = np.empty((3, 8))
    gradients(*framed(e0, a0), *framed(e1, a1), strain(e0, e1, a0, a1), B)
    for part, e in ((slice(0, 3), e0), (slice(3, 6), e1)):
        t = unit(e)
        B[:, part] = (B[:, part] - np.outer(B[:, part] @ t, t)) / np.linalg.norm(e)
    central = [(strain(e0, e1, a0, a1, d) - strain(e0, e1, a0, a1, -d)) / (2 * STEP) for d in STEP * np.eye(8)]
    np.testing.assert_allclose(B, np.transpose(central), atol=1e-6)  # STEP^2 of strains of order 1, over short edges


@pytest.mark.parametrize("seed", range(5))
def test_second_derivatives_are_those_of_the_strains(seed):
    e0, e1, a0, a1 = hinge(seed)
    stress = np.random.default_rng(seed).normal(size=3)
    frames = (*framed(e0, a0), *framed(e1, a1))
    s = strain(e0, e1, a0, a1)
    B, H = np.empty((3, 8)), np.zeros((8, 8))
    gradients(*frames, s, B)
    add_curvature_of_strains(*frames, s, B, stress, H)
    J = np.eye(8)
    for first, e in ((0, e0), (3, e1)):
        t = unit(e)
        J[first : first + 3, first : first + 3] = (np.eye(3) - np.outer(t, t)) / np.linalg.norm(e)
    H = J.T @ H @ J
    for first, e in ((0, e0), (3, e1)):
        part, t, size = slice(first, first + 3), unit(e), float(np.linalg.norm(e))
        g = (stress @ B)[part]
        P = np.eye(3) - np.outer(t, t)
        H[part, part] -= (np.outer(P @ g, t) + np.outer(t, P @ g) + (g @ t) * P) / size**2

    def energy(y):
        return float(stress @ strain(e0, e1, a0, a1, y))

    d = STEP * np.eye(8)
    central = [[(energy(a + b) - energy(a - b) - energy(b - a) + energy(-a - b)) / (4 * STEP**2) for b in d] for a in d]
    np.testing.assert_allclose(H, central, atol=2e-6 * max(1.0, np.abs(H).max()))  # STEP^2, and 1e-16/STEP^2


def test_strains_do_not_change_when_space_turns():
    e0, e1, a0, a1 = hinge(7)
    turn = Rotation.from_rotvec([0.3, -2.0, 1.1]).as_matrix()
    moved = strain(*(turn @ x for x in (e0, e1, a0, a1)))
    np.testing.assert_allclose(moved, strain(e0, e1, a0, a1), atol=1e-14)


def test_a_spin_of_one_edge_is_twist_and_counts_full_turns():
    e0, e1, a0, a1 = hinge(3)
    before = strain(e0, e1, a0, a1)[2]
    first, second, s = np.empty(3), np.empty(3), np.empty(3)
    t1 = unit(e1)
    for angle in (0.4, 3.5, 7.0, -20.0):
        carry(t1, t1, a1, angle, first, second)
        strains(*framed(e0, a0), t1, first, second, before + angle, s)
        assert s[2] == pytest.approx(before + angle, abs=1e-13)
