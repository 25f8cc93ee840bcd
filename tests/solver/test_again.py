"""Predictions like others: on the grid that was found before, with its estimate, or from the beginning and said so."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dlocore import (
    Environment,
    Grasp,
    Move,
    Prediction,
    Quality,
    Scene,
    SceneError,
    Sphere,
    Straight,
    Table,
    Waypoints,
    predict,
    predict_many,
)
from dlocore.accuracy import again as again_module
from dlocore.accuracy.changes import untold
from dlocore.solvers.monitor import TimeIsUp
from dlocore.stability.determined import UNDETERMINED, UNSEEN
from tests.solver.scenes import WEIGHTLESS, apart, cable, march, paper_scene, samples
from tests.solver.test_determined import column
from tests.solver.test_two_grippers import hanging

AFRESH = "Solved from the beginning: "


def moved(scene: Scene, *way: float) -> Scene:
    """Return the scene with the last grasp's target moved by a way [m]."""
    *others, last = scene.grasps
    assert isinstance(last.path, Move)
    target = np.asarray(last.path.displacement) + way
    return replace(scene, grasps=(*others, replace(last, path=replace(last.path, displacement=tuple(target)))))


def same(a: Prediction, b: Prediction) -> bool:
    return np.array_equal(a.surface.control_points, b.surface.control_points)


@pytest.fixture(scope="module")
def paper() -> Prediction:
    return predict(paper_scene(0.25, quality=march(9, 13, estimate=True)))


@pytest.mark.parametrize(
    "scene",
    [
        paper_scene(0.25, quality=march(9, 13, estimate=True)),
        paper_scene(0.25, quality=Quality(n_u=9, n_t=13, delta=1e-6)),
        hanging("clamp"),
        replace(paper_scene(0.5), environment=WEIGHTLESS, quality=march(13, 19, estimate=True)),
    ],
    ids=["march", "least squares", "settled, with twist", "in a plane of its own"],
)
def test_a_target_moved_a_little_is_solved_on_the_grid_before(scene):
    before = predict(scene)
    new = moved(scene, 0.004, 0.008, 0.0)
    again, fresh = predict(new, like=before), predict(new)
    assert again.status == "converged", again.message
    assert AFRESH not in again.message
    assert (again.accuracy.n_u, again.accuracy.n_t) == (before.accuracy.n_u, before.accuracy.n_t)
    for name in ("grid", "space", "time"):
        assert again.accuracy.error_parts.get(name) == before.accuracy.error_parts.get(name)
    # where the ladder ends on the same grid for both the answers differ by the tolerances of their solves
    assert fresh.accuracy.n_u == again.accuracy.n_u
    assert apart(again.surface, fresh.surface).max() < 1e-6
    assert [g.reaction[-1] for g in again.grasps] == [pytest.approx(g.reaction[-1], abs=1e-5) for g in fresh.grasps]


def test_a_least_squares_is_as_far_from_another_as_their_marches_are():
    before = predict(paper_scene(0.25))
    again = predict(before.scene, like=before)
    assert before.accuracy.method == again.accuracy.method == "spacetime"
    assert same(before, again)
    assert again.level.change < 1e-9


def test_the_least_squares_goes_on_without_a_companion():
    before = predict(paper_scene(0.25))
    again = predict(moved(before.scene, 0.0, 0.01, 0.0), like=before)
    assert again.accuracy.method == "spacetime"
    assert "estimate" not in again.accuracy.phases


def longer(scene: Scene) -> Scene:
    (g,) = scene.grasps
    return replace(scene, grasps=(replace(g, path=replace(g.path, duration=1.7)),), horizon=None)


def test_what_is_left_to_iterate_is_of_its_own_solve():
    before = predict(paper_scene(0.25, quality=Quality(n_u=13, n_t=19, delta=1e-4)))
    again = predict(moved(before.scene, 0.0, 0.01, 0.0), like=before)
    assert AFRESH not in again.message
    assert again.accuracy.method == "spacetime"
    assert again.accuracy.error_parts["iteration"] == pytest.approx(again.iterations[-1].update)
    assert again.accuracy.error_parts["iteration"] > 1.1 * before.accuracy.error_parts["iteration"]


