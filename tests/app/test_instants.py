"""The instants at which a whole motion is drawn follow its way: a short move in a long rest is drawn, too."""

import numpy as np
import pytest

from app.instants import instants
from dlocore import SplineSurface
from dlocore.spline import uniform_knots

LENGTH, HORIZON, SHARE = 2.0, 24.0, 49


def sideways(y: np.ndarray) -> SplineSurface:
    """Return a straight cable whose rows of control points in time lie at `y` (n_t,) [m]."""
    knots_u = uniform_knots(4, LENGTH)
    points = np.zeros((len(y), 4, 4))
    points[..., 0] = np.linspace(0.0, LENGTH, 4)
    points[..., 1] = y[:, None]
    return SplineSurface(points, knots_u, uniform_knots(len(y), HORIZON))


def test_a_move_there_and_back_in_a_long_rest_is_followed():
    y = np.zeros(400)
    y[7:10] = 0.5
    surface = sideways(y)
    t = instants(surface, SHARE)
    drawn = surface.positions([0.0], t)[:, 0, 1]
    assert (t[0], t[-1]) == (0.0, HORIZON)
    assert (np.diff(t) > 0.0).all()
    assert drawn.max() == pytest.approx(surface.positions([0.0], np.linspace(0.0, 1.0, 999))[:, 0, 1].max(), abs=2e-3)
    assert np.abs(np.diff(drawn)).max() < 1.1 / (SHARE - 1)  # m, of a way of 1 m


def test_a_cable_at_rest_has_them_evenly_in_time():
    np.testing.assert_allclose(instants(sideways(np.zeros(8)), 9), np.linspace(0.0, HORIZON, 9), atol=1e-9)


def test_a_motion_that_has_diverged_has_them_evenly_in_time():
    with np.errstate(all="ignore"):
        t = instants(sideways(np.geomspace(1.0, 1e300, 12)), 9)
    np.testing.assert_allclose(t, np.linspace(0.0, HORIZON, 9))
