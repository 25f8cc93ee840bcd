"""The laws notice what breaks them: a sound motion, and the same with one thing spoilt."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.hard.laws import measure
from dlocore import Environment, Grasp, Move, Prediction, Quality, Scene, SplineSurface, Straight, predict
from dlocore.study.scenes import paper_case
from tests.hard.checks import GAIN, HELD, LOST, STRAIN, keep_laws
from tests.solver.scenes import Floats, cable


@pytest.fixture(scope="module")
def sound() -> Prediction:
    grasps = (Grasp(u=0.3, hold="tangent", path=Move(displacement=(0.1, 0.3, 0.1), duration=0.8)),)
    around = Environment(gravity=(0.0, 0.0, -3.0), drag=0.1)
    quality = Quality(n_u=17, n_t=49, method="march", estimate=False)
    return predict(Scene(cable=cable(), shape=Straight(), grasps=grasps, environment=around, quality=quality))


def with_control(prediction: Prediction, control: Floats) -> Prediction:
    surface = prediction.surface
    return replace(prediction, surface=SplineSurface(control, surface.knots_u, surface.knots_t))


def with_reaction(prediction: Prediction, factor: float) -> Prediction:
    grasps = tuple(replace(g, reaction=factor * g.reaction) for g in prediction.grasps)
    return replace(prediction, report_grasps=lambda: grasps)


def test_a_sound_motion_keeps_all_laws(sound: Prediction):
    keep_laws(sound)


def test_a_number_that_is_none_is_noticed(sound: Prediction):
    control = np.array(sound.surface.control_points)
    control[3, 4, 1] = np.nan
    assert not measure(with_control(sound, control)).finite


def test_a_stretched_cable_is_noticed(sound: Prediction):
    assert measure(with_control(sound, 1.05 * sound.surface.control_points)).strain > STRAIN


def test_a_gripper_that_slips_by_a_micrometre_is_noticed(sound: Prediction):
    assert measure(with_control(sound, sound.surface.control_points + 1e-6)).held > HELD


@pytest.mark.parametrize(("n_t", "least", "most"), [(13, 2e-5, 3e-5), (25, 5e-7, 1e-6)])
def test_between_its_ends_a_smooth_path_is_missed_by_as_much_as_the_docs_say(n_t: int, least: float, most: float):
    """Minimum jerk is of the fifth degree, the time spline of the third."""
    quality = Quality(n_u=9, n_t=n_t, method="march", estimate=False, keep_grid=True)
    found = measure(predict(replace(paper_case(0.25), quality=quality)))
    assert found.held < HELD
    assert least < found.held_between < most


@pytest.mark.parametrize("factor", [0.0, 0.7, -1.0])
def test_reactions_that_do_not_move_the_cable_are_noticed(sound: Prediction, factor: float):
    found = measure(with_reaction(sound, factor))
    assert found.momentum is not None
    assert found.momentum > LOST


def test_energy_from_nothing_is_noticed(sound: Prediction):
    found = measure(with_reaction(sound, 0.0))  # the cable rises and gains speed, and nobody did it
    assert found.energy is not None
    assert found.energy > GAIN


def test_the_velocity_after_a_release_is_none_of_the_motion_before_it():
    # at the instant of the release the surface has both, and the bent cable springs away at once
    grasps = (
        Grasp(u=0.2, hold="tangent"),
        Grasp(u=0.8, hold="tangent", path=Move(displacement=(-0.1, 0.3, 0.0), duration=1.0), release_time=0.5),
    )
    around = Environment(gravity=(0.0, 0.0, 0.0))
    quality = Quality(n_u=17, n_t=49, method="march", estimate=False)
    stiff = cable(bending_stiffness=4.0)
    released = predict(Scene(cable=stiff, shape=Straight(), grasps=grasps, environment=around, quality=quality))
    found = measure(released)
    assert found.energy is not None
    assert found.energy < GAIN
    assert found.momentum is not None
    assert found.momentum < LOST
