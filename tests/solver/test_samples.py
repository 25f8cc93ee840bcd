"""Surfaces at evenly spaced times and places, where two marches are compared, and how they are curved there."""

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline

from dlocore import Cable, Environment, Grasp, Move, Scene, Straight
from dlocore.kernels.timefit import sampled
from dlocore.levels.level import distance, stretched
from dlocore.levels.progress import surface_at
from dlocore.levels.whole_march import march_level
from dlocore.problem.events import moments
from dlocore.problem.problem import pose
from dlocore.solvers.monitor import Monitor
from dlocore.spline import SplineSurface, uniform_knots


@pytest.mark.parametrize("nc", [2, 3, 4])
def test_samples_are_those_of_the_surface(nc: int) -> None:
    control = np.random.default_rng(nc).normal(size=(11, 9, nc))
    knots_u, knots_t = uniform_knots(9, 0.8), np.sort(np.concatenate([uniform_knots(10, 1.5), [0.6]]))
    found = sampled(knots_t, knots_u, control, 49, 33)
    full = np.concatenate([control, np.zeros((11, 9, 4 - nc))], axis=2)
    surface = SplineSurface(full, knots_u, knots_t)
    expected = surface(np.linspace(0.0, 0.8, 33), np.linspace(0.0, 1.5, 49))
    np.testing.assert_allclose(found, expected[..., :nc], atol=1e-14)  # rounding


def test_what_a_second_of_a_long_motion_brings_is_seen() -> None:
    # a level rod is let go at its middle, and rings for a second of forty: at 33 times of them little of that had shown
    scene = Scene(
        cable=Cable(length=1.0, diameter=0.006, linear_density=0.026, bending_stiffness=0.38),
        shape=Straight(),
        grasps=(Grasp(u=0.5, hold="tangent", path=Move(displacement=(0.05, -0.1, 0.1), duration=40.0)),),
        environment=Environment(drag=0.1),
        effects={"inertia": "on"},
    )
    assert moments(scene, 33) == 20 * 32 + 1
    problem = pose(scene)
    a, b = (march_level(problem, stretched(problem, number), Monitor(), free_knots=True) for number in (0, 1))
    u, t = np.linspace(0.0, 1.0, 33), np.linspace(0.0, 2.0, 401)
    first, second = (surface_at(level, level.control).positions(u, t) for level in (a, b))
    assert distance(a, b) > 0.5 * np.linalg.norm(first - second, axis=-1).max()


def test_curvature_is_that_of_a_circle_and_none_where_the_surface_stands_in_one_point():
    angle = np.linspace(0.0, 2.0, 161)
    knots_t = uniform_knots(4, 1.0)
    circle = make_interp_spline(
        0.5 * angle, 0.5 * np.column_stack([np.cos(angle), np.sin(angle), 0 * angle, 0 * angle])
    )
    surface = SplineSurface(np.tile(circle.c, (4, 1, 1)), circle.t, knots_t)
    np.testing.assert_allclose(surface.curvature(np.linspace(0.05, 0.95, 9), [0.0, 0.5]), 2.0, rtol=1e-4)
    still = SplineSurface(np.zeros_like(surface.control_points), circle.t, knots_t)
    assert (still.curvature([0.0, 0.5], [0.0, 1.0]) == 0.0).all()
