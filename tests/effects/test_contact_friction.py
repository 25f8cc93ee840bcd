"""How the friction of table and obstacles holds a cable: what balances the pull of grippers, and slopes."""

import math
import pickle
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.catalogue import catalogue
from dlocore import (
    Box,
    Cable,
    ContactForce,
    Environment,
    Grasp,
    Move,
    Prediction,
    Quality,
    Scene,
    Sphere,
    Straight,
    Table,
    predict,
)
from dlocore.effects.friction import friction, friction_forces
from tests.pegs import around_a_peg

G = 9.81  # [m/s^2]
CABLE = Cable(length=1.0, diameter=0.005, linear_density=0.05, bending_stiffness=1e-3)
WEIGHT = 0.05 * G  # [N]
LIFTED = catalogue()["middle lifted from the table"]
ROUGH = 0.3


def on_rough_table(scene: Scene) -> Scene:
    around = replace(scene.environment, table=Table(friction=ROUGH), drag=0.3)
    return replace(scene, environment=around, horizon=3.0 + scene.horizon if scene.horizon else 4.0)


def given(prediction: Prediction, name: str) -> ContactForce:
    (one,) = [contact for contact in prediction.contacts if contact.name == name]
    return one


def size_of_friction(prediction: Prediction) -> float | None:
    """Return how large friction was on the whole, as the report of effects says [N]."""
    (effect,) = [effect for effect in prediction.effects if effect.name == "friction"]
    assert effect.unit == "N"
    return effect.magnitude


def total(prediction: Prediction) -> np.ndarray:
    """Return what contacts, their friction and grippers give together at the end of a motion [N]."""
    parts = [part[-1] for contact in prediction.contacts for part in (contact.force, contact.friction)]
    return np.sum([*parts, *[grasp.reaction[-1] for grasp in prediction.grasps]], axis=0)


@pytest.mark.parametrize("around", [(), (Sphere(center=(0.5, 0.4, 0.0), radius=0.1),)], ids=["alone", "a ball beside"])
def test_a_cable_that_is_pulled_along_itself_is_held_back_by_mu_times_its_weight(around: tuple[Sphere, ...]) -> None:
    pull = Grasp(u=0.0, path=Move(displacement=(-0.3, 0.0, 0.0), duration=3.0, profile="linear"))
    environment = Environment(table=Table(friction=ROUGH), obstacles=around)
    found = predict(
        Scene(cable=CABLE, shape=Straight(), grasps=[pull], environment=environment, effects={"obstacles": "on"})
    )
    assert found.status == "converged", found.message
    table = given(found, "table")
    slides = (table.times > 0.5) & (table.times < 2.9)
    np.testing.assert_allclose(
        table.friction[slides], np.tile([ROUGH * WEIGHT, 0.0, 0.0], (slides.sum(), 1)), atol=1e-3 * WEIGHT
    )
    assert size_of_friction(found) == pytest.approx(ROUGH * WEIGHT, rel=1e-3)
    pulled = np.interp(table.times[slides], found.grasps[0].times, found.grasps[0].reaction[:, 0])
    np.testing.assert_allclose(pulled, -ROUGH * WEIGHT, rtol=0.02)


def test_what_sticks_on_a_slope_is_held_by_the_weight_along_it() -> None:
    slope = Environment(gravity=(2.0, 0.0, -9.6), table=Table(friction=ROUGH))
    found = predict(Scene(cable=CABLE, shape=Straight(), environment=slope, horizon=1.0))
    assert found.status == "converged", found.message
    table = given(found, "table")
    np.testing.assert_allclose(table.friction[-1], [-2.0 * CABLE.mass, 0.0, 0.0], atol=1e-3 * WEIGHT)


def test_contacts_their_friction_and_grippers_together_bear_the_weight_of_a_cable_at_rest() -> None:
    found = predict(on_rough_table(LIFTED))
    assert found.status == "converged", found.message
    assert np.abs(given(found, "table").friction).max() > 0.02 * WEIGHT  # what lifts the middle draws the ends in
    np.testing.assert_allclose(total(found), [0.0, 0.0, WEIGHT], atol=5e-3 * WEIGHT)


def test_a_rough_peg_holds_back_what_is_drawn_around_it_as_a_capstan_does() -> None:
    """T_1 = T_2 exp(mu pi), and both pulls together load the peg."""
    found = predict(around_a_peg(1e-4, 200.0, (0.024, -0.016), friction=ROUGH))
    assert found.status == "converged", found.message
    peg = given(found, "obstacles[0]")
    strong, weak = (-grasp.reaction[-1, 0] for grasp in found.grasps)
    assert strong / weak == pytest.approx(math.exp(ROUGH * math.pi), rel=0.03)
    np.testing.assert_allclose(peg.force[-1] + peg.friction[-1], [strong + weak, 0.0, 0.0], atol=0.01 * strong)
    # of a smooth table and a rough peg: it was 0 N, that of the table
    assert size_of_friction(found) == pytest.approx(np.linalg.norm(peg.friction, axis=1).max(), rel=1e-12)
    # N = T/R and f = mu N along the turn, with T that falls from one leg to the other
    a = np.linspace(0.0, math.pi, 2001)
    tension = strong * np.exp(-ROUGH * a)
    across = np.trapezoid(ROUGH * tension * np.sin(a), a)
    assert abs(peg.friction[-1, 1]) == pytest.approx(across, rel=0.05)


