"""A given grid that errs by more than 1 % of the length, as it estimates, is left for finer ones that do not."""

import time
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.hard.generator import draw
from dlocore import (
    Cable,
    Environment,
    Grasp,
    Iteration,
    Move,
    Prediction,
    Quality,
    Scene,
    SceneError,
    Straight,
    predict,
)
from dlocore.accuracy.fallback import falls_short
from dlocore.accuracy.refinement import AUTO_ENOUGH
from tests.solver.scenes import paper_scene

GRID = Quality(n_u=9, n_t=13, method="march")
FREE = Quality(target_error=AUTO_ENOUGH)  # the cable is one metre long
ASKED = "The requested 9 x 13 control points err by an estimated"


def scene(quality: Quality, EI: float = 1e-4) -> Scene:
    return paper_scene(0.8, EI, quality=quality)


@pytest.fixture(scope="module")
def own() -> Prediction:
    """What the grid comes to by itself."""
    return predict(scene(GRID), keep_grid=True)


@pytest.fixture(scope="module")
def free() -> Prediction:
    return predict(scene(FREE))


def size(found: Prediction) -> tuple[int, int]:
    n_t, n_u = found.surface.control_points.shape[:2]
    assert (found.accuracy.n_u, found.accuracy.n_t) == (n_u, n_t)
    return n_u, n_t


def test_the_finer_grid_is_the_answer_and_the_message_tells(own: Prediction, free: Prediction):
    asked = scene(GRID)
    found = predict(asked)
    assert found.scene is asked
    assert found.status == own.status == "converged"
    assert found.accuracy.error_estimate <= AUTO_ENOUGH < own.accuracy.error_estimate
    assert size(own) == (9, 13)
    np.testing.assert_array_equal(found.surface.control_points, free.surface.control_points)
    assert f"{ASKED} {own.accuracy.error_estimate * 1e3:.2g} mm, which took" in found.message
    assert own.said in found.message
    assert f"This answer is on {size(free)[0]} x {size(free)[1]}, with an estimated error of" in found.message
    sizes = [(i.n_u, i.n_t) for i in found.iterations]
    assert sizes == [(i.n_u, i.n_t) for i in (*own.iterations, *free.iterations)]


def test_a_grid_that_errs_by_less_is_kept():
    found = predict(scene(GRID, EI=1e-3))
    assert size(found) == (9, 13)
    assert 1e-3 < found.accuracy.error_estimate < AUTO_ENOUGH
    assert "requested" not in found.message


def test_what_was_left_out_is_not_laid_to_the_grid(own: Prediction):
    # finer grids leave it as it is
    accuracy = own.accuracy
    all_neglected = replace(accuracy, neglected=accuracy.error_estimate)
    for known, is_coarse in ((accuracy, True), (all_neglected, False), (replace(accuracy, error_estimate=None), False)):
        assert falls_short(replace(own, accuracy=known)) == is_coarse


def test_who_keeps_the_grid_or_asks_for_no_estimate_gets_what_it_comes_to(own: Prediction):
    for quality in (replace(GRID, keep_grid=True), replace(GRID, estimate=False)):
        found = predict(scene(quality))
        assert len(found.iterations) == 1
        np.testing.assert_array_equal(found.surface.control_points, own.surface.control_points)


def test_only_a_given_grid_can_be_kept():
    with pytest.raises(SceneError, match=r"keep_grid: got True\. Allowed: n_u and n_t given with it"):
        Quality(keep_grid=True)


def test_the_printed_scheme_stays_as_it_is():
    weightless = replace(scene(replace(GRID, method="paper")), grasps=(Grasp(u=0.8),), horizon=1.0)
    found = predict(weightless)
    assert found.accuracy.method == "paper"
    assert size(found) == (9, 13)
    coarse = replace(found, status="converged", accuracy=replace(found.accuracy, error_estimate=1.0))
    assert not falls_short(coarse)


