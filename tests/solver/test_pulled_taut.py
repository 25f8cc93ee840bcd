"""Grippers that pull a cable taut are told of, and what else stretches it is not."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.catalogue import catalogue
from benchmarks.hard.generator import draw
from dlocore import (
    Cable,
    Capsule,
    Environment,
    Grasp,
    Load,
    Move,
    Points,
    Prediction,
    Quality,
    Scene,
    Straight,
    Waypoints,
    predict,
)
from dlocore.problem.problem import pose, stiff_as_taut, stiffer
from tests.solver.scenes import WEIGHTLESS, cable, march

TAUT = "the grippers pull the cable taut"
CATALOGUE = catalogue()


def told(prediction: Prediction) -> list[str]:
    return [note for note in prediction.notes if note.startswith(TAUT)]


def pulled(by: float, **changes: object) -> Scene:
    """Return a cable of 1 m that hangs between two grippers, which come nearer and part to 1 m + `by`."""
    way = Waypoints(times=[0.0, 0.5, 1.5], positions=[(1.0, 0.0, 0.0), (0.85, 0.0, 0.0), (1.0 + by, 0.0, 0.0)])
    values = {
        "cable": cable(axial_stiffness=2e4),
        "shape": Straight(),
        "grasps": [Grasp(u=0.0), Grasp(u=1.0, path=way)],
        "environment": Environment(drag=0.3),
        "horizon": 2.0,
    }
    return Scene(**(values | changes))  # type: ignore[arg-type]


def number_after(word: str, note: str) -> float:
    words = note.split()
    return float(words[words.index(word) + 1])


def test_a_cable_that_is_pulled_beyond_its_length_is_told_of_with_its_tension_and_when() -> None:
    prediction = predict(pulled(0.003))
    (note,) = told(prediction)
    assert note in prediction.message
    assert 55.0 < number_after("is", note) < 80.0  # N: 2e4 times 0.3 %, and what it swings along itself
    assert 1.4 < number_after("at", note) <= 2.0


@pytest.mark.parametrize("quality", [Quality(), march(21, 31), Quality(n_u=17, n_t=25, method="spacetime")])
def test_one_that_hangs_just_below_is_not(quality: Quality) -> None:
    assert told(predict(pulled(-0.02, quality=quality))) == []


def test_a_cable_that_is_pulled_down_over_a_bar_farther_than_it_reaches_is_held_by_it_and_told_of() -> None:
    """From the bar to an end at (0.32, -0.38) it is half a metre, and the bar has to be gone around."""
    turn = np.linspace(np.pi, 0.0, 81)
    down = Move(displacement=(0.0, 0.0, -0.38), duration=1.0)
    scene = Scene(
        cable=Cable(length=1.0, diameter=0.006, linear_density=0.05, bending_stiffness=1e-3, axial_stiffness=1e5),
        shape=Points(points=np.column_stack([np.cos(turn), 0.0 * turn, np.sin(turn)]) / np.pi),
        grasps=[Grasp(u=0.0, path=down), Grasp(u=1.0, path=down)],
        environment=Environment(
            drag=0.3, obstacles=[Capsule(start=(0.0, -0.3, 0.0), end=(0.0, 0.3, 0.0), radius=0.02)]
        ),
        quality=Quality(target_error=0.01),
    )
    prediction = predict(scene)
    assert prediction.level is not None
    assert prediction.level.motion.deepest < 0.02 * scene.cable.diameter
    (note,) = told(prediction)
    tension = number_after("is", note)
    assert 2e3 < tension < 5e3  # N: it has to be some 4 % longer
    for grasp in prediction.grasps:
        assert np.linalg.norm(grasp.reaction, axis=1).max() == pytest.approx(tension, rel=0.1)


def test_a_load_and_a_whip_stretch_a_cable_without_being_told() -> None:
    hung = Scene(
        cable=cable(axial_stiffness=2e4),
        shape=Straight(direction=(0.0, 0.0, -1.0)),
        grasps=[Grasp(u=0.0)],
        loads=[Load(u=1.0, force=(0.0, 0.0, -50.0))],
        environment=Environment(drag=0.2),
        horizon=1.0,
    )
    assert told(predict(hung)) == []
    assert told(predict(CATALOGUE["whip of a hanging cord"])) == []


def test_a_start_that_is_stretched_for_an_instant_is_not_told_of() -> None:
    """A short stiff cable that is free of stress where it is bent begins, as it was fitted, with 0.9 N along it."""
    assert told(predict(draw(144, 404).make())) == []


def test_a_straight_cable_that_is_pulled_along_itself_is_told_of_on_a_given_grid_too() -> None:
    along = Grasp(u=1.0, path=Move(displacement=(0.003, 0.0, 0.0), duration=1.0))
    scene = Scene(cable=cable(), shape=Straight(), grasps=[Grasp(u=0.0), along], environment=WEIGHTLESS)
    for quality in (Quality(), march(13, 41), march(7, 7)):
        (note,) = told(predict(replace(scene, quality=quality)))
        assert number_after("is", note) == pytest.approx(640.0 * 0.003, rel=0.02)


def test_contact_as_stiff_as_holds_a_taut_cable_is_that_of_the_cable_along_itself_over_its_diameter() -> None:
    problem = pose(CATALOGUE["pulled over the edge of a box"])
    taut = stiff_as_taut(problem)
    assert taut is not None
    assert taut.contact is not None
    around = problem.scene.cable
    assert around.axial_stiffness is not None
    assert taut.contact.stiffness == pytest.approx(around.axial_stiffness / (around.length * around.diameter))
    assert stiff_as_taut(stiffer(taut, 1.01)) is None
    assert stiff_as_taut(pose(pulled(0.0))) is None  # nothing is touched


def test_strands_are_held_apart_as_stiffly_where_a_loop_is_pulled_tight() -> None:
    loop = CATALOGUE["loop pulled smaller in space"]
    stiff = replace(loop.cable, axial_stiffness=1e7)
    problem = pose(replace(loop, cable=stiff, effects={"self_contact": "on"}))
    taut = stiff_as_taut(problem)
    assert taut is not None
    assert taut.self_contact is not None
    around = problem.scene.cable
    assert around.axial_stiffness is not None
    assert taut.self_contact.stiffness == pytest.approx(around.axial_stiffness / (around.length * around.diameter))
