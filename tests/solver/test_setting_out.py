"""A cable that is pulled along itself from one moment to the next sets out all at once."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from benchmarks.hard.generator import draw
from dlocore import Cable, Environment, Grasp, Move, Quality, Scene, Straight, Table, predict, sensitivities
from dlocore.levels.level import Size, run_level
from dlocore.problem.discretisation import make_grid
from dlocore.problem.problem import pose
from dlocore.solvers.march import march
from dlocore.solvers.monitor import Monitor

LENGTH, SPEED = 1.0, 1.0
DRAG = Environment(gravity=(0.0, 0.0, 0.0), drag=0.2)
GRID = Quality(n_u=9, n_t=13, method="march", keep_grid=True)
PULLED = Scene(
    cable=Cable(length=LENGTH, diameter=0.005, linear_density=0.05, bending_stiffness=1e-2),
    shape=Straight(direction=(1.0, 0.0, 0.0)),
    grasps=(Grasp(u=0.0, path=Move(displacement=(-0.5 * SPEED, 0.0, 0.0), duration=0.5, profile="linear")),),
    environment=replace(DRAG, drag=0.0),
    quality=GRID,
    horizon=0.5,
)


def off(scene: Scene, begin: float = 0.0) -> float:
    """Return how far a prediction is from the straight cable that moves at the speed of its gripper [m]."""
    found = predict(scene)
    assert found.status == "converged", found.message
    u, t = np.linspace(0.0, LENGTH, 33), np.linspace(0.0, found.surface.horizon, 141)
    exact = np.zeros((141, 33, 3))
    exact[..., 0] = u - SPEED * np.maximum(t - begin, 0.0)[:, None]
    return float(np.linalg.norm(found.surface.positions(u, t) - exact, axis=-1).max())


@pytest.mark.parametrize(
    "changes",
    [
        pytest.param({}, id="in one call"),
        pytest.param({"effects": {"twist": "on"}}, id="with twist"),
        pytest.param({"environment": Environment(drag=0.2, table=Table(friction=0.3))}, id="on a table"),
        pytest.param({"environment": DRAG, "effects": {"inertia": "off"}}, id="without inertia"),
        pytest.param({"environment": DRAG, "quality": replace(GRID, method="spacetime")}, id="by the least squares"),
    ],
)
def test_a_straight_cable_pulled_along_itself_moves_as_one(changes: dict[str, Any]) -> None:
    assert off(replace(PULLED, **changes)) < 5e-4 * LENGTH  # it was 9e-3


@pytest.mark.parametrize("method", ["march", "spacetime"])
def test_so_it_does_where_the_gripper_closes_in_mid_motion(method: Any) -> None:
    grasp = replace(PULLED.grasps[0], grasp_time=0.2)
    later = replace(PULLED, grasps=(grasp,), quality=replace(GRID, n_t=19, method=method), horizon=0.7)
    assert off(later, begin=0.2) < 5e-4 * LENGTH  # it was 9e-3 by the least squares


def test_what_is_held_has_its_own_velocity_from_the_beginning() -> None:
    """A direction that turns at a speed goes another way in the first step than at once."""
    spin = 4.0
    turned = Move(displacement=(-SPEED, 0.0, 0.0), rotation=(0.0, 0.0, spin), duration=1.0, profile="linear")
    problem = pose(replace(PULLED, grasps=(Grasp(u=0.0, hold="clamp", path=turned),), horizon=1.0))
    grid = make_grid(problem, 9)
    motion = march(problem, grid, 20, Monitor())
    chord = (motion.states[1] - motion.states[0]) / motion.times[1]
    at_once, later = (grid.at(v, 0.0, 1)[:3] for v in (motion.velocity, chord))
    assert at_once == pytest.approx([0.0, spin, 0.0], abs=1e-3)
    assert later[0] < -0.3  # a chord of the circle
    assert np.abs(motion.velocity[1:, 0] + SPEED).max() < 0.05 * SPEED  # the rest sets out with it


def test_its_sensitivity_to_the_way_is_the_way() -> None:
    found = sensitivities(predict(PULLED), ["grasps[0].path.displacement[0]"])
    assert found.exact == (True,)
    assert found(LENGTH, 0.02)[0, 0, 0] == pytest.approx([0.04, 0.0, 0.0], abs=1e-3)  # of its far end; it was 0.024


def test_what_springs_away_at_once_is_compared_while_it_does():
    """Of 0.97 s it takes 12 ms: between the evenly spaced times the first grids were 4.7 % off, 0.1 % as estimated."""
    scene = draw(155, 227).make()
    found, fine = predict(scene), predict(replace(scene, quality=Quality(target_error=5e-4 * scene.cable.length)))
    assert found.status == fine.status == "converged"
    u, t = np.linspace(0.0, scene.cable.length, 51), np.linspace(0.0, 0.05, 101)
    error = np.linalg.norm(found.surface.positions(u, t) - fine.surface.positions(u, t), axis=2).max()
    assert error < 2.0 * found.accuracy.error_estimate
    assert error < scene.quality.target_error
    assert found.level.sudden == [0.0]


@pytest.mark.parametrize(("speed", "sudden"), [(2.0, [0.5]), (0.02, [])])
def test_when_a_motion_sets_out_at_once_is_told_by_how_far_it_comes(speed: float, sudden: list[float]):
    path = Move(displacement=(0.0, 0.2 * speed, 0.0), duration=0.2, profile="linear")
    kicked = Scene(
        cable=Cable.preset("paper"),
        shape=Straight(),
        grasps=(Grasp(u=0.0, path=path, grasp_time=0.5),),
        environment=Environment(drag=0.1, table=Table()),
        horizon=1.5,
    )
    level = run_level(pose(kicked), *Size(13, 40, 120), Monitor(), free_knots=True)
    assert [t for t in level.sudden if t < 0.6] == sudden


def test_surfaces_are_the_same_at_any_times():
    level = predict(draw(155, 227).make()).level
    times = np.linspace(0.0, level.problem.horizon, len(level.samples))
    np.testing.assert_allclose(level.at(times), level.samples, atol=1e-12)