def led(tremble: float) -> Scene:
    """Return the paper's case led by waypoints, 40 ms apart, that tremble by so much [m] at 10 Hz."""
    t = np.linspace(0.0, 1.6, 41)
    y = 0.3 * t / 1.6 + tremble * np.sin(20.0 * np.pi * t)
    path = Waypoints(times=t, positions=np.column_stack([0.25 + 0.0 * t, y, 0.0 * t]))
    return replace(paper_scene(0.25, quality=Quality()), grasps=(Grasp(u=0.25, path=path),))


def test_what_its_own_steps_miss_of_a_path_that_trembles_counts():
    before = predict(led(0.0))
    again = predict(led(4e-3), like=before)
    assert AFRESH not in again.message
    assert again.level is not None
    missed = max(untold(again.level).values())
    assert again.accuracy.error_estimate >= missed > 3.0 * before.accuracy.error_estimate


def test_an_error_above_the_target_is_none_of_an_answer():
    asked = Quality(target_error=5e-3)
    before = predict(replace(led(0.0), quality=asked))
    again = predict(replace(led(4e-3), quality=asked), like=before)
    assert "mm is above the target" in again.message.split(AFRESH)[1]
    assert again.status == "converged"
    assert again.accuracy.error_estimate < 5e-3


DIFFERENT: dict[str, tuple[Any, str]] = {
    "accuracy": (lambda s: replace(s, quality=march(11, 13)), "accuracy or grid"),
    "length": (lambda s: replace(s, cable=cable(length=1.1)), "length"),
    "times": (longer, "different times"),
    "effects": (lambda s: replace(s, environment=replace(s.environment, drag=0.0)), "effects"),
    "out of the plane": (lambda s: moved(s, 0.0, 0.0, 0.05), "dimensions"),
    "far away": (lambda s: moved(s, 0.0, 0.1, 0.0), "mm away from the one"),
    "no march": (lambda s: replace(s, quality=Quality(method="reference", target_error=0.05)), "accuracy or grid"),
}


@pytest.mark.parametrize("name", DIFFERENT)
def test_what_differs_too_much_is_solved_from_the_beginning_and_says_why(paper, name):
    change, why = DIFFERENT[name]
    new = change(paper.scene)
    again, fresh = predict(new, like=paper), predict(new)
    said, reason = again.message.split(AFRESH)
    assert said.strip() == fresh.message
    assert why in reason
    assert same(again, fresh)
    assert again.accuracy.error_parts == fresh.accuracy.error_parts


def test_a_prediction_without_a_march_or_without_an_answer_is_no_start(paper):
    reference = predict(replace(paper.scene, quality=Quality(method="reference", target_error=0.05)))
    assert "has no march" in predict(paper.scene, like=reference).message
    pushed = replace(
        paper.scene,
        environment=WEIGHTLESS,
        grasps=(Grasp(u=0.0), Grasp(u=1.0, path=Move(displacement=(-0.3, 0.0, 0.0), duration=1.0))),
    )
    torn = predict(pushed, keep_grid=True)
    assert torn.status != "converged"
    assert "did not converge" in predict(pushed, like=torn).message


def test_many_small_steps_away_end_in_a_new_estimate(paper):
    known, scene = paper, paper.scene
    fresh = 0
    for _ in range(6):
        scene = moved(scene, 0.0, 0.01, 0.0)
        known = predict(scene, like=known)
        fresh += AFRESH in known.message
    # the estimate is that of a motion 5 cm away at most, and a target 1 cm away moves the end by 1.3 cm: 3 of 1 cm
    assert fresh == 1
    assert known.judged is not None
    assert known.judged is not paper


