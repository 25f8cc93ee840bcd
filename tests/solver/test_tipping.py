"""Starts that settle on an equilibrium that any disturbance leaves are tipped off it."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from benchmarks.hard.generator import draw
from dlocore import Cable, Environment, Grasp, Load, Move, Points, Quality, Scene, Table, equilibrium, predict
from dlocore.problem.problem import pose
from dlocore.solvers.monitor import Monitor
from dlocore.statics.statics import start_grid
from dlocore.statics.tipping import TIPPED, falls

SPAN = np.linspace(0.0, 0.6, 33)
X = (SPAN - 0.3) / 0.3
SIDEWAYS = 0.01 * np.sin(np.pi * X)  # to one side and to the other: half a turn about the vertical keeps it


def arch(height: float, **changes: Any) -> Scene:
    """Return an arch on two points that let it turn, which moves up; it is not planar, and half a turn keeps it."""
    points = np.column_stack([SPAN, SIDEWAYS, height * (1.0 - X**2)])
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    lift = Move(displacement=(0.0, 0.0, 0.05), duration=1.0)
    values: dict[str, Any] = {"grasps": (Grasp(u=0.0, path=lift), Grasp(u=length, path=lift))}
    cable = Cable(length=length, diameter=0.005, linear_density=0.1, bending_stiffness=0.2)
    return Scene(cable=cable, shape=Points(points=points, settle=True), **(values | changes))


def settled(scene: Scene, n_u: int) -> Any:
    problem = pose(scene)
    return problem, start_grid(problem, n_u, Monitor())


def test_an_arch_on_two_points_falls_and_hangs():
    found = predict(arch(0.3))
    assert found.status == "converged", found.message
    assert TIPPED in found.message
    hanging = predict(arch(-0.3))
    assert TIPPED not in hanging.message
    u, t = np.linspace(0.0, found.scene.cable.length, 33), [0.0, 0.5, 1.0]
    apart = found.surface.positions(u, t) - hanging.surface.positions(u, t)
    told = found.accuracy.error_estimate + hanging.accuracy.error_estimate
    assert np.linalg.norm(apart, axis=-1).max() < told < 5e-3


@pytest.mark.parametrize("twist", ["off", "on"])
@pytest.mark.parametrize("n_u", [9, 14, 25, 40])
def test_it_falls_to_one_side_on_every_grid(n_u, twist):
    scene = arch(0.3, effects={"twist": twist})
    problem, grid = settled(scene, n_u)
    assert grid.tipped
    assert falls(problem, grid) is None
    assert problem.world(grid.start[None, n_u // 2])[0, 2] < -0.2


@pytest.mark.parametrize("at", [0.0, 0.5, 1.0])
def test_equilibria_are_tipped_too(at):
    u = np.linspace(0.0, arch(0.3).cable.length, 9)
    up, down = (equilibrium(arch(height), at=at) for height in (0.3, -0.3))
    np.testing.assert_allclose(up.positions(u), down.positions(u), atol=1e-3)
    lifted = arch(0.3).grasps[0].path.at(np.array([at]), np.zeros(3))[0, 2]
    assert up.positions(u)[4, 2] < lifted - 0.2
    assert TIPPED in up.message
    assert TIPPED not in down.message


def test_what_stands_until_its_load_is_taken_off_falls_then():
    """A cable that a load holds up stands, and hangs without it."""
    standing = arch(0.3)
    length = standing.cable.length
    force = [[0.0, 0.0, 3.0], [0.0, 0.0, 3.0], [0.0, 0.0, 0.0]]
    held = replace(standing, loads=(Load(u=0.5 * length, force=force, times=[0.0, 0.5, 1.0]),), horizon=1.0)
    before, after = (equilibrium(held, at=at) for at in (0.5, 1.0))
    assert before.positions([0.5 * length])[0, 2] > 0.2
    assert TIPPED not in before.message
    assert after.positions([0.5 * length])[0, 2] < -0.2
    assert TIPPED in after.message


@pytest.mark.parametrize(
    "scene",
    [
        arch(-0.3),
        arch(0.3, environment=Environment(gravity=(0.0, 0.0, 0.0))),  # free to turn, and nothing makes it
        arch(-0.3, grasps=(Grasp(u=0.2),), horizon=1.0),
        arch(0.3, grasps=(Grasp(u=0.0, hold="clamp"),), horizon=1.0),
    ],
    ids=["hangs", "weightless", "hangs from a point", "cantilever"],
)
def test_what_stays_is_left_alone(scene):
    problem, grid = settled(scene, 17)
    assert falls(problem, grid) is None
    assert not grid.tipped


def loop(**changes: Any) -> Scene:
    """Return a loop on a smooth table between two points that let it turn, where it is at rest, and unrolls."""
    turn = np.linspace(0.0, 2.0 * np.pi, 121)
    x, y = turn / np.pi - 0.6 * np.sin(turn), 0.6 * (1.0 - np.cos(turn))
    points = 0.12 * np.column_stack([x, y, 0.0 * turn])
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    cable = Cable(length=length, diameter=0.005, linear_density=0.1, bending_stiffness=0.2)
    values: dict[str, Any] = {
        "grasps": (Grasp(u=0.0), Grasp(u=length)),
        "horizon": 1.0,
        "environment": Environment(drag=1.0, table=Table()),
    }
    return Scene(cable=cable, shape=Points(points=points, settle=True), **(values | changes))


def turning(points: np.ndarray) -> float:
    """Return by how much the direction of a curve (n, 3) in the x-y plane turns from its beginning to its end [rad]."""
    along = np.diff(points, axis=0)
    return float(np.ptp(np.unwrap(np.arctan2(along[:, 1], along[:, 0]))[[0, -1]]))


@pytest.mark.parametrize("n_u", [14, 25, 40])
def test_a_loop_on_a_smooth_table_unrolls_on_every_grid(n_u):
    # symmetric, it had stayed on some grids, and on those that a load makes uneven it had not
    scene = loop()
    assert turning(scene.shape.points) > 6.0
    for loads in ((), (Load(u=0.3 * scene.cable.length, force=(0.0, 0.0, 0.0)),)):
        problem, grid = settled(replace(scene, loads=loads), n_u)
        assert falls(problem, grid) is None
        assert turning(problem.world(grid.start)[:, :3]) < 4.0


def test_the_reference_unrolls_a_loop_to_the_same_side():
    scene = loop()
    answers = [predict(replace(scene, quality=Quality(target_error=2e-3, method=m))) for m in ("auto", "reference")]
    assert [a.status for a in answers] == ["converged", "converged"]
    u, t = np.linspace(0.0, scene.cable.length, 33), [0.0, 1.0]
    assert turning(answers[1].surface.positions(u, 0.0)[0]) < 4.0
    apart = np.subtract(*(a.surface.positions(u, t) for a in answers))
    assert np.linalg.norm(apart, axis=-1).max() < sum(a.accuracy.error_estimate for a in answers)


def test_friction_holds_what_would_fall():
    rough = loop(environment=Environment(drag=1.0, table=Table(friction=2.0)))
    held = predict(replace(rough, cable=replace(rough.cable, bending_stiffness=1e-4)))
    assert held.status == "converged", held.message
    assert TIPPED not in held.message
    u = np.linspace(0.0, held.scene.cable.length, 99)
    assert turning(held.surface.positions(u, 0.0)[0]) > 5.0
    unrolled = equilibrium(held.scene)
    assert turning(unrolled.positions(u)) < 4.0
    assert "friction is left out" in unrolled.message


@pytest.mark.parametrize("n_u", [14, 19, 28, 41])
def test_what_stands_far_above_its_grasp_falls_to_one_side_on_every_grid(n_u):
    # it falls in waves, and as a whole to either side of the mean (115:41): where it goes farthest counts
    stands = draw(115, 41).make()
    scene = replace(stands, shape=replace(stands.shape, settle=True))
    problem, grid = settled(scene, n_u)
    assert grid.tipped
    top = problem.world(grid.start)[0, :3]
    assert top[1] < -0.1
    assert top[2] < -1.0


def test_the_reference_tells_where_it_was_tipped_and_leaves_a_start_that_stays():
    wound = draw(22, 36).make()  # a loop that is symmetric to the last bit
    quality = Quality(target_error=5e-3 * wound.cable.length, method="reference")
    assert TIPPED in predict(replace(wound, quality=quality)).message
    hanging = predict(replace(arch(-0.3), quality=Quality(target_error=2e-3, method="reference")))
    assert hanging.status == "converged", hanging.message
    assert TIPPED not in hanging.message