def test_a_smooth_table_gives_none() -> None:
    smooth = replace(LIFTED.environment, table=Table())
    table = given(predict(replace(LIFTED, environment=smooth)), "table")
    assert table.force.any()
    assert not table.friction.any()


def test_in_a_least_squares_it_goes_with_the_speed() -> None:
    pull = Grasp(u=0.0, path=Move(displacement=(-0.3, 0.0, 0.0), duration=3.0))
    quality = Quality(n_u=9, n_t=13, method="spacetime", keep_grid=True)
    environment = Environment(table=Table(friction=ROUGH))
    found = predict(Scene(cable=CABLE, shape=Straight(), grasps=[pull], environment=environment, quality=quality))
    assert found.accuracy.method == "spacetime"
    table = given(found, "table")
    middle = int(np.argmin(np.abs(table.times - 1.5)))
    np.testing.assert_allclose(table.friction[middle], [ROUGH * WEIGHT, 0.0, 0.0], atol=2e-3 * WEIGHT)


def test_the_error_of_friction_holds_against_a_much_finer_march() -> None:
    scene = on_rough_table(LIFTED)
    own = given(predict(replace(scene, quality=Quality(target_error=0.005))), "table")
    fine = given(predict(replace(scene, quality=Quality(target_error=0.0005))), "table")
    finer = np.column_stack([np.interp(own.times, fine.times, fine.friction[:, d]) for d in range(3)])
    assert own.friction_error is not None
    off = np.linalg.norm(own.friction - finer, axis=1)
    assert np.mean(off <= own.friction_error) > 0.9
    assert np.median(own.friction_error) < 20.0 * np.median(off)
    assert own.force_error is not None
    assert not np.allclose(own.friction_error, own.force_error)


def test_friction_is_pickled_and_taken_on_by_a_motion_like_it() -> None:
    block = Box(center=(0.5, 0.0, -0.1), size=(2.0, 1.0, 0.2), friction=ROUGH)
    scene = Scene(
        cable=CABLE,
        shape=Straight(start=(0.0, 0.0, 0.0025)),
        grasps=(Grasp(u=0.0, path=Move(displacement=(-0.1, 0.0, 0.0), duration=1.0)),),
        environment=Environment(drag=0.3, obstacles=(block,)),
    )
    like = predict(scene)
    assert like.contacts[0].friction.any()
    sent, again = pickle.loads(pickle.dumps(like)), predict(scene, like=like)
    assert again.judged is like
    for other in (sent.contacts[0], again.contacts[0]):
        np.testing.assert_array_equal(other.friction, like.contacts[0].friction)
        np.testing.assert_array_equal(other.friction_error, like.contacts[0].friction_error)


@pytest.mark.parametrize("steps", [True, False])
def test_the_law_of_nodes_that_slip_at_once_is_that_of_one(steps: bool) -> None:
    random = np.random.default_rng(2)
    limit, n, slip, v = random.uniform(0.0, 2.0, 50), *random.normal(size=(3, 50, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    slip *= np.logspace(-7, -3, 50)[:, None]
    alone = [
        friction.py_func(one, tuple(normal), tuple(s), tuple(w), 1e-5, 0.005, steps)[0]
        for one, normal, s, w in zip(limit, n, slip, v, strict=True)
    ]
    np.testing.assert_allclose(friction_forces(limit, n, slip, v, 1e-5, 0.005, steps), alone, rtol=1e-11)


def test_the_errors_that_are_taken_on_are_those_of_the_same_obstacle_whatever_its_number() -> None:
    block = Box(center=(0.5, 0.0, -0.1), size=(2.0, 1.0, 0.2), friction=ROUGH)
    ball, moved = (Sphere(center=(0.5, y, 0.5), radius=0.1) for y in (0.3, 0.36))

    def with_obstacles(*obstacles: Box | Sphere) -> Scene:
        return Scene(
            cable=CABLE,
            shape=Straight(start=(0.0, 0.0, 0.0025)),
            grasps=(Grasp(u=0.0, path=Move(displacement=(-0.1, 0.0, 0.0), duration=1.0)),),
            environment=Environment(drag=0.3, obstacles=obstacles),
            effects={"obstacles": "on"},
        )

    like = predict(with_obstacles(ball, block))
    of_ball, of_block = like.contacts
    again = predict(with_obstacles(block, ball, moved), like=like)
    assert again.judged is like
    assert [contact.name for contact in again.contacts] == ["obstacles[0]", "obstacles[1]", "obstacles[2]"]
    for own, of in zip(again.contacts, (of_block, of_ball), strict=False):
        np.testing.assert_array_equal(own.force_error, of.force_error)
        np.testing.assert_array_equal(own.friction_error, of.friction_error)
    assert again.contacts[2].force_error is None  # 6 cm from the ball, of a cable of 1 m
    assert of_block.friction_error is not None
    assert of_block.friction_error.max() > 0.0
