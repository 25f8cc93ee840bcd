"""Which method answers where none is asked for, and where a least squares ends."""

import time
from dataclasses import replace

import numpy as np

from benchmarks.hard.generator import draw
from dlocore import (
    Iteration,
    Quality,
    plan,
    predict,
)
from tests.solver.scenes import jerked, paper_scene


def test_auto_is_a_march_unless_a_given_grid_has_a_threshold():
    for quality, method in (
        (Quality(n_u=9, n_t=13), "march"),
        (Quality(n_u=9, n_t=13, delta=1e-5), "spacetime"),
    ):
        scene = paper_scene(0.25, quality=quality)
        assert predict(scene).accuracy.method == plan(scene).method == method


def test_the_threshold_is_that_of_the_paper_where_none_is_given():
    least = paper_scene(0.25, quality=Quality(n_u=9, n_t=13, method="spacetime"))
    found = predict(least)
    given = predict(replace(least, quality=replace(least.quality, delta=1e-5)))
    assert found.accuracy.delta == 1e-5
    np.testing.assert_array_equal(found.surface.control_points, given.surface.control_points)


def test_auto_answers_with_the_march_where_the_least_squares_fails():
    scene = jerked(41)
    auto = predict(scene)
    asked = predict(replace(scene, quality=replace(scene.quality, method="spacetime")), keep_grid=True)
    assert asked.status == "max_iterations"
    assert asked.accuracy.method == "spacetime"
    assert auto.status == "converged"
    assert auto.accuracy.method == "march"
    assert "least squares did not converge" in auto.message
    np.testing.assert_array_equal(auto.surface.control_points, asked.surface.control_points)


def test_a_least_squares_ends_where_its_updates_no_longer_fall():
    # it begins with a jump of the velocity, and again when the gripper stops: two stretches, the first is the last
    scene = draw(33, 296).make()
    found = predict(scene, keep_grid=True)
    least = np.minimum.accumulate([iteration.update for iteration in found.iterations])
    falls = least[20:] < 0.9 * least[:-20]
    assert found.status == "max_iterations"
    assert not falls[-1]
    assert falls[:-1].all()
    assert f"fell to {least[-1]:.2g} m in {len(least)} iterations, not below delta" in found.message


def test_a_least_squares_that_runs_out_of_time_leaves_the_march_that_it_started_from():
    def slow(step: Iteration) -> None:
        time.sleep(2.0 if step.number == 2 else 0.0)

    scene = jerked(41)
    asked = replace(scene, quality=replace(scene.quality, method="spacetime"))
    found = predict(asked, deadline=2.0, on_iteration=slow)
    assert found.status == "time_limit"
    assert len(found.iterations) == 3
    assert "after 3 iterations" in found.message
    marched = predict(replace(scene, quality=replace(scene.quality, method="march")))
    np.testing.assert_array_equal(found.surface.control_points, marched.surface.control_points)


def test_a_march_in_place_of_the_least_squares_is_held_to_its_time_spline():
    # 17 control points miss it by 8 % of the length
    found = predict(jerked(17, way=0.3, duration=0.15), keep_grid=True)
    assert found.accuracy.method == "march"
    assert found.status == "max_iterations"
    assert "Raise n_t" in found.message
