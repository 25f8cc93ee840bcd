import numpy as np
import pytest

from dlocore.errors import SceneError
from dlocore.scene import ControlPoints, Points, Straight
from dlocore.shape import fit_to_knots, start_curve
from dlocore.spline import uniform_knots


def test_straight_is_exact_on_any_knots() -> None:
    start, direction = np.array([0.3, -0.2, 1.0]), np.array([1.0, 2.0, -2.0]) / 3
    curve = start_curve(Straight(start=start, direction=7 * direction), 1.3)
    knots = np.array([0, 0, 0, 0, 0.1, 0.5, 0.5, 0.9, 1.3, 1.3, 1.3, 1.3])
    u = np.linspace(0, 1.3, 50)
    greville = (knots[1:-3] + knots[2:-2] + knots[3:-1]) / 3
    assert np.abs(curve(u) - start - u[:, None] * direction).max() < 1e-15  # rounding of numbers near 1
    assert np.abs(fit_to_knots(curve, knots) - start - greville[:, None] * direction).max() < 1e-15


def test_control_points_on_their_own_knots_pass_bit_exact() -> None:
    knots = uniform_knots(9, 1.0)
    straight = fit_to_knots(start_curve(Straight(), 1.0), knots)
    control = straight + 0.01 * np.sin(7 * straight[:, [1, 0, 0]])
    assert (fit_to_knots(start_curve(ControlPoints(control_points=control), 1.0), knots) == control).all()


def test_points_of_another_cable_are_refused_by_name() -> None:
    points = np.linspace(0, 1.2, 20)[:, None] * [1.0, 0.0, 0.0]
    with pytest.raises(SceneError, match=r"cable\.length") as error:
        start_curve(Points(points=points), 1.0)
    assert error.value.field == "shape.points"
