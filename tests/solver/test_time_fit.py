"""The time spline of a march: where knots and states are added, and where memory forbids it."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.catalogue import catalogue
from dlocore import Cable, Cancelled, Environment, Grasp, Move, Quality, Scene, Straight, Table, Waypoints, predict
from dlocore.problem.discretisation import make_grid
from dlocore.problem.problem import pose
from dlocore.problem.time_grid import time_knots
from dlocore.solvers import timefit
from dlocore.solvers.march import March, march
from dlocore.solvers.monitor import Monitor, TimeIsUp
from dlocore.solvers.timefit import fit, refined

TOLERANCE = 1e-6  # [m]: so little that the motion needs more knots and, with them, states between its steps


def jerk() -> tuple[March, np.ndarray]:
    """Return a march of a cable that is jerked sideways, in few steps, and time knots too few for it."""
    problem = pose(
        Scene(
            cable=Cable.preset("paper"),
            shape=Straight(),
            grasps=(Grasp(u=0.25, path=Move(displacement=(0.0, 0.2, 0.0), duration=0.3)),),
            environment=Environment(drag=0.5, table=Table()),
            horizon=1.0,
        )
    )
    knots_t = time_knots(problem, 13)
    assert knots_t is not None
    return march(problem, make_grid(problem, 9), 60, Monitor()), knots_t


def test_knots_and_states_are_added_until_the_spline_follows_the_march() -> None:
    motion, knots_t = jerk()
    more, dense = refined(motion, knots_t, TOLERANCE, True, Monitor())
    assert len(more) > len(knots_t)
    assert len(dense.times) > len(motion.times)
    assert set(motion.times) <= set(dense.times)
    assert fit(dense, more)[1].max() < 0.1 * fit(motion, knots_t)[1].max()


def test_no_states_are_added_to_so_many_that_they_fill_memory(monkeypatch: pytest.MonkeyPatch) -> None:
    motion, knots_t = jerk()
    monkeypatch.setattr(timefit, "_MOST_NUMBERS", motion.states.size - 1)
    more, same = refined(motion, knots_t, TOLERANCE, True, Monitor())
    assert same is motion
    assert len(more) > len(knots_t)


def test_knots_are_added_until_the_deadline_and_not_beyond_it() -> None:
    motion, knots_t = jerk()
    late = Monitor(deadline=0.0)
    kept, same = refined(motion, knots_t, TOLERANCE, True, late)
    assert kept is knots_t
    assert same is motion
    with pytest.raises(TimeIsUp):
        refined(motion, knots_t, TOLERANCE, True, late, whole=True)
    with pytest.raises(Cancelled):
        refined(motion, knots_t, TOLERANCE, True, Monitor(cancelled=lambda: True))


def over_a_bar() -> Scene:
    """Return the cable of the catalogue that is lowered over a bar, off to one side: its sections turn."""
    scene = catalogue()["lowered over a bar"]
    first, last = scene.grasps
    assert isinstance(last.path, Move)
    aside = replace(last.path, displacement=np.add(last.path.displacement, [0.0, 0.05, 0.0]))
    return replace(scene, grasps=(first, replace(last, path=aside)))


@pytest.mark.parametrize("scene", [over_a_bar(), catalogue()["laid into a bin"]], ids=["over a bar", "into a bin"])
def test_the_angle_of_the_sections_does_not_tremble_where_knots_are_added(scene: Scene) -> None:
    # its frames are known at the steps alone, between which the strikes have knots
    prediction = predict(scene)
    motion, surface = prediction.level.motion, prediction.surface  # type: ignore[union-attr]
    u, steps = np.linspace(0.0, surface.length, 9), motion.times[motion.logged]
    assert np.histogram(steps, np.unique(surface.knots_t))[0].min() == 0
    rates = np.diff(surface(u, steps)[..., 3], axis=0) / np.diff(steps)[:, None]
    fastest = np.abs(surface(u, np.linspace(0.0, surface.horizon, 4001), dt=1)[..., 3]).max()
    assert fastest < 2.0 * np.abs(rates).max()


def led(times: list[float], quality: Quality) -> Scene:
    """Return a scene of a cable on a table that is led through points at the given times."""
    turns = np.arange(len(times))
    positions = np.column_stack([0.25 + 0.05 * turns, 0.1 * np.sin(2.0 * turns), np.zeros(len(times))])
    return Scene(
        cable=Cable.preset("paper"),
        shape=Straight(),
        grasps=(Grasp(u=0.25, path=Waypoints(times=times, positions=positions)),),
        environment=Environment(drag=0.1, table=Table()),
        quality=quality,
    )


@pytest.mark.parametrize(
    "quality", [Quality(), Quality(n_u=9, n_t=19, method="march", keep_grid=True)], ids=["chosen", "given"]
)
def test_a_march_follows_a_path_of_few_waypoints_exactly_at_all_times(quality: Quality) -> None:
    scene = led([0.0, 0.35, 0.8, 1.1, 1.6], quality)
    prediction = predict(scene)
    t = np.linspace(0.0, 1.6, 501)
    path = scene.grasps[0].path.at(t, np.zeros(3))
    assert prediction.status == "converged"
    assert np.abs(prediction.surface.positions(0.25, t)[:, 0] - path).max() < 1e-9


@pytest.mark.parametrize(
    "times",
    [
        pytest.param(np.linspace(0.0, 1.6, 40).tolist(), id="too many"),
        pytest.param(np.linspace(0.0, 1.6, 12).tolist(), id="more than half of what is left"),
        pytest.param([0.0, 0.4, 0.4001, 1.0, 1.6], id="too close"),
        pytest.param([0.0, 0.4, 1.5999, 1.6], id="too close to the end"),
        pytest.param([0.0, 1.6], id="none inside"),
    ],
)
def test_time_knots_stay_even_where_waypoints_would_crowd_them(times: list[float]) -> None:
    least_squares = Quality(n_u=9, n_t=19, method="spacetime", keep_grid=True)
    followed, even = (time_knots(pose(led(times, quality)), 19) for quality in (Quality(), least_squares))
    assert followed is not None
    np.testing.assert_array_equal(followed, even)


def test_where_nothing_strikes_knots_are_added_and_no_states() -> None:
    motion, knots_t = jerk()
    more, same = refined(motion, knots_t, 1e-4, False, Monitor())
    assert same is motion
    assert len(more) > len(knots_t)
    assert fit(motion, more)[1].max() < 0.1 * fit(motion, knots_t)[1].max()
