"""What grasps hold, and where their paths begin: rows of the spline that hold exactly, whatever the rest does."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dlocore import Cable, ControlPoints, Environment, Grasp, Move, Scene, Straight, Waypoints
from dlocore.kernels.banded import holding, multiply_band, place_rows, solve_free
from dlocore.kernels.entry import to_ends_of_steps
from dlocore.problem.discretisation import make_grid
from dlocore.problem.grid import Grid
from dlocore.problem.holding import SMOOTH, Held, Starts, close_grasps, hold
from dlocore.problem.problem import Problem, pose
from dlocore.scene.paths import Path, Still
from dlocore.scene.scene import Hold

CABLE = Cable(length=1.0, diameter=0.005, linear_density=0.05, bending_stiffness=1e-3)
TIMES = np.array([0.0, 0.1, 0.35, 0.8, 1.5])  # before, in and after the paths, which take 0.5 s to 1 s
ROUNDING = 1e-13  # of coordinates of a metre, through an elimination of six rows
WAY = (0.1, -0.05, 0.2)
POINTS = np.array([[0.5, 0.0, 0.0], [0.6, 0.1, 0.05], [0.6, 0.15, 0.0]])


def scene(*grasps: Grasp, planar: bool = False) -> Scene:
    """Return a straight cable along x that is held so, without weight in the plane."""
    gravity = (0.0, 0.0, 0.0) if planar else (0.0, 0.0, -9.81)
    return Scene(
        cable=CABLE, shape=Straight(), grasps=grasps, environment=Environment(gravity=gravity), horizon=TIMES[-1]
    )


def held_in(scene: Scene, n_u: int = 17) -> tuple[Problem, Grid, Held]:
    problem = pose(scene)
    grid = make_grid(problem, n_u)
    starts: Starts = {}
    close_grasps(problem, grid, list(scene.grasps), starts, None)
    return problem, grid, hold(problem, grid, list(scene.grasps), TIMES, starts, grid.start)


def world_at(problem: Problem, grid: Grid, q: np.ndarray, u: float, derivative: int) -> np.ndarray:
    x = grid.at(q, u, derivative)[: problem.plane.dimensions]
    return problem.plane.world(x) if derivative == 0 else problem.plane.world_vectors(x)


PATHS: dict[str, Path] = {
    "still": Still(),
    "minimum jerk": Move(displacement=WAY, duration=0.8),
    "cubic": Move(displacement=WAY, duration=1.0, profile="cubic"),
    "linear": Move(displacement=WAY, duration=0.5, profile="linear"),
    "waypoints": Waypoints(times=[0.0, 0.5, 1.0], positions=POINTS),
}


@pytest.mark.parametrize("path", PATHS.values(), ids=PATHS.keys())
@pytest.mark.parametrize("hold", ["point", "tangent", "clamp"])
def test_the_spline_passes_where_the_path_is_whatever_the_free_control_points_do(path, hold):
    problem, grid, held = held_in(scene(Grasp(u=0.5, hold=hold, path=path), Grasp(u=0.9)))
    random = np.random.default_rng(0)
    for k, t in enumerate(TIMES):
        q = random.standard_normal(grid.start.shape)
        place_rows(held.elimination, held.offsets[k : k + 1], q[None], 0)
        wanted = path.at(np.array([t]), np.array([0.5, 0.0, 0.0]))[0]
        assert np.abs(world_at(problem, grid, q, 0.5, 0) - wanted).max() < ROUNDING
        assert np.abs(world_at(problem, grid, q, 0.9, 0) - [0.9, 0.0, 0.0]).max() < ROUNDING
        if hold != "point":
            assert np.abs(world_at(problem, grid, q, 0.5, 1) - [1.0, 0.0, 0.0]).max() < 100 * ROUNDING  # per span


@pytest.mark.parametrize("u", [0.0, 0.5, 1.0])
def test_a_held_direction_turns_with_the_gripper(u):
    turn = np.array([0.0, 0.3, 0.9])
    path = Move(displacement=WAY, duration=1.0, rotation=turn)
    problem, grid, held = held_in(scene(Grasp(u=u, hold="tangent", path=path)))
    random = np.random.default_rng(1)
    for k, t in enumerate(TIMES):
        q = random.standard_normal(grid.start.shape)
        place_rows(held.elimination, held.offsets[k : k + 1], q[None], 0)
        rotation = path.rotation_at(np.array([t]))
        assert rotation is not None
        assert np.abs(world_at(problem, grid, q, u, 1) - rotation[0] @ [1.0, 0.0, 0.0]).max() < 100 * ROUNDING


def test_a_move_turns_about_its_rotation_vector():
    random = np.random.default_rng(3)
    for turn in (np.zeros(3), np.array([0.0, 0.0, 1e-9]), *random.normal(0.0, 5.0, (20, 3))):
        found = Move(displacement=WAY, duration=2.0, rotation=turn, profile="linear").rotation_at(
            np.array([-1.0, 0.5, 3.0])
        )
        known = Rotation.from_rotvec(np.array([0.0, 0.25, 1.0])[:, None] * turn).as_matrix()
        np.testing.assert_allclose(found, known, atol=20 * ROUNDING)


TURNED = {
    "still": Still(),
    "moves": Move(displacement=WAY, duration=0.8),
    "about no axis": Move(displacement=WAY, duration=0.8, rotation=(0.0, 0.0, 0.0)),
    "about the cable": Move(displacement=WAY, duration=0.8, rotation=(0.7, 0.0, 0.0)),
    "three times about the cable": Move(displacement=WAY, duration=1.0, rotation=(6.0 * np.pi, 0.0, 0.0)),
    "about another axis": Move(displacement=WAY, duration=1.0, rotation=(5.0, -7.0, 4.0), profile="cubic"),
    "waypoints": replace(
        PATHS["waypoints"], orientations=[[1.0, 0.0, 0.0, 0.0], [0.6, 0.8, 0.0, 0.0], [0.0, 0.6, 0.8, 0.0]]
    ),
}


@pytest.mark.parametrize("path", TURNED.values(), ids=TURNED.keys())
@pytest.mark.parametrize("begin", [0.0, 0.1])
def test_a_clamp_turns_the_section_as_its_gripper_turns_about_the_cable(path, begin):
    clamps = Grasp(u=0.5, hold="clamp", path=path, grasp_time=begin), Grasp(u=0.9, hold="clamp")
    problem, grid, _ = held_in(replace(scene(*clamps), effects={"twist": "on"}))
    random = np.random.default_rng(4)
    state, times = random.standard_normal(grid.start.shape), np.linspace(0.1, 1.4, 27)
    starts: Starts = {}
    close_grasps(problem, grid, list(clamps), starts, None)
    held = hold(problem, grid, list(clamps), times, starts, state)
    turns = [np.eye(3)] * len(times) if path.rotation_at(times) is None else path.rotation_at(times - begin)
    tangent, director, spin = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]), 0.0
    for k, turn in enumerate(turns):
        q = random.standard_normal(grid.start.shape)
        place_rows(held.elimination, held.offsets[k : k + 1], q[None], 0)
        if k > 0:  # carried from the last tangent to this one by the smallest rotation
            before, now = turns[k - 1] @ tangent, turn @ tangent
            across = np.cross(before, now)
            sine = np.linalg.norm(across)
            least = Rotation.from_rotvec(across / (sine or 1.0) * np.arctan2(sine, before @ now))
            last = least.apply(turns[k - 1] @ director)
            spin += np.arctan2(np.cross(last, turn @ director) @ now, last @ turn @ director)
        wanted = grid.at(state, 0.5)[3] + problem.twist.radius * spin
        assert abs(grid.at(q, 0.5)[3] - wanted) < 100 * ROUNDING
        assert abs(grid.at(q, 0.9)[3] - grid.at(state, 0.9)[3]) < ROUNDING


def test_in_the_plane_rows_hold_in_its_coordinates():
    path = Move(displacement=(-0.1, 0.2, 0.0), duration=1.0)
    problem, grid, held = held_in(scene(Grasp(u=0.3, hold="tangent"), Grasp(u=0.7, path=path), planar=True))
    assert problem.nc == 2
    q = np.random.default_rng(2).standard_normal(grid.start.shape)
    place_rows(held.elimination, held.offsets[2:3], q[None], 0)
    assert np.abs(world_at(problem, grid, q, 0.3, 1) - [1.0, 0.0, 0.0]).max() < 100 * ROUNDING
    wanted = path.at(TIMES[2:3], np.array([0.7, 0.0, 0.0]))[0]
    assert np.abs(world_at(problem, grid, q, 0.7, 0) - wanted).max() < ROUNDING


@pytest.mark.parametrize(("hold", "kinks"), [("tangent", 0), ("clamp", 2)])  # two clamps hold a twist
def test_the_inverse_solves_the_rows_for_their_pivots(hold: Hold, kinks: int):
    back = Move(displacement=(-0.1, 0.05, 0.02), duration=0.8)
    grasps = (Grasp(u=0.2, hold=hold), Grasp(u=0.25), Grasp(u=0.6, hold="clamp", path=back))
    problem, grid, held = held_in(scene(*grasps), n_u=25)
    nd = problem.plane.dimensions
    pivots = held.elimination.held[: len(held.rows) * nd : nd] // problem.nc
    rows = np.zeros((len(held.rows), grid.n_u))
    assert held.rows == ((0, 0), (0, 1), (1, 0), (2, 0), (2, 1), *(SMOOTH,) * kinks)
    for r, (i, derivative) in enumerate(held.rows[:5]):
        first, b = grid.rows(grasps[i].u, derivative)
        rows[r, first : first + 4] = b
    for r, u in ((5, 0.2), (6, 0.6))[:kinks]:
        for at, sign in ((u, 1.0), (np.nextafter(u, 0.0), -1.0)):
            first, b = grid.rows(at, 1)
            rows[r, first : first + 4] += sign * b
    assert np.abs(held.inverse @ rows[:, pivots] - np.eye(len(rows))).max() < 100 * ROUNDING


def test_a_path_begins_at_the_point_and_along_the_unit_tangent_of_the_cable():
    control = np.array([[0.0, 0, 0], [0.166, 0.04, 0], [0.5, 0.0, 0.03], [0.83, 0.03, 0.05], [1.0, 0.0, 0.05]])
    bent = replace(scene(Grasp(u=0.37, hold="tangent")), shape=ControlPoints(control_points=control))
    problem = pose(bent)
    starts: Starts = {}
    close_grasps(problem, make_grid(problem, 9), list(bent.grasps), starts, None)
    for g in bent.grasps:
        point, slope = problem.start(g.u)[0], problem.start(g.u, 1)[0]
        assert np.abs(starts[g][0] - point).max() < ROUNDING
        assert np.abs(starts[g][1] - slope / np.linalg.norm(slope)).max() < ROUNDING


@pytest.mark.parametrize("hold", ["point", "tangent", "clamp"])
def test_what_an_update_does_to_forces_follows_from_the_balance_of_what_is_free(hold):
    # the update of a Newton step with a random tangent, which is multiplied by all of its rows to compare
    problem, grid, held = held_in(scene(Grasp(u=0.0, hold=hold), Grasp(u=0.5, hold=hold), Grasp(u=0.93)))
    e, nc = held.elimination, problem.nc
    size = grid.n_u * nc
    random = np.random.default_rng(2)
    K = random.normal(size=(size, 4 * nc))
    K[:, 0] += 60.0
    K[np.add.outer(np.arange(size), np.arange(4 * nc)) >= size] = 0.0
    R = random.normal(size=size)
    x, positive = solve_free(e, K, -R)
    assert positive
    whole, found, forces = np.empty(size), np.empty(size), np.empty((2, len(e.held)))
    multiply_band(K, x, whole)
    holding(e, K, x, R, forces, 1, found)
    assert np.abs(found - whole).max() < ROUNDING * np.abs(whole).max() * size
    assert np.abs(forces[1] - (R + whole)[e.held]).max() < ROUNDING * np.abs(whole).max() * size


def test_forces_of_steps_are_brought_to_their_ends():
    # what grows evenly is known at the ends of the steps from the second on, and the first keeps its own
    lag, grows = 0.3, np.linspace(2.0, 7.0, 6)[:, None] * [1.0, -2.0]
    forces = np.vstack([np.full((2, 2), 9.0), grows[:1], grows[1:] - lag * (grows[1] - grows[0]), np.full((1, 2), 5.0)])
    to_ends_of_steps(forces, 2, 7, lag)
    assert np.abs(forces[2:8] - grows).max() < ROUNDING
    assert (forces[[0, 1, 8]] == [[9.0, 9.0], [9.0, 9.0], [5.0, 5.0]]).all()
