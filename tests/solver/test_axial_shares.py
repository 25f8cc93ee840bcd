"""The strain at the axial points of a cable under one tension (kernels/basis.py, `shares`)."""

import numpy as np
import pytest
from scipy.interpolate import BSpline

from dlocore.kernels.basis import GAUSS_3, gauss_points, graded_knots
from tests.tables import plain_tables

FEATURES = [
    ((), ()),
    ((0.25,), (1,)),
    ((0.25,), (2,)),
    ((0.0, 1.0), (1, 1)),
    ((0.01, 0.7), (2, 1)),
    ((0.5,), (3,)),
    ((0.3, 0.7, 0.9), (3, 1, 2)),
]


@pytest.mark.parametrize("ends", [(True, True), (True, False), (False, True), (False, False)])
@pytest.mark.parametrize(("places", "multiplicity"), FEATURES)
@pytest.mark.parametrize("n", [13, 29, 129])
def test_they_bear_one_tension(n, places, multiplicity, ends):
    power, width = np.ones(len(places)), np.full(len(places), 0.05)
    knots = graded_knots(n, 1.0, np.array(places, float), np.array(multiplicity, np.int64), power, width)
    axial = plain_tables(knots, *ends).axial
    u, w = gauss_points(knots, *GAUSS_3)
    own, over = (BSpline(knots[1:-1], np.eye(n - 1), 2)(at) for at in (axial.u, u))
    left = own.T @ (axial.w * axial.share) - over.T @ w
    for k in np.unique(knots[4:-4]):  # both sides of a triple knot are held together
        if np.count_nonzero(knots == k) == 3:
            j = int(np.searchsorted(knots, k)) - 1
            left[j - 1], left[j] = left[j - 1] + left[j], 0.0
    held = slice(0 if ends[0] else 1, None if ends[1] else -1)  # the direction of an end bears what is left there
    assert np.abs(left[held]).max() < 1e-14
    assert axial.share.min() > 0.0