def test_another_start_is_put_on_the_grid_anew(paper):
    other = replace(paper.scene, shape=Straight(direction=(1.0, 0.02, 0.0)))
    again, fresh = predict(other, like=paper), predict(other)
    assert AFRESH not in again.message
    assert apart(again.surface, fresh.surface).max() < 1e-6


def test_another_stiffness_is_taken(paper):
    other = replace(paper.scene, cable=cable(bending_stiffness=1.1e-3))
    again, fresh = predict(other, like=paper), predict(other)
    assert AFRESH not in again.message
    assert apart(again.surface, fresh.surface).max() < 1e-6
    assert apart(again.surface, paper.surface).max() > 1e-4


def test_an_effect_that_the_new_motion_calls_for_is_simulated():
    scene = paper_scene(0.25, quality=march(13, 19, estimate=True))
    u, t = samples(scene)
    most = predict(scene).surface.curvature(u, t).max()  # [1/m]
    soft = replace(scene, cable=cable(yield_strain=1.02 * most * 0.0025, memory_rate=10.0))
    before = predict(soft)
    again = predict(moved(soft, 0.0, 0.03, 0.0), like=before)
    yields = [next(r.active for r in p.effects if r.name == "plasticity") for p in (before, again)]
    assert yields == [False, True]
    assert "calls for plasticity" in again.message.split(AFRESH)[1]


def test_contact_goes_on_from_the_stiffness_and_the_knots_that_it_needed():
    ball = Sphere(center=(0.2, 0.3, 0.0), radius=0.1)
    scene = Scene(
        cable=cable(bending_stiffness=1e-2),
        shape=Straight(),
        grasps=(Grasp(u=0.5, path=Move(displacement=(0.0, 0.4, 0.0), duration=1.6)),),
        environment=Environment(gravity=(0.0, 0.0, 0.0), drag=0.5, obstacles=(ball,)),
        quality=Quality(target_error=5e-3),
    )
    before = predict(scene)
    assert before.status == "converged"
    new = moved(scene, 0.0, 0.01, 0.0)
    again, fresh = predict(new, like=before), predict(new)
    assert AFRESH not in again.message
    assert again.accuracy.n_t >= before.accuracy.n_t
    both = again.accuracy.error_estimate + fresh.accuracy.error_estimate
    assert apart(again.surface, fresh.surface).max() < both


def test_many_go_on_from_one(paper):
    scenes = [moved(paper.scene, 0.0, 0.002 * i, 0.0) for i in range(6)]
    found = predict_many(scenes, like=paper, threads=2)
    for scene, each in zip(scenes, found, strict=True):
        assert not isinstance(each, SceneError)
        assert same(each, predict(scene, like=paper))


def test_a_bad_scene_is_refused_as_ever(paper):
    with pytest.raises(SceneError, match="primitives"):
        predict(
            replace(paper.scene, grasps=(Grasp(u=0.0), Grasp(u=1.0, path=Move(displacement=(1.0, 0, 0), duration=1)))),
            like=paper,
        )


def pushed(shortened: float) -> Scene:
    """Return a nearly straight rod on a table, without friction, whose ends come nearer by a part of its length."""
    flat = column(shortened, flat=True)
    return replace(flat, environment=replace(flat.environment, drag=1.0, table=Table()))


def test_a_motion_like_it_that_its_scene_does_not_determine_is_no_success():
    before = predict(pushed(-1e-4))
    assert before.status == "converged"
    again = predict(pushed(5e-4), like=before)
    assert again.status == "stalled"
    assert f"{AFRESH}On the grid of the similar motion the scene does not determine its motion" in again.message
    assert again.accuracy.error_parts["start"] > UNDETERMINED


def test_a_motion_like_it_says_so_where_no_time_is_left_to_look(monkeypatch: pytest.MonkeyPatch):
    def late(*_: object, **__: object) -> float:
        raise TimeIsUp

    before = predict(pushed(-1e-4))
    monkeypatch.setattr(again_module, "goes_astray", late)
    again = predict(pushed(5e-4), like=before)
    assert again.status == "converged"
    assert UNSEEN in again.message
