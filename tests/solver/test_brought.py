"""Grippers with waypoints begin beside the cable as it was seen: it is brought to them, and they are told apart."""

from typing import Any

import numpy as np
import pytest

from dlocore import (
    Environment,
    Grasp,
    Points,
    Prediction,
    Quality,
    Scene,
    SceneError,
    Straight,
    Table,
    Waypoints,
    predict,
)
from dlocore.answer.frames import rates_of
from dlocore.problem.brought import GRASP_TOLERANCE
from dlocore.problem.discretisation import axial_strain, make_grid
from dlocore.problem.notes import start_notes
from dlocore.problem.problem import pose
from dlocore.problem.squeezed import is_squeezed
from dlocore.scene.paths import DRAWN, Move, held_at
from dlocore.solvers.monitor import Monitor
from dlocore.spline import spline_at
from dlocore.statics.statics import start_grid
from tests.solver.scenes import Floats, cable

MOVED = (
    "the start is moved by up to {:g} mm from where it was given, "
    "to meet the first waypoints of its grippers, to lie on the table, or to be outside obstacles"
)
X, UP = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.05, 0.0])
ROUGH = Environment(drag=0.1, table=Table(friction=0.3))


def along(u: float, aside: float, **changes: Any) -> Grasp:
    """Return a grasp at u [m] of a straight cable along x that begins `aside` of it [m] and goes 0.1 m farther."""
    positions = [[u, aside, 0.0], [u, aside + 0.05, 0.0], [u, aside + 0.1, 0.0]]
    return Grasp(u=u, path=Waypoints(times=[0.0, 0.5, 1.0], positions=positions), **changes)


def carried(*grasps: Grasp, **changes: Any) -> Scene:
    return Scene(cable=cable(), shape=Straight(), grasps=grasps, environment=ROUGH, **changes)


def strongest(found: Prediction) -> float:
    return max(float(np.linalg.norm(g.reaction, axis=1).max()) for g in found.grasps)


@pytest.mark.parametrize("aside", [1e-4, 3e-3, -9e-3])
def test_a_cable_that_one_gripper_holds_is_moved_to_it_as_a_whole(aside: float) -> None:
    found, there = (predict(carried(along(0.8, y))) for y in (aside, 0.0))
    assert found.start_energy == pytest.approx(there.start_energy, abs=1e-15)
    assert found.notes == (() if abs(aside) < 1e-3 else (MOVED.format(1e3 * abs(aside)),))
    # bent beside its gripper it was thousands of newtons
    assert strongest(found) == pytest.approx(strongest(there), rel=1e-6)
    np.testing.assert_allclose(
        found.surface.sample(33, 33)[2][..., :3],
        there.surface.sample(33, 33)[2][..., :3] + [0.0, aside, 0.0],
        atol=1e-8,
    )


@pytest.mark.parametrize("shape", [Straight(), None], ids=["straight", "goes on"])
def test_between_two_grippers_it_bends_no_more_than_it_has_to(shape: Any) -> None:
    if shape is None:
        shape = predict(carried(Grasp(u=0.2, path=Move(displacement=(0.0, 0.2, 0.0), duration=1.0)))).shape_at()
    given = pose(Scene(cable=cable(), shape=shape, environment=ROUGH, horizon=1.0)).start
    asides = np.array([[0.003, -0.002, 0.0], [-0.001, 0.004, 0.0]])
    begins = given([0.2, 0.8]) + asides
    paths = [Waypoints(times=[0.0, 1.0], positions=[at, at + UP]) for at in begins]
    held = [Grasp(u=u, path=path) for u, path in zip((0.2, 0.8), paths, strict=True)]
    scene = Scene(cable=cable(), shape=shape, grasps=held, environment=ROUGH)
    start = pose(scene).start
    np.testing.assert_allclose(start([0.2, 0.8]), begins, atol=1e-11)
    u = np.linspace(0.0, 1.0, 101)
    assert np.linalg.norm(start(u) - given(u), axis=1).max() < 1.01 * np.linalg.norm(asides, axis=1).max()
    bends: Floats = np.linalg.norm(start(u, 2) - given(u, 2), axis=1)
    assert bends.max() < 1.2 * 6.0 * np.linalg.norm(asides[1] - asides[0]) / 0.6**2
    np.testing.assert_allclose(start([0.2, 0.8], 1), given([0.2, 0.8], 1), atol=1e-3)


@pytest.mark.parametrize("aside", [0.0, 8e-3])
def test_a_start_that_is_also_given_a_bow_is_told_to_be_moved_only_if_its_grippers_move_it(aside: float) -> None:
    pushed = [[[0.0, aside, 0.0], [0.2, aside, 0.0]], [[1.0, aside, 0.0], [1.0, aside, 0.0]]]
    grasps = [
        Grasp(u=u, path=Waypoints(times=[0.0, 1.0], positions=at)) for u, at in zip((0.0, 1.0), pushed, strict=True)
    ]
    scene = carried(*grasps)
    start = pose(scene).start
    assert start.bow or start.aside
    assert bool(start_notes(scene, start)) == bool(aside)


