"""The last resort of a least squares that was asked for and does not converge: the march, which the answer tells of."""

import time
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.hard.generator import draw
from benchmarks.hard.judge import by_a_march, run
from dlocore import Cable, Grasp, Iteration, Move, Prediction, Quality, Scene, Straight, predict
from dlocore.accuracy.refinement import AUTO_ENOUGH
from dlocore.study.plan import StudyPlan
from dlocore.study.running import run_study
from tests.solver.scenes import jerked

NOT_CONVERGED = "A march gives the answer instead of the requested least squares, which did not converge in "


def least_squares(scene: Scene) -> Scene:
    return replace(scene, quality=replace(scene.quality, method="spacetime"))


def marched(scene: Scene, keep_grid: bool = False) -> Prediction:
    return predict(replace(scene, quality=replace(scene.quality, method="march")), keep_grid=keep_grid)


@pytest.fixture(scope="module")
def asked() -> Scene:
    return least_squares(jerked(41))


@pytest.fixture(scope="module")
def given(asked: Scene) -> Prediction:
    """That grid and method, and nothing else."""
    return predict(asked, keep_grid=True)


@pytest.fixture(scope="module")
def found(asked: Scene) -> Prediction:
    return predict(asked)


def test_the_answer_is_that_of_method_march(asked: Scene, found: Prediction):
    march = marched(asked)
    assert found.scene is asked
    assert (found.status, found.accuracy.method) == (march.status, march.accuracy.method) == ("converged", "march")
    np.testing.assert_array_equal(found.surface.control_points, march.surface.control_points)
    assert found.accuracy.error_estimate == pytest.approx(march.accuracy.error_estimate)
    assert set(found.accuracy.error_parts) == {"grid", "iteration", "neglected"}
    for ours, theirs in zip(found.grasps, march.grasps, strict=True):
        np.testing.assert_array_equal(ours.reaction, theirs.reaction)


def test_the_message_tells_what_was_tried_on_which_grids_and_what_that_cost(given: Prediction, found: Prediction):
    first = given.said.split(". ")[0]
    assert first.startswith("The update fell to")
    assert NOT_CONVERGED in found.message
    assert f"on 17 x 41 control points {first.replace('The', 'the')}" in found.message
    assert "; on 17 x 82 control points the update fell to" in found.message
    cost = float(found.message.split(NOT_CONVERGED)[1].split(" ms")[0])
    assert 1e3 * found.accuracy.phases["spacetime"] < cost < 1e3 * found.accuracy.wall_time


def test_the_iterations_have_both_attempts_and_the_march(given: Prediction, found: Prediction):
    on = [(i.n_t, i.note.startswith("march")) for i in found.iterations]
    assert on.count((41, False)) == len(given.iterations)
    assert on.count((82, False)) > 20  # it goes on for so many without success
    assert on[-1] == (41, True)
    np.testing.assert_array_equal(found.iterations[-1].surface.control_points, found.surface.control_points)


def test_who_keeps_the_grid_is_told_that_the_least_squares_did_not_converge(asked: Scene, given: Prediction):
    assert (given.status, given.accuracy.method) == ("max_iterations", "spacetime")
    assert "use method march. The surface is that of the march it started from." in given.message
    np.testing.assert_array_equal(given.surface.control_points, marched(asked).surface.control_points)


def test_a_march_that_shows_no_motion_on_the_grid_is_left_for_finer_ones():
    scene = least_squares(draw(8, 277).make())  # its time spline misses the march
    march = marched(scene, keep_grid=True)
    found = predict(scene)
    assert march.status == "max_iterations"
    assert (found.status, found.accuracy.method) == ("converged", "march")
    assert (found.accuracy.n_u, found.accuracy.n_t) != (scene.quality.n_u, scene.quality.n_t)
    assert found.accuracy.error_estimate is not None
    assert found.accuracy.error_estimate <= AUTO_ENOUGH * scene.cable.length
    assert "control points could not show the motion" in found.message
    assert march.said in found.message
    assert NOT_CONVERGED in found.message


def test_where_no_march_shows_the_motion_its_status_is_the_answer():
    # its weight strains it by a half, on any grid: the least squares has no march to begin with
    soft = Cable(length=1.0, diameter=0.005, linear_density=0.05, bending_stiffness=1e-3, axial_stiffness=2.0)
    down, quality = Straight(direction=(0.0, 0.0, -1.0)), Quality(n_u=9, n_t=13, method="spacetime")
    scene = Scene(cable=soft, shape=down, grasps=(Grasp(u=0.0),), horizon=2.0, quality=quality)
    march, found = marched(scene), predict(scene)
    assert (found.status, found.accuracy.method) == (march.status, "march") == ("stalled", "march")
    assert f"on 9 x 13 control points {march.said[:1].lower()}{march.said[1:].split('. ')[0]}" in found.message
    assert NOT_CONVERGED in found.message
    assert "Finer grids were tried for" in found.message


def test_no_estimate_is_made_where_none_is_asked_for(asked: Scene):
    found = predict(replace(asked, quality=replace(asked.quality, estimate=False)))
    assert (found.status, found.accuracy.method) == ("converged", "march")
    assert found.accuracy.error_estimate is None


def test_a_deadline_that_ends_the_second_attempt_leaves_the_march(asked: Scene, given: Prediction):
    begun = len(given.iterations) + 3

    def slow(step: Iteration) -> None:
        time.sleep(6.0 if step.number == begun else 0.0)

    found = predict(asked, deadline=6.0, on_iteration=slow)
    assert (found.status, found.accuracy.method) == ("converged", "march")
    assert found.accuracy.error_estimate is None
    assert "The time limit passed before its error was estimated" in found.message
    assert "on 17 x 82 control points the time limit passed after" in found.message


@pytest.mark.parametrize(("given", "left"), [(jerked(41), False), (draw(8, 277).make(), True)])
def test_a_motion_like_it_goes_on_by_the_march(given: Scene, left: bool):
    scene = least_squares(given)
    first, *others = scene.grasps
    assert isinstance(first.path, Move)
    path = replace(first.path, displacement=1.001 * np.asarray(first.path.displacement))
    before, moved = predict(scene), replace(scene, grasps=(replace(first, path=path), *others))
    again = predict(moved, like=before)
    assert (again.status, again.accuracy.method) == ("converged", "march")
    assert again.scene is moved
    assert len(again.iterations) == 1
    assert (again.accuracy.n_u, again.accuracy.n_t) == (before.accuracy.n_u, before.accuracy.n_t)
    assert "The requested least squares did not suffice for a similar scene: this is a march." in again.message
    assert ("control points did not suffice for a similar scene" in again.message) == left
    kept = predict(moved, like=before, keep_grid=True)
    assert (kept.status, kept.accuracy.method) == ("max_iterations", "spacetime")


def test_a_study_books_no_march_as_a_least_squares(asked: Scene):
    plan = StudyPlan(
        scenes={"jerked": asked}, grids=((17, 41),), methods=("spacetime",), deltas=(1e-9,), parts=("runs",)
    )
    (run,) = run_study(plan).runs
    assert (run.method, run.status) == ("spacetime", "max_iterations")


def test_the_judge_counts_it_apart():
    record = run(draw(33, 417), 30.0, False)
    assert (record["status"], record["method"], record["solved_by"]) == ("converged", "spacetime", "march")
    assert by_a_march(record)
    assert not by_a_march({**record, "method": "auto"})
    assert not by_a_march({**record, "solved_by": "spacetime"})
    assert not by_a_march({**record, "status": "stalled"})