def test_a_least_squares_that_errs_leaves_the_answer_to_a_march(free: Prediction):
    asked = replace(GRID, method="spacetime")
    found, kept = predict(scene(asked)), predict(scene(replace(asked, keep_grid=True)))
    assert (kept.status, kept.accuracy.method) == ("converged", "spacetime")
    assert kept.accuracy.error_estimate > AUTO_ENOUGH
    assert (found.status, found.accuracy.method) == ("converged", "march")
    np.testing.assert_array_equal(found.surface.control_points, free.surface.control_points)
    assert ASKED in found.message
    assert kept.said in found.message
    again = predict(scene(asked), like=found)
    assert len(again.iterations) == 1
    assert "The requested least squares did not suffice for a similar scene: this is a march." in again.message


def test_a_motion_like_it_goes_on_on_the_finer_grid():
    before = predict(scene(GRID))
    moved = replace(before.scene, grasps=(Grasp(u=0.8, path=Move(displacement=(0.0, 0.51, 0.0), duration=1.6)),))
    again = predict(moved, like=before)
    assert again.scene is moved
    assert len(again.iterations) == 1
    assert size(again) == size(before) == size(predict(moved))
    assert "control points did not suffice for a similar scene" in again.message


def test_finer_grids_that_do_no_better_are_tried_once():
    asked = draw(101, 136).make()
    seen: list[Iteration] = []
    found, own = predict(asked, on_iteration=seen.append), predict(asked, keep_grid=True)
    assert found.status == own.status == "converged"
    assert len(seen) == len(found.iterations) > len(own.iterations)
    np.testing.assert_array_equal(found.surface.control_points, own.surface.control_points)
    assert found.accuracy.error_estimate == own.accuracy.error_estimate > AUTO_ENOUGH * asked.cable.length
    told = f"as it errs by an estimated {own.accuracy.error_estimate * 1e3:.2g} mm, but do not converge: "
    assert found.said.startswith(own.said)
    assert told in found.said
    again = predict(asked, like=found)
    assert len(again.iterations) == 1
    assert again.status == "converged"


def test_a_deadline_leaves_the_given_grid(own: Prediction):
    found = predict(scene(GRID), deadline=1e-9)
    assert found.status == "time_limit"
    began: list[Iteration] = []

    def slow(step: Iteration) -> None:
        began.append(step)
        if len(began) == 2:  # the first of the finer grids
            time.sleep(0.6)

    found = predict(scene(GRID), deadline=0.5, on_iteration=slow)
    assert found.status == "converged"
    np.testing.assert_array_equal(found.surface.control_points, own.surface.control_points)
    assert found.accuracy.error_estimate == own.accuracy.error_estimate
    assert "but do not converge: The time limit passed" in found.message


def test_finer_grids_that_run_out_of_time_are_the_answer_where_they_are_far_nearer():
    # a limp cable that swings from a clamp, undamped
    swinging = Scene(
        cable=Cable(length=1.0, diameter=0.005, linear_density=0.05, bending_stiffness=3e-4),
        shape=Straight(settle=True),
        grasps=(Grasp(u=0.93, hold="clamp", path=Move(displacement=(-0.874, -0.071, 0.0), duration=2.0)),),
        environment=Environment(gravity=(0.0, 0.0, -9.81)),
        effects={"self_contact": "off"},
        horizon=8.0,
        quality=GRID,
    )
    own = predict(swinging, keep_grid=True)
    seen: list[Iteration] = []

    def late(step: Iteration) -> None:
        seen.append(step)
        if step.n_u == 28:  # finer ones would meet their target
            time.sleep(6.0)

    found = predict(swinging, deadline=6.0, on_iteration=late)
    assert (own.status, size(own)) == ("max_iterations", (9, 13))
    assert found.status == "time_limit"
    assert own.accuracy.error_estimate > 2.0 * found.accuracy.error_estimate > 2.0 * AUTO_ENOUGH
    assert size(found) == (seen[-1].n_u, seen[-1].n_t)
    assert "The requested 9 x 13 control points could not show the motion" in found.message
    assert found.message.startswith("The time limit passed; the estimated error is")