def squeezed(less: float) -> Scene:
    """Return an arc of 1 m in two clamps that begin nearer to each other than its points, by a part of the length."""
    t = np.linspace(-0.8, 0.8, 81)
    points = np.column_stack([np.sin(t), 0.0 * t, 1.0 - np.cos(t)]) / 1.6
    held = []
    for u, end, way in ((0.0, points[0], 0.5), (1.0, points[-1], -0.5)):
        begin = end + way * less * X
        held.append(Grasp(u=u, hold="clamp", path=Waypoints(times=[0.0, 1.0], positions=[begin, begin + UP])))
    return Scene(
        cable=cable(), shape=Points(points=points, settle=True), grasps=held, environment=Environment(drag=0.1)
    )


def test_a_start_that_two_grippers_squeeze_bows_out_in_long_waves_that_are_the_same_on_all_grids() -> None:
    """It wrinkled as finely as its grid allowed: 3 mm elsewhere, and bent 130 times as sharply as its points."""
    problem = pose(squeezed(0.018))
    u = np.linspace(0.0, 1.0, 401)
    coarse, fine = (make_grid(problem, n) for n in (33, 216))
    places = [spline_at(grid.knots, grid.start[:, :3], u, 0) for grid in (coarse, fine)]
    np.testing.assert_allclose(places[0], places[1], atol=2e-4)
    assert np.abs(axial_strain(fine.tables, fine.start[:, :3])).max() < 5e-4
    bends = np.linalg.norm(spline_at(fine.knots, fine.start[:, :3], u, 2), axis=1)
    assert bends.max() < 5.0  # 1.6 of the points [1/m]


def test_clamps_that_squeeze_a_start_are_not_turned_against_each_other_as_it_settles() -> None:
    """Wrinkles out of the plane, which smooth out, left their writhe as twist: 0.2 rad, on the fine grid alone."""
    problem = pose(squeezed(0.018), {"side": "it leaves its plane", "twist": "it turns"})
    assert problem.twist is not None
    for n_u in (33, 300):
        rest = start_grid(problem, n_u, Monitor())
        rates = rates_of(problem, rest, rest.start[None], rest.history.past[None])[0]
        assert abs(float(rest.tables.curvature.w @ rates)) < 1e-3, n_u


@pytest.mark.parametrize(("less", "bows"), [(0.004, False), (0.006, True), (0.0, False), (-0.01, False)])
def test_what_hardly_squeezes_a_start_is_no_reason_to_smooth_it(less: float, bows: bool) -> None:
    assert is_squeezed(pose(squeezed(less))) == bows


def test_beyond_the_tolerance_the_first_waypoint_is_refused() -> None:
    with pytest.raises(SceneError, match=r"primitives\[1\].path.positions\[0\].*within 0.01 m"):
        predict(carried(Grasp(u=0.2), along(0.8, 1.01 * GRASP_TOLERANCE)))


def test_a_gripper_that_closes_a_little_beside_draws_the_cable_to_its_path() -> None:
    scene = carried(along(0.8, 0.006, grasp_time=0.5), quality=Quality(target_error=1e-3))
    found = predict(scene)
    assert found.status == "converged"
    assert strongest(found) < 0.2  # carried there at once it was hundreds of newtons
    t = np.linspace(0.5, 1.5, 41)
    at = found.surface.positions([0.8], t)[:, 0]
    path = held_at(scene.grasps[0].path, t - 0.5, at[0])
    np.testing.assert_allclose(at, path, atol=2e-4)
    late = t >= 0.5 + DRAWN
    np.testing.assert_allclose(path[late], scene.grasps[0].path.at(t[late] - 0.5, at[0]), atol=1e-15)


@pytest.mark.parametrize(("duration", "within"), [(1.0, 0.2), (0.1, 0.1)])
def test_it_is_drawn_within_a_fifth_of_a_second_or_the_time_of_all_waypoints(duration: float, within: float) -> None:
    path = Waypoints(times=[0.0, duration], positions=[[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]])
    t = within * np.array([0.0, 0.5, 0.99, 1.0])
    beside = np.array([0.0, 0.008, 0.0])
    off = held_at(path, t, beside) - path.at(t, beside)
    x = 0.99
    share = 1.0 - x**3 * (10.0 - 15.0 * x + 6.0 * x**2)
    np.testing.assert_allclose(off, np.outer([1.0, 0.5, share, 0.0], beside), atol=1e-15)


@pytest.mark.parametrize("method", ["auto", "reference"])
def test_one_that_closes_far_beside_is_no_success(method: Any) -> None:
    quality = Quality(method=method, target_error=5e-3)
    found = predict(carried(along(0.8, 0.03, grasp_time=0.5), quality=quality))
    assert found.status == "stalled"
    assert "primitives[0].path.positions[0] is 30 mm from the cable at u = 0.8 m" in found.message


@pytest.mark.parametrize("method", ["auto", "reference"])
def test_one_that_closes_only_when_the_motion_is_over_is_beside_nothing(method: Any) -> None:
    held = Grasp(u=0.2, path=Move(displacement=(0.0, 0.02, 0.0), duration=0.4))
    quality = Quality(method=method, target_error=5e-3)
    found = predict(carried(held, along(0.8, 0.03, grasp_time=0.5), horizon=0.5, quality=quality))
    assert found.status == "converged"
    assert "never holds the cable" in found.message
