"""Grids that are given: what is done where a march fails on one as it is; regressions found by random hard scenes."""

import time
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from benchmarks.hard.generator import draw
from dlocore import (
    Cable,
    Cancelled,
    Environment,
    Grasp,
    Iteration,
    Move,
    Prediction,
    Quality,
    Scene,
    Straight,
    Table,
    predict,
)
from dlocore.levels.given import MISSED, evenly_fitted, given_status
from dlocore.levels.level import Size, given_steps
from dlocore.levels.whole_march import is_folded, march_level
from dlocore.problem.discretisation import make_grid
from dlocore.problem.problem import pose
from dlocore.problem.strained import FOLDED
from dlocore.problem.time_grid import time_knots
from dlocore.solvers.monitor import Monitor
from dlocore.solvers.watched import watched
from tests.solver.scenes import apart, march, paper_scene


@pytest.mark.parametrize(("seed", "index"), [(2, 186), (5, 207)])
def test_a_cable_that_folds_on_a_given_grid_is_marched_on_points_between_which_it_cant(seed: int, index: int):
    scene = draw(seed, index).make()
    quality = scene.quality
    assert quality.n_u is not None
    assert quality.n_t is not None
    size = Size(quality.n_u, quality.n_t, given_steps(quality.n_t))
    assert is_folded(march_level(pose(scene), size, Monitor()))
    found = predict(scene, keep_grid=True)
    assert found.status == "converged"
    assert "watched at more points" in found.message
    assert "watched at more points" in found.iterations[-1].note
    assert found.iterations[-1].n_u == quality.n_u
    breaks = np.unique(found.surface.knots_u)
    u = np.concatenate([np.linspace(a, b, 9) for a, b in pairwise(breaks)])
    slope = np.linalg.norm(found.surface(u, np.linspace(0.0, found.surface.horizon, 33), du=1)[..., :3], axis=-1)
    assert slope.min() > FOLDED  # nine points a span: no fold hides between them


def test_the_estimate_tells_how_far_a_coarse_grid_that_was_watched_is_off():
    scene = draw(2, 186).make()
    found = predict(scene, keep_grid=True)
    fine = predict(replace(scene, quality=march(64, 120)))
    assert fine.status == "converged"
    estimate = found.accuracy.error_estimate
    assert estimate is not None
    assert apart(found.surface, fine.surface).max() < estimate


def test_watching_points_bear_folds_and_nothing_else():
    problem = pose(paper_scene(0.25, quality=march(13, 25)))
    grid = make_grid(problem, 13)
    own = watched(grid)
    length = problem.scene.cable.length
    tables = own.tables
    assert np.all(np.diff(tables.axial.u) >= 0.0)  # what is remembered there is interpolated along the cable
    np.testing.assert_allclose(tables.axial.w.sum(), length, rtol=1e-14)  # rounding of a sum of 33 numbers
    assert len(own.history.axial) == len(tables.axial.u)

    def stretch(q: np.ndarray, of: object) -> float:
        first, b1 = of.axial.first, of.axial.b1  # type: ignore[attr-defined]
        slope = np.linalg.norm(np.einsum("pi,pid->pd", b1, q[first[:, None] + np.arange(4)]), axis=1)
        return float((of.axial.w * (slope - 1.0) ** 2).sum())  # type: ignore[attr-defined]

    assert stretch(grid.start, tables) < 1e-20  # straight: rounding squared
    # r' of unit length that turns to and fro at the points of the grid: between them it is shorter, and none sees that
    first, b1 = grid.tables.axial.first, grid.tables.axial.b1
    rows = np.zeros((len(first), grid.n_u))
    np.put_along_axis(rows, first[:, None] + np.arange(4), b1, axis=1)
    turned = 1.2 * (-1.0) ** np.arange(len(first))
    folded = np.linalg.lstsq(rows, np.column_stack([np.cos(turned), np.sin(turned)]))[0]
    assert stretch(folded, grid.tables) < 1e-20
    assert stretch(folded, tables) > 0.01 * length


