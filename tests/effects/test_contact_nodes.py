"""Where contact acts: the table at few nodes, obstacles at many about edges; and what slides does not strike."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.pairs import paired
from benchmarks.table_scenes import draw
from dlocore import Box, Cable, Cylinder, Environment, Grasp, Move, Quality, Scene, Sphere, Straight, Table, predict
from dlocore.kernels.contact import strikes
from dlocore.kernels.entry import remember_start
from dlocore.levels.level import Size
from dlocore.levels.whole_march import march_level
from dlocore.problem.discretisation import make_grid
from dlocore.problem.grid import Grid
from dlocore.problem.problem import Problem, pose
from dlocore.scene.obstacles import Obstacle
from dlocore.solvers.monitor import Monitor
from tests.solver.scenes import Floats

D = 0.005  # [m]
PEG = Cylinder(center=(0.5, 0.0, -0.02 - D / 2), axis=(0.0, 1.0, 0.0), radius=0.02, height=0.2)


def block(length: float, friction: float = 0.0) -> Box:
    """Return a block whose top a cable at z = 0 just touches, and whose edges lie half its length from its middle."""
    return Box(center=(0.5, 0.0, -0.1 - D / 2), size=(length, 1.0, 0.2), friction=friction)


def posed(*obstacles: Obstacle, table: Table | None = None) -> tuple[Problem, Grid]:
    """Return the problem and the grid of a straight cable along x from the origin, drawn on by its end."""
    cable = Cable(length=1.0, diameter=D, linear_density=0.05, bending_stiffness=1e-3)
    pull = Grasp(u=1.0, path=Move(displacement=(0.02, 0.0, 0.01), duration=1.0))
    scene = Scene(
        cable=cable, shape=Straight(direction=(1.0, 0.0, 0.0)), grasps=(pull,),
        environment=Environment(obstacles=obstacles, table=table), effects={"obstacles": "on"} if obstacles else {},
    )  # fmt: skip
    problem = pose(scene)
    return problem, make_grid(problem, 20)


def pressing(problem: Problem, grid: Grid) -> tuple[Floats, Floats]:
    """Return where the nodes for obstacles lie that act [m], and their weights [m]."""
    history = grid.past()
    remember_start(problem.axes, grid.start, grid.tables, *problem.laws, history)
    weights = history.pressing[grid.tables.contact.table_nodes :]
    acts = weights > 0.0
    return np.asarray(grid.tables.contact.u[grid.tables.contact.table_nodes :][acts]), weights[acts]


def apart(u: Floats, low: float, high: float) -> float:
    """Return the largest distance [m] of neighbours among the places u from `low` to `high`."""
    return float(np.diff(u[(u > low) & (u < high)]).max())


# --- nodes ---


def test_few_nodes_act_on_the_inside_of_a_face_and_many_about_its_edges() -> None:
    u, weights = pressing(*posed(block(0.4)))
    assert apart(u, 0.33, 0.67) == pytest.approx(D, rel=0.1)
    for edge in (0.3, 0.7):
        assert apart(u, edge - 1.5 * D, edge + 1.5 * D) <= D / 16
    assert apart(u, 0.0, 0.28) <= D / 16  # where it touches nothing it may come upon an edge
    assert weights.sum() == pytest.approx(1.0)


def test_what_is_not_a_step_of_a_march_has_all_nodes() -> None:
    _, grid = posed(block(0.4))
    assert np.array_equal(grid.past().pressing, grid.tables.contact.w)


def test_something_round_needs_few_nodes_beside_something_with_edges() -> None:
    ball = Sphere(center=(0.5, 0.0, -0.05 - D / 2), radius=0.05)
    u, _ = pressing(*posed(ball, Box(center=(0.5, 0.0, 0.5), size=(0.1, 0.1, 0.1))))
    needed = np.sqrt(0.04 * D * (0.05 + D / 2))
    assert 0.5 * needed < apart(u, 0.495, 0.505) <= needed


def test_a_table_has_nodes_of_its_own_however_fine_those_for_obstacles_are() -> None:
    alone = posed(table=Table(height=-D))[1].tables
    beside = posed(block(0.4), table=Table(height=-0.3))[1].tables
    assert beside.contact.table_nodes == alone.contact.table_nodes < 100
    assert len(beside.contact.u) - beside.contact.table_nodes > 2000


def test_a_cell_that_the_cable_stands_on_with_its_end_has_all_its_nodes() -> None:
    # its middle is above the face where its end is in it: a tip went 22 % of D into a wall, unseen
    down = Straight(start=(0.5, 0.0, 0.2 * D), direction=(np.sqrt(0.5), 0.0, np.sqrt(0.5)))
    cable = Cable(length=0.1, diameter=D, linear_density=0.05, bending_stiffness=1e-3)
    scene = Scene(
        cable=cable, shape=down, grasps=(Grasp(u=0.1),), environment=Environment(obstacles=(block(2.0),)),
        effects={"obstacles": "on"}, horizon=1.0,
    )  # fmt: skip
    problem = pose(scene)
    u, _ = pressing(problem, make_grid(problem, 9))
    assert u[0] == 0.0
    assert apart(u, 0.0, D) <= D / 16


def test_a_cable_that_unrolls_on_the_table_is_struck_alike_on_every_grid() -> None:
    # with nodes L/64 apart whatever the grid its impulse was 0.5 % too small, and changed by 0.8 %
    cable = Cable(length=1.0, diameter=D, linear_density=0.04, bending_stiffness=1e-3, bending_damping=1e-4)
    tilted = Straight(start=(0.0, 0.0, 0.1), direction=(np.cos(0.3), 0.0, np.sin(0.3)))
    fall = Scene(
        cable=cable, shape=tilted, environment=Environment(table=Table(friction=0.0)),
        effects={"twist": "off", "self_contact": "off"}, horizon=0.22,
    )  # fmt: skip
    problem = pose(fall)
    impulses = []
    for n_u in (41, 49, 65):
        level = march_level(problem, Size(n_u, 65, 880), Monitor(), free_knots=True)
        tables = level.motion.grid.tables
        height = problem.plane.world(level.motion.states)[..., 2] @ tables.weight
        a, b = np.searchsorted(level.motion.times, [0.19, 0.2])
        velocity = (height[b] - height[a]) / (level.motion.times[b] - level.motion.times[a])
        impulses.append(velocity + 9.81 * 0.195)  # of a metre, over its mass [m/s]
    assert np.ptp(impulses) < 2.5e-3 * np.mean(impulses)


@pytest.mark.parametrize("friction", [0.0, 0.4])
def test_the_top_of_a_block_is_as_good_as_a_table(friction: float) -> None:
    cable = Cable(length=1.0, diameter=D, linear_density=0.05, bending_stiffness=2e-3, bending_damping=2e-5)
    grasp = Grasp(u=0.0, hold="clamp", path=Move(displacement=(0.2, 0.1, 0.1), duration=1.0))
    ends = []
    for environment in (
        Environment(drag=0.05, table=Table(height=0.0, friction=friction)),
        Environment(drag=0.05, obstacles=(block(3.0, friction),)),
    ):
        scene = Scene(
            cable=cable, shape=Straight(direction=(1.0, 0.0, 0.0)), grasps=(grasp,), environment=environment,
            quality=Quality(target_error=1e-3), horizon=1.2,
        )  # fmt: skip
        prediction = predict(scene)
        assert prediction.status == "converged"
        ends.append(prediction.surface(np.linspace(0.0, 1.0, 41), np.linspace(0.0, 1.2, 25))[..., :3])
    assert np.linalg.norm(ends[0] - ends[1], axis=-1).max() < 2e-3  # what both may err by


@pytest.mark.parametrize("index", [20, 24])
def test_a_cable_lifted_among_obstacles_on_a_table_moves_as_the_reference_does(index: int) -> None:
    drawn = draw(1, index)
    scene, found = drawn.scene, predict(drawn.scene)
    assert {"obstacles", "table", "friction"} <= {effect.name for effect in found.effects if effect.active}
    quality = Quality(method="reference", target_error=3e-3 * scene.cable.length)
    reference = predict(replace(scene, quality=quality))
    assert found.status == reference.status == "converged"
    assert paired(drawn, found, reference).apart < 5e-3


# --- strikes ---


def strike(obstacle: Obstacle, before: Floats, move: tuple[float, float, float]) -> bool:
    """Tell whether the straight cable, displaced by `before` [m], strikes as it moves by `move` [m]."""
    problem, grid = posed(obstacle)
    q0 = grid.start + np.asarray(before)
    q1 = q0 + np.asarray(move)
    return bool(strikes(problem.nc, q0, q1, grid.tables.contact, problem.laws[1], grid.tables.contact.w, 1e-4))


DEEP = -0.02 * D


@pytest.mark.parametrize("obstacle", [PEG, block(0.04)], ids=["peg", "block"])
def test_what_slides_to_where_its_neighbours_touched_does_not_strike(obstacle: Obstacle) -> None:
    assert not strike(obstacle, np.array([0.0, 0.0, DEEP]), (0.02, 0.0, DEEP))


@pytest.mark.parametrize("obstacle", [PEG, block(0.04), block(3.0)], ids=["peg", "block", "face"])
@pytest.mark.parametrize("along", [0.0, 0.05])
def test_what_comes_down_on_something_strikes(obstacle: Obstacle, along: float) -> None:
    assert strike(obstacle, np.array([0.0, 0.0, 5e-4]), (along, 0.0, -6e-4))
    assert not strike(obstacle, np.array([0.0, 0.0, 5e-5]), (along, 0.0, -9e-5))  # too slowly
