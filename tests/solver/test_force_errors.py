"""The estimated errors of grippers' forces and moments: true, and told where they are known and where large."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.catalogue import catalogue
from benchmarks.force_errors import apart, rms
from dlocore import Grasp, GraspReaction, Move, Prediction, Quality, Scene, Straight, predict
from dlocore.answer.compared import Series, errors, parts_of
from dlocore.answer.reactions import taken_on
from tests.solver.scenes import WEIGHTLESS, Floats, cable, march, paper_scene, refined

SCENES = catalogue()
HANGING = SCENES["clamped hanging cable with one end moved"]
REGRASP = SCENES["regrasp on a rough table"]
WAITS = SCENES["gripper waits while the other moves"]


@pytest.fixture(scope="module")
def true() -> Prediction:
    """The hanging cable to a ten-thousandth of its length."""
    return refined(HANGING, 1e-4 * HANGING.cable.length)


def solved(scene: Scene, quality: Quality) -> Prediction:
    return predict(replace(scene, quality=quality), keep_grid=True)


def moments_of(reaction: GraspReaction) -> GraspReaction:
    """Return moments in place of forces."""
    return replace(reaction, reaction=reaction.moment, reaction_error=reaction.moment_error)


QUALITIES = {
    "free grids": Quality(),
    "free grids, a looser target": Quality(target_error=0.01),
    "a given grid": march(13, 19, estimate=True),
    "a finer given grid": march(21, 31, estimate=True),
    "least squares": Quality(n_u=13, n_t=19, method="spacetime"),
}


@pytest.mark.parametrize("name", QUALITIES)
def test_the_error_of_a_force_and_a_moment_is_within_the_estimate_and_not_far_below(
    name: str, true: Prediction
) -> None:
    answer = solved(HANGING, QUALITIES[name])
    for own, fine in zip(answer.grasps, true.grasps, strict=True):
        for ours, theirs in ((own, fine), (moments_of(own), moments_of(fine))):
            compared = apart(ours, theirs)
            assert compared is not None
            assert ours.reaction_error is not None
            assert np.mean(compared[0] <= ours.reaction_error) > 0.9
            assert rms(ours.reaction_error) < 12.0 * rms(compared[0])


def test_a_finer_grid_has_smaller_errors() -> None:
    coarse, fine = (solved(HANGING, march(*size, estimate=True)).grasps[0] for size in ((13, 19), (33, 49)))
    assert coarse.reaction_error is not None
    assert fine.reaction_error is not None
    assert rms(fine.reaction_error) < 0.5 * rms(coarse.reaction_error)


@pytest.mark.parametrize(
    "quality",
    [march(13, 19), Quality(method="reference", target_error=0.01)],
    ids=["without an estimate", "reference"],
)
def test_where_no_error_is_estimated_there_is_none_of_the_forces(quality: Quality) -> None:
    (grasp,) = predict(paper_scene(0.25, quality=quality)).grasps
    assert grasp.reaction.any()
    assert grasp.reaction_error is None
    assert grasp.moment_error is None


def test_an_open_gripper_has_neither_force_nor_error_of_one_and_the_jump_as_it_opens_is_no_error() -> None:
    answer = predict(REGRASP)
    for asked, found in zip(REGRASP.grasps, answer.grasps, strict=True):
        assert found.reaction_error is not None
        open_at = found.times < asked.start if asked.start else found.times > (asked.release_time or np.inf)
        away = np.abs(found.times - (asked.start or asked.release_time or 0.0)) > answer.surface.horizon / 12
        assert (open_at & away).any()
        assert not found.reaction[open_at & away].any()
        assert not found.reaction_error[open_at & away].any()
        assert found.reaction_error.max() < np.linalg.norm(found.reaction, axis=1).max()


def test_a_grid_that_errs_in_one_direction_is_compared_with_those_of_both() -> None:
    """A grid that was refined in time alone says nothing of what space has left."""
    answer = predict(replace(WAITS, quality=Quality()))
    assert answer.level is not None
    sizes = [(other.motion.grid.n_u, other.motion.steps) for other in answer.level.beside]
    assert len(sizes) == 2
    assert len({n_u for n_u, _ in [*sizes, (answer.level.motion.grid.n_u, 0)]}) > 1
    assert len({steps for _, steps in [*sizes, (0, answer.level.motion.steps)]}) > 1


def test_the_error_is_that_to_the_farthest_grid_between_the_same_events() -> None:
    """Forces that are 1 and 2 N off, and jump at an event that the grids step to in different ways."""
    times, other = np.array([0.0, 1.0, 2.0, 2.0, 3.0, 4.0]), np.array([0.0, 2.0, 2.0, 4.0])
    jump, across = np.array([0.0, 0.0, 0.0, 9.0, 9.0, 9.0]), np.array([0.0, 0.0, 9.0, 9.0])

    def series(t: Floats, values: Floats, off: float) -> Series:
        parts = parts_of([len(t) // 2, len(t) - len(t) // 2])
        return Series(t, parts, np.outer(values + off, [0.6, 0.8, 0.0]))

    own, near, far = series(times, jump, 0.0), series(other, across, 1.0), series(other, across, -2.0)
    one, both, other_way = errors(own, [near]), errors(own, [near, far]), errors(own, [far, near])
    assert one is not None
    assert both is not None
    assert other_way is not None
    np.testing.assert_array_equal(both, other_way)
    np.testing.assert_allclose(one, 1.5)
    np.testing.assert_allclose(both, 3.0)
    first = slice(0, 2)
    assert (
        errors(own, [Series(other[first], parts_of([2]), near.values[first])]) is None
    )  # ended before the second part


def test_a_least_squares_has_them_though_it_goes_through_events_that_marches_stop_at() -> None:
    waits = paper_scene(0.25, quality=Quality(n_u=9, n_t=19, method="spacetime"))
    found = predict(replace(waits, horizon=2.5))
    assert (found.status, found.accuracy.method) == ("converged", "spacetime")
    fine = predict(replace(waits, horizon=2.5, quality=Quality(target_error=1e-4)))
    ours, theirs = found.grasps[0], fine.grasps[0]
    compared = apart(ours, theirs)
    assert compared is not None
    assert ours.reaction_error is not None
    assert np.mean(compared[0] <= ours.reaction_error) > 0.9


def test_a_motion_that_goes_on_from_one_like_it_takes_on_the_errors_of_its_forces() -> None:
    like = predict(replace(HANGING, quality=Quality()))
    again = predict(replace(HANGING, quality=Quality()), like=like)
    assert again.judged is like
    for a, b in zip(again.grasps, like.grasps, strict=True):
        np.testing.assert_array_equal(a.reaction_error, b.reaction_error)
        np.testing.assert_array_equal(a.moment_error, b.moment_error)


def test_errors_are_taken_on_at_the_times_of_the_motion_they_are_taken_on_by() -> None:
    three, five = np.linspace(0.0, 1.0, 3), np.linspace(0.0, 1.0, 5)
    judged = GraspReaction(0.0, three, np.zeros((3, 3)), np.zeros((3, 3)), np.array([0.0, 2.0, 0.0]), np.zeros(3))
    own = GraspReaction(0.0, five, np.ones((5, 3)), np.ones((5, 3)))
    (found,) = taken_on((own,), (judged,))
    np.testing.assert_array_equal(found.reaction_error, [0.0, 1.0, 2.0, 1.0, 0.0])
    assert taken_on((own,), (replace(judged, reaction_error=None),)) == (own,)


def test_forces_that_are_hardly_known_are_told_of_and_others_are_not() -> None:
    told = predict(replace(WAITS, quality=Quality()))
    assert told.status == "converged"
    notes = [note for note in told.notes if note.startswith("the force of the gripper at u = ")]
    assert len(notes) == 2
    assert "give or take" in notes[0]
    assert notes[0] in told.message
    assert not [n for n in predict(replace(HANGING, quality=Quality())).notes if "give or take" in n]


def test_a_smaller_target_is_no_advice_where_the_velocity_of_a_gripper_jumps() -> None:
    # the error of the force is 0.6 N, and 1.6 N to a tenth of the target; damped, it is 6 mN and 0.1 mN
    def advice(damping: float) -> tuple[float, list[str]]:
        path = Move(displacement=(0.0, 0.2, 0.0), duration=0.5, profile="linear")
        scene = Scene(
            cable=cable(bending_stiffness=1e-2, bending_damping=damping),
            shape=Straight(),
            grasps=[Grasp(u=0.3, path=path)],
            environment=replace(WEIGHTLESS, drag=0.1),
            horizon=0.6,
            quality=Quality(target_error=2e-3),
        )
        found = predict(scene)
        assert found.grasps[0].reaction_error is not None
        error = float(np.median(found.grasps[0].reaction_error))
        return error, [note for note in found.notes if "is uncertain" in note]

    error, (note,) = advice(0.0)
    assert "start and stop smoothly, or give bending_damping" in note
    assert "smaller target_error" not in note
    damped, none = advice(1e-4)
    assert damped < 0.1 * error
    assert none == []


def test_a_force_of_nothing_is_not_told_of() -> None:
    """Grippers that hold a cable without weight at rest give it rounding."""
    still = Scene(
        cable=cable(), shape=Straight(), grasps=[Grasp(u=0.0), Grasp(u=1.0)], environment=WEIGHTLESS, horizon=1.0
    )
    assert predict(still).notes == ()


def test_errors_are_pickled_with_the_forces() -> None:
    answer = predict(replace(HANGING, quality=Quality()))
    sent = pickle.loads(pickle.dumps(answer)).grasps[0]
    np.testing.assert_array_equal(sent.reaction_error, answer.grasps[0].reaction_error)