def test_time_knots_go_where_a_spline_of_given_size_misses_its_march():
    # a jerk, and a long rest: even knots in time leave three for the jerk
    n_t = 13
    scene = Scene(
        cable=Cable.preset("paper"),
        shape=Straight(),
        grasps=(Grasp(u=0.0, path=Move(displacement=(0.0, 0.3, 0.0), duration=0.2)),),
        environment=Environment(drag=1.0, table=Table()),
        horizon=6.0,
        quality=Quality(n_u=13, n_t=n_t, method="march"),
    )
    problem = pose(scene)
    even = march_level(problem, Size(13, n_t, given_steps(n_t)), Monitor())
    moved = evenly_fitted(even)
    length = scene.cable.length
    assert even.missed > MISSED * length > moved.missed
    assert given_status(even)[0] == "max_iterations"
    assert given_status(moved)[0] == "converged"
    knots = time_knots(problem, n_t)
    assert knots is not None
    assert len(moved.knots_t) == len(knots)
    assert np.all(np.diff(moved.knots_t) >= 0.0)
    for event in problem.events:
        assert np.sum(moved.knots_t == event.time) == event.multiplicity
    found = predict(scene, keep_grid=True)
    assert found.status == "converged"
    estimate = found.accuracy.error_estimate
    assert estimate is not None
    assert estimate >= 3.0 * moved.missed  # what the spline misses is part of the error


def test_a_march_that_fails_on_a_given_grid_is_tried_in_more_steps():
    scene = draw(23, 34).make()  # 165 steps for 33 control points in time, which are too few of those, too
    quality = replace(scene.quality, method="march", estimate=False)
    found = predict(replace(scene, quality=quality), keep_grid=True)
    assert found.accuracy.steps >= 4 * 165
    assert "watched" not in found.message
    assert "Every time step found its equilibrium" in found.message
    assert "On the grid as given, with 165 steps: " in found.message  # no equilibrium, or torn: processors differ


def test_a_time_spline_has_states_in_every_span():
    # topples within a second of 55: knots that crowd there got between the steps, and the spline left for kilometres
    scene = draw(7, 1448).make()
    found = predict(replace(scene, quality=march(19, 33)), keep_grid=True)
    assert found.status == "max_iterations"
    assert "time spline" in found.message
    x = found.surface.positions(np.linspace(0.0, 1.0, 33), np.linspace(0.0, found.surface.horizon, 4001))
    assert np.abs(x).max() < 3.0


def control_points(prediction: Prediction) -> tuple[int, int]:
    return prediction.accuracy.n_u, prediction.accuracy.n_t


def asked_for(scene: Scene) -> str:
    return f"The requested {scene.quality.n_u} x {scene.quality.n_t} control points"


@pytest.mark.parametrize(
    ("seed", "index", "why"), [(8, 277, "The time spline of 10 control points misses"), (19, 641, "folded")]
)
@pytest.mark.parametrize("estimate", [True, False])
def test_finer_grids_are_the_answer_where_a_given_one_cant_show_the_motion(
    seed: int, index: int, why: str, estimate: bool
):
    scene = draw(seed, index).make()
    scene = replace(scene, quality=replace(scene.quality, estimate=estimate))
    given = predict(scene, keep_grid=True)
    assert given.status in ("max_iterations", "stalled")
    assert control_points(given) == (scene.quality.n_u, scene.quality.n_t)
    assert why in given.said
    seen: list[Iteration] = []
    found = predict(scene, on_iteration=seen.append)
    assert found.status == "converged"
    assert found.scene is scene
    assert f"{asked_for(scene)} could not show the motion, which took" in found.message
    assert why in found.message
    assert f"This answer is on {control_points(found)[0]} x {control_points(found)[1]}" in found.message
    estimated = found.accuracy.error_estimate
    assert estimated is not None  # it is how finer grids end, whether it was asked for or not
    assert estimated <= 0.01 * scene.cable.length
    assert tuple(seen) == found.iterations
    assert [step.number for step in seen] == list(range(len(seen)))
    assert [(i.n_u, i.n_t) for i in seen[: len(given.iterations)]] == [(i.n_u, i.n_t) for i in given.iterations]
    assert len(seen) > len(given.iterations)
    assert (seen[-1].n_u, seen[-1].n_t) == control_points(found)
    free = predict(replace(scene, quality=Quality(target_error=0.01 * scene.cable.length)))
    np.testing.assert_array_equal(found.surface.control_points, free.surface.control_points)


