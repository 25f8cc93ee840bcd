"""Events at the same time but for rounding are one; those that are close leave forces as they are."""

from dataclasses import replace

import numpy as np
import pytest

from dlocore import (
    Cable,
    Cylinder,
    Environment,
    Grasp,
    Move,
    Points,
    Prediction,
    Scene,
    SceneError,
    Straight,
    Table,
    predict,
)
from dlocore.problem.events import find_events
from dlocore.problem.time_grid import step_counts

CABLE = Cable(length=1.0, diameter=0.005, linear_density=0.05, bending_stiffness=2e-3)
GAPS = [-1e-4, -1e-15, 1e-15, 1e-10, 1e-8, 1e-7, 1e-6, 4e-6, 6e-6, 2.1e-5, 5e-5, 1e-4]
LONG_GAPS = [1e-15, 2.1e-5, 5e-5, 1e-4]  # where other steps are long
POST = Cylinder(center=(0.5, 0.06, 0.0), radius=0.02, axis=(0.0, 0.0, 1.0), height=0.2)


def two_ends(gap: float, horizon: float = 0.5) -> Scene:
    """Return a cable on a table, of which two moves end `gap` [s] apart."""
    first = Grasp(u=0.0, path=Move(displacement=(0.0, 0.1, 0.0), duration=0.3 + gap))
    second = Grasp(u=0.7, path=Move(displacement=(0.0, 0.05, 0.0), duration=0.2), grasp_time=0.1)
    table = Environment(drag=0.1, table=Table())
    return Scene(cable=CABLE, shape=Straight(), grasps=(first, second), environment=table, horizon=horizon)


def handed_over(gap: float) -> Scene:
    """Return a hanging cable whose end is let go, and held anew `gap` [s] later."""
    s = np.linspace(0.0, 1.0, 61)
    sagging = np.stack([0.6 * s, 0.0 * s, -1.4866 * s * (1.0 - s)], axis=1)
    there = Grasp(u=1.0, hold="clamp", path=Move(displacement=(0.1, 0.1, 0.1), duration=1.0), release_time=1.5)
    back = Grasp(u=1.0, hold="clamp", path=Move(displacement=(-0.1, 0.1, 0), duration=0.7), grasp_time=1.5 + gap)
    return Scene(
        cable=CABLE, shape=Points(points=sagging, settle=True), grasps=(Grasp(u=0.0, hold="clamp"), there, back),
        environment=Environment(drag=0.1), horizon=2.5,
    )  # fmt: skip


def largest(found: Prediction) -> list[float]:
    """Return the largest force of each gripper [N]."""
    assert found.status == "converged", found.message
    return [float(np.linalg.norm(grasp.reaction, axis=1).max()) for grasp in found.grasps]


@pytest.mark.parametrize(("horizon", "gap"), [*((0.5, gap) for gap in GAPS), *((20.0, gap) for gap in LONG_GAPS)])
def test_forces_are_those_of_moves_that_end_together(gap: float, horizon: float) -> None:
    together, apart = predict(two_ends(0.0, horizon)), predict(two_ends(gap, horizon))
    np.testing.assert_allclose(largest(apart), largest(together), rtol=0.12 if horizon > 1.0 else 0.01)  # at a jump
    unsure = [grasp.reaction_error for grasp in apart.grasps]
    assert max(float(error.max()) for error in unsure if error is not None) < 2.0 * max(largest(together))
    assert apart.accuracy.error_estimate == pytest.approx(together.accuracy.error_estimate, abs=1e-3)


@pytest.mark.parametrize("gap", GAPS)
def test_an_end_is_handed_over_whatever_rounding_makes_of_the_time(gap: float) -> None:
    if gap == -1e-4:
        with pytest.raises(SceneError, match="holds it at 1 m at the same time"):
            handed_over(gap)
        return
    together, apart = predict(handed_over(0.0)), predict(handed_over(gap))
    np.testing.assert_allclose(largest(apart), largest(together), rtol=0.01)


def test_forces_beside_an_obstacle_too() -> None:
    around = Environment(drag=0.1, table=Table(friction=0.3), obstacles=(POST,))
    together = largest(predict(replace(two_ends(0.0), environment=around)))
    for gap in (1e-15, 6e-6, 1e-4):
        np.testing.assert_allclose(largest(predict(replace(two_ends(gap), environment=around))), together, rtol=0.01)


@pytest.mark.parametrize("begin", [1e-17, 1e-9, 4e-6])
def test_a_grasp_as_good_as_at_the_beginning_is_none_later(begin: float) -> None:
    def taken(at: float | None) -> Scene:
        grasp = Grasp(u=0.7, path=Move(displacement=(0.0, 0.05, 0.0), duration=0.2), grasp_time=at)
        return replace(two_ends(0.0), grasps=(two_ends(0.0).grasps[0], grasp))

    np.testing.assert_allclose(largest(predict(taken(begin))), largest(predict(taken(None))), rtol=1e-3)


def test_events_no_farther_apart_than_a_moment_are_one() -> None:
    moment = two_ends(0.0).moment
    assert moment == 5e-6
    for gap, count in ((0.0, 2), (0.9 * moment, 2), (-0.9 * moment, 2), (1.1 * moment, 3)):
        events = find_events(two_ends(gap))
        assert len(events) == count
        assert max(event.multiplicity for event in events) == 3  # the grasp
    assert [event.time for event in find_events(two_ends(0.2 - 0.9 * moment))] == [0.1, 0.1 + 0.2]  # the end is none


def test_a_short_stretch_has_no_steps_that_are_thousands_of_times_shorter() -> None:
    counts = step_counts([0.0, 10.0, 10.00003, 60.0], 20_000)
    assert counts[1] == 8
    assert counts[0] == round(20_000 / 6)
    assert step_counts([0.0, 1.0, 1.1, 2.0], 320)[1] == 40  # as many as a stretch has at least
