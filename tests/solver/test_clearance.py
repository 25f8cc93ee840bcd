"""The gap that is left to obstacles, against surfaces that are sampled densely."""

import numpy as np
import pytest

from dlocore import (
    Box,
    Cable,
    Capsule,
    Cylinder,
    Environment,
    Grasp,
    Move,
    Scene,
    Sphere,
    SplineSurface,
    Straight,
    predict,
)
from dlocore.answer.clearance import least_distance
from dlocore.effects.distance import distances
from dlocore.scene.obstacles import Obstacle
from dlocore.spline import greville, uniform_knots
from tests.solver.scenes import Floats


def sampled(surface: SplineSurface, rows: Floats) -> float:
    """Return the least distance [m] of a million points of a surface."""
    u, t = np.linspace(0.0, surface.length, 1000), np.linspace(0.0, surface.horizon, 1000)
    return min(float(distances(rows, surface.positions(u, [s])[0]).min()) for s in t)


def wavy(seed: int) -> SplineSurface:
    """Return a motion that goes to and fro as a cable of 1 m does not, with a double knot in time."""
    rng = np.random.default_rng(seed)
    knots_u, knots_t = uniform_knots(12, 1.0), uniform_knots(16, 2.0)
    knots_t[8] = knots_t[7]
    control = np.zeros((16, 12, 4))
    control[..., 0] = np.linspace(0.0, 1.0, 12)
    control[..., :3] += rng.normal(scale=0.1, size=(16, 12, 3))
    return SplineSurface(control, knots_u, knots_t)


OBSTACLES: dict[str, Obstacle] = {
    "sphere": Sphere(center=(0.5, 0.2, 0.3), radius=0.004),
    "capsule": Capsule(start=(0.2, 0.3, 0.0), end=(0.7, 0.4, 0.1), radius=0.01),
    "cylinder": Cylinder(center=(0.4, -0.3, 0.1), radius=0.03, height=0.1, axis=(1.0, 0.2, 0.0)),
    "box": Box(center=(0.5, 0.0, 0.5), size=(0.1, 0.2, 0.02), orientation=(0.8, 0.6, 0.0, 0.0)),
}


@pytest.mark.parametrize("kind", OBSTACLES)
def test_the_least_distance_is_that_of_a_million_points(kind: str) -> None:
    rows = OBSTACLES[kind].row()[None]
    for seed in range(3):
        surface = wavy(seed)
        least, best = least_distance(surface, rows, 2e-5), sampled(surface, rows)
        assert best - 5e-4 < least < best + 2e-5  # what they miss between them, and the tolerance


def test_the_least_distance_is_that_of_the_nearest_of_several_obstacles() -> None:
    surface = wavy(0)
    rows = [obstacle.row()[None] for obstacle in OBSTACLES.values()]
    alone = [least_distance(surface, row, 2e-5) for row in rows]
    assert least_distance(surface, np.concatenate(rows), 2e-5) == pytest.approx(min(alone), abs=2e-5)


def test_a_corner_of_a_saddle_is_nearer_than_its_slopes_at_the_middle_tell() -> None:
    """The cable turns in the x-z plane about its middle, which goes nowhere: a cell that bends by r_ut alone."""
    knots = uniform_knots(4, 1.0)
    u, t = greville(knots), greville(knots)[:, None]
    control = np.stack([u + 0.0 * t, 0.0 * u * t, 1.2 * (u - 0.5) * (t - 0.5), 0.0 * u * t], axis=-1)
    surface = SplineSurface(control, knots, knots)
    middle, corner = Sphere(center=(0.5, 0.08, 0.0), radius=0.03), Sphere(center=(1.0, 0.0, 0.3), radius=0.01)
    rows = np.stack([middle.row(), corner.row()])
    assert least_distance(surface, rows[:1], 1e-5) == pytest.approx(0.05, abs=1e-5)
    assert least_distance(surface, rows, 1e-5) == pytest.approx(-0.01, abs=1e-5)


def test_a_dip_is_found_beside_many_cells_that_bend_more() -> None:
    """The cable lies 10 mm above a floor. It trembles sideways at first, and dips a little later."""
    knots_u, knots_t = uniform_knots(13, 1.0), uniform_knots(25, 2.0)
    control = np.zeros((25, 13, 4))
    control[..., 0], control[..., 2] = greville(knots_u), 0.01
    control[:12, :, 1] = 0.003 * np.random.default_rng(0).normal(size=(12, 13))
    control[18, 6, 2] = 0.008
    floor = Box(center=(0.5, 0.0, -0.5), size=(3.0, 3.0, 1.0)).row()[None]
    dip = 0.002 * (2.0 / 3.0) ** 2  # of a control point at its knots
    for tremble in (1.0, 10.0, 100.0):  # in the end the rounds do not suffice to exclude all others
        trembling = SplineSurface(control * [1.0, tremble, 1.0, 1.0], knots_u, knots_t)
        assert least_distance(trembling, floor, 5e-5) == pytest.approx(0.01 - dip, abs=5e-5)


def test_the_gap_of_a_cable_that_passes_a_small_ball_early_in_a_long_motion_is_found() -> None:
    ball = Sphere(center=(0.25, 0.254, 0.0085), radius=0.006)
    prediction = predict(
        Scene(
            cable=Cable.preset("paper"),
            shape=Straight(),
            grasps=[Grasp(u=0.25, path=Move(displacement=(0.0, 0.5, 0.0), duration=1.0))],
            environment=Environment(gravity=(0.0, 0.0, 0.0), drag=1.0, obstacles=[ball]),
            horizon=20.0,
        )
    )
    (obstacles,) = (effect for effect in prediction.effects if effect.name == "obstacles")
    t = np.linspace(0.4, 0.6, 2001)  # as it passes
    near = prediction.surface.positions(np.linspace(0.2, 0.3, 501), t)
    gap = np.linalg.norm(near - ball.center, axis=-1).min() - ball.radius - 0.0025
    assert abs(gap) < 2e-4, "it touches"
    assert obstacles.magnitude == pytest.approx(gap, abs=5e-5)  # 1 % of the diameter
