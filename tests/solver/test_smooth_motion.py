"""A smooth motion marched in one compiled call: it is the march that goes from stretch to stretch."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from dlocore import (
    Cable,
    Environment,
    Grasp,
    Load,
    Move,
    Points,
    Scene,
    Sphere,
    Straight,
    Table,
    Waypoints,
)
from dlocore.levels.level import run_level
from dlocore.problem.discretisation import make_grid
from dlocore.problem.problem import Problem, pose
from dlocore.problem.time_grid import time_knots
from dlocore.solvers.march import CHUNK, RHO, March, chunk_of, march
from dlocore.solvers.monitor import Monitor
from dlocore.solvers.smooth import march_smooth
from dlocore.solvers.timefit import fit
from dlocore.solvers.watched import watched

Floats = NDArray[np.float64]

CABLE = Cable(length=1.0, diameter=0.005, linear_density=0.05, bending_stiffness=1e-3)
ARC = np.column_stack([np.sin(np.linspace(0.0, 1.0, 21)), 1.0 - np.cos(np.linspace(0.0, 1.0, 21)), np.zeros(21)])
AWAY = Move(displacement=(0.1, 0.3, 0.0), duration=1.6)
TURNS = Waypoints(
    times=(0.0, 0.5, 1.0),
    positions=((0.0, 0.0, 0.0), (0.0, 0.1, 0.0), (0.1, 0.2, 0.0)),
    orientations=((1.0, 0.0, 0.0, 0.0), (0.98, 0.0, 0.0, 0.199), (0.92, 0.0, 0.0, 0.392)),
)
SCENE = Scene(
    cable=CABLE,
    shape=Straight(),
    grasps=(Grasp(u=0.25, path=AWAY),),
    environment=Environment(drag=0.05, table=Table()),
    horizon=1.6,
)
ON_TABLE = SCENE.environment
HANGING = Environment(drag=0.05)
LIFT = Move(displacement=(-0.05, 0.1, 0.05), duration=1.6)
STEPS = 60


def solved(
    scene: Scene, n_u: int = 13, steps: int = STEPS
) -> tuple[tuple[March, Floats, Floats] | None, March, Floats]:
    """Return what the one call gives, what the general march does, and the time knots."""
    problem = pose(scene)
    grid = make_grid(problem, n_u)
    knots_t = time_knots(problem, 17)
    assert knots_t is not None
    general = march(problem, grid, steps, Monitor())
    return march_smooth(problem, grid, steps, knots_t, Monitor(), RHO), general, knots_t


@pytest.mark.parametrize(
    "scene",
    [
        pytest.param(SCENE, id="pulled at a point"),
        pytest.param(replace(SCENE, grasps=(replace(SCENE.grasps[0], hold="tangent"),)), id="held direction"),
        pytest.param(
            replace(SCENE, grasps=(Grasp(u=0.0, hold="clamp", path=TURNS),), horizon=1.0), id="turned along waypoints"
        ),
        pytest.param(replace(SCENE, shape=Points(points=ARC)), id="bent at the start"),
        pytest.param(
            replace(SCENE, shape=Points(points=ARC), cable=replace(CABLE, rest_shape="initial")), id="bent by nature"
        ),
        pytest.param(replace(SCENE, cable=replace(CABLE, rest_shape=ARC)), id="straightened"),
        pytest.param(replace(SCENE, shape=Straight(velocity=(0.0, 0.5, 0.0))), id="thrown"),
        pytest.param(replace(SCENE, cable=replace(CABLE, bending_damping=1e-4)), id="damped"),
        pytest.param(
            replace(SCENE, grasps=(Grasp(u=0.0),), environment=Environment(drag=0.05, drag_quadratic=0.1)), id="falls"
        ),
        pytest.param(replace(SCENE, environment=Environment(drag=0.05)), id="falls and is pulled sideways"),
        pytest.param(
            replace(
                SCENE,
                environment=Environment(drag=0.05, drag_quadratic=0.1),
                cable=replace(CABLE, bending_damping=1e-4),
                effects={"twist": "off"},
            ),
            id="damped in space",
        ),
        pytest.param(
            replace(
                SCENE,
                shape=Points(points=ARC),
                grasps=(Grasp(u=0.0, hold="tangent"), Grasp(u=1.0, path=LIFT)),
                environment=HANGING,
            ),
            id="hangs between two grippers",
        ),
    ],
)
def test_one_call_is_the_general_march(scene: Scene) -> None:
    smooth, general, knots_t = solved(scene)
    assert smooth is not None
    motion, control, off = smooth
    expected, missed = fit(general, knots_t)
    # the same kernels, in another order of rounding at most
    for ours, theirs in (
        (motion.times, general.times),
        (motion.states, general.states),
        (motion.velocity, general.velocity),
        (control, expected),
        (off, missed),
        (motion.history.memory, general.history.memory),
        (motion.history.past, general.history.past),
        (motion.forces[0].forces, general.forces[0].forces),
        (motion.forces[0].states, general.forces[0].states),
        (motion.slopes, general.slopes),
    ):
        scale = np.abs(theirs).max(initial=0.0)
        np.testing.assert_allclose(ours, theirs, rtol=0.0, atol=1e-9 * scale)
    assert motion.forces[0].held.rows == general.forces[0].held.rows
    assert motion.largest_strain == pytest.approx(general.largest_strain, rel=1e-6)
    assert (motion.reached, motion.stopped, motion.split) == (general.reached, "", 0)
    assert motion.rho == general.rho


@pytest.mark.parametrize(
    "scene",
    [
        pytest.param(replace(SCENE, grasps=(replace(SCENE.grasps[0], release_time=0.8),)), id="let go in mid-motion"),
        pytest.param(replace(SCENE, environment=Environment(table=Table(friction=0.3))), id="rubs"),
        pytest.param(replace(SCENE, loads=(Load(u=1.0, force=(0.0, 0.1, 0.0)),)), id="loaded"),
        pytest.param(
            replace(SCENE, cable=replace(CABLE, yield_strain=1e-3, memory_rate=1.0), effects={"plasticity": "on"}),
            id="yields",
        ),
        pytest.param(replace(SCENE, environment=Environment(drag=0.05), effects={"twist": "on"}), id="twists"),
        pytest.param(
            replace(
                SCENE,
                environment=replace(ON_TABLE, obstacles=(Sphere(center=(0.5, 0.2, 0.0), radius=0.1),)),
                effects={"obstacles": "on"},
            ),
            id="beside an obstacle",
        ),
        pytest.param(replace(SCENE, effects={"inertia": "off"}), id="through equilibria"),
    ],
)
def test_what_is_not_smooth_and_plain_is_left_to_the_general_march(scene: Scene) -> None:
    assert solved(scene)[0] is None


def test_a_long_march_looks_at_the_clock_in_between() -> None:
    assert solved(SCENE, n_u=9, steps=CHUNK)[0] is not None
    assert solved(SCENE, n_u=9, steps=CHUNK + 1)[0] is None


def test_a_fine_grid_in_space_is_left_for_fewer_steps_between_looks_at_the_clock() -> None:
    looks: list[bool] = []

    def look() -> bool:
        looks.append(True)
        return False

    problem = pose(replace(SCENE, effects={"twist": "on"}))
    march(problem, make_grid(problem, 129), CHUNK, Monitor(cancelled=look))
    assert len(looks) > 2  # in one go they would take a tenth of a second


def test_the_clock_is_looked_at_often_where_much_may_touch() -> None:
    # a loop of 48 m, 4 mm thick, overran its deadline of 60 s by 23: 256 of its steps take as long, even on 19 points
    cable = Cable(length=48.0, diameter=0.004, linear_density=0.6, bending_stiffness=9.0)
    alone = Scene(cable=cable, shape=Straight(), grasps=(Grasp(u=0.0),), horizon=1.0, effects={"self_contact": "off"})
    apart, touching = (pose(replace(alone, effects={"self_contact": switch})) for switch in ("off", "on"))
    assert chunk_of(apart, make_grid(apart, 19)) == CHUNK
    assert chunk_of(touching, make_grid(touching, 19)) < 16


def test_a_march_whose_time_is_up_is_left_to_the_general_one_which_says_so() -> None:
    problem = pose(SCENE)
    grid, knots_t = make_grid(problem, 9), time_knots(problem, 13)
    assert knots_t is not None
    late = Monitor(deadline=0.0)
    assert march_smooth(problem, grid, STEPS, knots_t, late, RHO) is None
    assert march(problem, grid, STEPS, late).stopped == "time"


def test_a_step_without_equilibrium_is_left_to_the_general_march_which_says_so() -> None:
    problem = pose(SCENE)
    grid, knots_t = make_grid(problem, 9), time_knots(problem, 13)
    assert knots_t is not None
    nowhere = replace(grid, velocity=np.full_like(grid.velocity, np.nan))
    assert march_smooth(problem, nowhere, STEPS, knots_t, Monitor(), RHO) is None
    assert march(problem, nowhere, STEPS, Monitor()).stopped == "step"


def test_a_watched_grid_keeps_its_points() -> None:
    problem: Problem = pose(SCENE)
    grid = watched(make_grid(problem, 9))
    level = run_level(problem, 9, 13, STEPS, Monitor(), grid=grid)
    expected = march(problem, grid, STEPS, Monitor())
    np.testing.assert_array_equal(level.motion.states, expected.states)