def test_a_given_grid_is_the_answer_where_finer_ones_do_no_better():
    # hangs from one end, so soft that its weight strains it by a half: no grid helps
    soft = Cable(length=1.0, diameter=0.005, linear_density=0.05, bending_stiffness=1e-3, axial_stiffness=2.0)
    down = Straight(direction=(0.0, 0.0, -1.0))
    scene = Scene(cable=soft, shape=down, grasps=(Grasp(u=0.0),), horizon=2.0, quality=march(9, 13))
    given, found = predict(scene, keep_grid=True), predict(scene)
    assert found.status == given.status == "stalled"
    assert found.said.startswith(given.said)
    assert "Finer grids were tried for" in found.said
    assert "which no cable can follow. Its axial stiffness is 2 N: give it more, or less mass, weight" in found.said
    np.testing.assert_array_equal(found.surface.control_points, given.surface.control_points)
    assert control_points(found) == (9, 13)
    assert len(found.iterations) > len(given.iterations)
    assert sum(found.accuracy.phases.values()) <= found.accuracy.wall_time


def test_finer_grids_keep_a_deadline_and_can_be_cancelled():
    scene = draw(8, 231).make()  # finer grids take half a minute
    deadline = 1.0  # [s], of which the given grid takes some tenths, on a busy machine too
    began = time.thread_time()
    found = predict(scene, deadline=deadline)
    took = time.thread_time() - began
    assert took < deadline + 0.5  # without one it is half a minute
    given = predict(scene, keep_grid=True).accuracy.error_estimate
    assert given is not None
    assert found.accuracy.error_estimate is not None
    if control_points(found) == (scene.quality.n_u, scene.quality.n_t):
        assert found.status == "max_iterations"
        assert found.accuracy.error_estimate == given
        assert "Finer grids were tried for" in found.said
    else:  # how far they come hangs on the machine: some are the answer, as they err by less than half as much
        assert found.status == "time_limit"
        assert found.accuracy.error_estimate < 0.5 * given
    assert "time limit" in found.said.lower()
    seen: list[Iteration] = []
    with pytest.raises(Cancelled):
        predict(scene, on_iteration=seen.append, cancelled=lambda: len(seen) > 3)
    assert len(seen) == 4


def test_a_least_squares_that_does_not_converge_gets_more_control_points_in_time():
    scene = draw(7, 359).make()
    given, found = predict(scene, keep_grid=True), predict(scene)
    assert (given.status, given.accuracy.method) == ("max_iterations", "spacetime")
    assert (found.status, found.accuracy.method) == ("converged", "spacetime")
    n_u, n_t = scene.quality.n_u, scene.quality.n_t
    assert n_t is not None
    assert control_points(found) == (n_u, 2 * n_t)
    assert f"{asked_for(scene)} did not converge" in found.message
    assert len(found.iterations) > len(given.iterations)
    update = found.iterations[-1].update
    assert update < scene.quality.delta
    assert f"in {len(found.iterations) - len(given.iterations)} iterations" in found.message


def test_a_motion_like_one_on_finer_grids_goes_on_on_them():
    scene = draw(8, 277).make()
    before = predict(scene)
    again = predict(scene, like=before)
    assert again.status == "converged"
    assert again.scene is scene
    assert len(again.iterations) == 1
    assert control_points(again) == control_points(before)
    assert f"{asked_for(scene)} did not suffice for a similar scene" in again.message
    kept = predict(scene, like=before, keep_grid=True)
    assert kept.status == "max_iterations"
    assert control_points(kept) == (scene.quality.n_u, scene.quality.n_t)
