"""Paths along a spline through their waypoints: how they begin and how they end."""

import numpy as np

from dlocore import Waypoints
from dlocore.scene.paths import Start
from tests.solver.scenes import Floats

STEP = 1e-5  # [s]


def along(x: Floats, start: Start) -> Waypoints:
    """Return a path along x, of so many waypoints [m] a second apart."""
    return Waypoints(times=np.arange(len(x)), positions=np.outer(x, [1.0, 0.0, 0.0]), start=start)


def ends(path: Waypoints) -> tuple[Floats, Floats]:
    """Return velocity [m/s] and acceleration [m/s^2] along x at its begin and its end (2,)."""
    three = STEP * np.array([0.0, 1.0, 2.0])
    first, last = (path.at(t, np.zeros(3))[:, 0] for t in (three, path.duration - three))
    speed = np.array([-1.5 * first[0] + 2.0 * first[1] - 0.5 * first[2], 1.5 * last[0] - 2.0 * last[1] + 0.5 * last[2]])
    return speed / STEP, np.array([x[0] - 2.0 * x[1] + x[2] for x in (first, last)]) / STEP**2


def test_from_rest_it_ends_with_the_velocity_that_it_has_by_then() -> None:
    """By hand, with M the accelerations at the waypoints: 2 M0 + M1 = 6, M0 + 4 M1 + M2 = 0 and M2 = 0."""
    speed, acceleration = ends(along(np.array([0.0, 1.0, 2.0]), "rest"))
    np.testing.assert_allclose(speed, [0.0, 6.0 / 7.0], atol=1e-6)
    np.testing.assert_allclose(acceleration, [24.0 / 7.0, 0.0], atol=1e-3)


def test_in_motion_it_is_the_cubic_that_its_first_and_its_last_waypoints_lie_on() -> None:
    t = np.arange(5.0)
    path = along(t - 0.3 * t**2 + 0.1 * t**3, "moving")
    fine = np.linspace(0.0, 4.0, 41)
    np.testing.assert_allclose(path.at(fine, np.zeros(3))[:, 0], fine - 0.3 * fine**2 + 0.1 * fine**3, atol=1e-13)
