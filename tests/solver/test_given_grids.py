"""Grids that are given: what is done where a march fails on one as it is; regressions found by random hard scenes."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from benchmarks.hard.generator import draw
from dlocore import Cable, Environment, Grasp, Move, Quality, Scene, Straight, Table, predict
from dlocore.discretisation import make_grid
from dlocore.events import time_knots
from dlocore.given import MISSED, evenly_fitted, given_status
from dlocore.problem import pose
from dlocore.solvers.ladder import Size, given_steps
from dlocore.solvers.monitor import Monitor
from dlocore.solvers.watched import watched
from dlocore.whole_march import FOLDED, is_folded, march_level
from tests.solver.scenes import apart, march, paper_scene


@pytest.mark.parametrize(("seed", "index"), [(2, 186), (5, 207)])
def test_a_cable_that_folds_on_a_given_grid_is_marched_on_points_between_which_it_cant(seed: int, index: int):
    scene = draw(seed, index).make()
    quality = scene.quality
    assert quality.n_u is not None
    assert quality.n_t is not None
    size = Size(quality.n_u, quality.n_t, given_steps(quality.n_t))
    assert is_folded(march_level(pose(scene), size, Monitor()))
    found = predict(scene)
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
    found = predict(scene)
    fine = predict(replace(scene, quality=march(96, 120)))
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
    assert np.all(np.diff(tables.axial_u) >= 0.0)  # what is remembered there is interpolated along the cable
    np.testing.assert_allclose(tables.axial_w.sum(), length, rtol=1e-14)  # rounding of a sum of 33 numbers
    assert len(own.history.axial) == len(tables.axial_u)

    def stretch(q: np.ndarray, of: object) -> float:
        first, b1 = of.axial_first, of.axial_b1  # type: ignore[attr-defined]
        slope = np.linalg.norm(np.einsum("pi,pid->pd", b1, q[first[:, None] + np.arange(4)]), axis=1)
        return float((of.axial_w * (slope - 1.0) ** 2).sum())  # type: ignore[attr-defined]

    assert stretch(grid.start, tables) < 1e-20  # straight: rounding squared
    # r' of unit length that turns to and fro at the points of the grid: between them it is shorter, and none sees that
    first, b1 = grid.tables.axial_first, grid.tables.axial_b1
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
    found = predict(scene)
    assert found.status == "converged"
    estimate = found.accuracy.error_estimate
    assert estimate is not None
    assert estimate >= 3.0 * moved.missed  # what the spline misses is part of the error


def test_a_march_without_equilibrium_on_a_given_grid_is_tried_in_more_steps():
    scene = draw(3, 29).make()  # 165 steps for 33 control points in time
    found = predict(replace(scene, quality=replace(scene.quality, method="march", estimate=False)))
    assert found.accuracy.steps == 4 * 165
    assert "watched" not in found.message
    assert "found no equilibrium" in found.message
    assert found.status == "converged"


def test_a_time_spline_has_states_in_every_span():
    # topples within a second of 55: knots that crowd there got between the steps, and the spline left for kilometres
    scene = draw(7, 1448).make()
    found = predict(replace(scene, quality=march(19, 33)))
    assert found.status == "max_iterations"
    assert "time spline" in found.message
    x = found.surface.positions(np.linspace(0.0, 1.0, 33), np.linspace(0.0, found.surface.horizon, 4001))
    assert np.abs(x).max() < 3.0
