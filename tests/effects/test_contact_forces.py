"""How hard table and obstacles press: what balances weight and tension, and nothing where nothing touches."""

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
    ControlPoints,
    Cylinder,
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
from dlocore.effects.contact import normal_force, normal_forces
from tests.pegs import RADIUS, around_a_peg

G = 9.81  # [m/s^2]
CABLE = Cable(length=1.0, diameter=0.005, linear_density=0.05, bending_stiffness=1e-3)
WEIGHT = 0.05 * G  # [N]
SCENES = catalogue()
LIFTED = SCENES["middle lifted from the table"]


def sizes(vectors: np.ndarray) -> np.ndarray:
    return np.linalg.norm(vectors, axis=1)


def at_end(prediction: Prediction) -> np.ndarray:
    """Return the sum of what contacts and grippers give at the end of a motion [N]."""
    contacts = [contact.force[-1] for contact in prediction.contacts]
    return np.sum([*contacts, *[grasp.reaction[-1] for grasp in prediction.grasps]], axis=0)


def waiting(scene: Scene, time: float) -> Scene:
    """Return a scene that waits at the end of its motion [s], comes to rest, and has nothing rough in its way."""
    end = max(g.start + g.path.duration for g in scene.grasps)
    smooth = [replace(obstacle, friction=0.0) for obstacle in scene.environment.obstacles]
    around = replace(scene.environment, drag=max(scene.environment.drag, 0.3), obstacles=smooth)
    return replace(scene, horizon=end + time, environment=around)


@pytest.mark.parametrize("name", ["middle lifted from the table", "end lifted from the table", "lowered over a bar"])
def test_contacts_and_grippers_together_bear_the_weight_of_a_cable_at_rest(name: str) -> None:
    prediction = predict(waiting(SCENES[name], 2.0))
    assert prediction.status == "converged", prediction.message
    (contact,) = prediction.contacts
    assert contact.force[-1, 2] > 0.2 * WEIGHT
    np.testing.assert_allclose(at_end(prediction)[2], WEIGHT, rtol=4e-3)


def test_a_cable_in_the_plane_of_the_table_lies_on_it_with_its_weight() -> None:
    sideways = Grasp(u=0.25, path=Move(displacement=(0.0, 0.3, 0.0), duration=1.0))
    around = Environment(drag=0.1, table=Table(friction=0.2))
    prediction = predict(Scene(cable=CABLE, shape=Straight(), grasps=[sideways], environment=around))
    (contact,) = prediction.contacts
    assert contact.name == "table"
    np.testing.assert_array_equal(contact.force, np.tile([0.0, 0.0, WEIGHT], (len(contact.times), 1)))
    np.testing.assert_array_equal(contact.pressed, WEIGHT)


PULLED = {
    "limp": (1e-5, 200.0, 0.004, G),
    "bends": (1e-3, 640.0, 0.002, G),
    "hardly stretches": (1e-4, 1e5, 4e-4, G),
    "hardly stretches, and stiffer": (1e-3, 1e6, 1e-4, G),
    "limp and without weight": (1e-6, 200.0, 0.004, 0.0),
    "limp and without weight, pulled less": (1e-6, 200.0, 0.001, 0.0),
}


@pytest.mark.parametrize("name", PULLED)
def test_a_cable_that_is_pulled_around_a_smooth_peg_presses_with_its_tension_over_the_wrapped_angle(name: str) -> None:
    """A smooth peg takes 2 T on the whole, and T - EI/(2 R^2), the tension where the cable is bent, times the angle.

    T is EA times the strain. Where contact was as soft as weight and stiffness alone ask for, a cable that hardly
    stretches, or has no weight, sank into the peg instead, to 3 % of T and 70 % of its diameter.
    """
    EI, EA, pull, gravity = PULLED[name]
    prediction = predict(around_a_peg(EI, EA, (pull, pull), gravity=gravity))
    assert prediction.status == "converged", prediction.message
    assert prediction.level is not None
    assert prediction.level.motion.deepest < 0.02 * prediction.scene.cable.diameter
    (contact,) = [c for c in prediction.contacts if c.name == "obstacles[0]"]
    tension = np.array([-grasp.reaction[-1, 0] for grasp in prediction.grasps])
    for grasp in prediction.grasps:
        assert grasp.reaction_error is not None
        assert abs(-grasp.reaction[-1, 0] - EA * 2.0 * pull / 0.8) < grasp.reaction_error[-1]
    assert contact.force[-1, 0] == pytest.approx(tension.sum(), rel=1e-3)
    assert abs(contact.force[-1, 1]) < 1e-3 * tension[0]
    where_bent = tension.mean() - 0.5 * EI / (RADIUS + 0.5 * 0.004) ** 2
    assert contact.pressed[-1] == pytest.approx(math.pi * where_bent, rel=0.01)


def test_what_is_not_touched_gives_nothing_and_what_is_out_of_reach_is_not_named() -> None:
    near, far = Sphere(center=(0.3, 0.08, 0.0), radius=0.02), Sphere(center=(0.0, 9.0, 0.0), radius=0.02)
    around = Environment(drag=0.1, table=Table(), obstacles=[far, near])
    side = Grasp(u=0.0, path=Move(displacement=(0.0, -0.05, 0.0), duration=1.0))
    scene = Scene(cable=CABLE, shape=Straight(), grasps=[side], environment=around, effects={"obstacles": "auto"})
    called = {contact.name: contact for contact in predict(scene).contacts}
    assert set(called) <= {"table", "obstacles[1]"}
    both = predict(replace(scene, effects={"obstacles": "on"}))
    assert [contact.name for contact in both.contacts] == ["table", "obstacles[0]", "obstacles[1]"]
    for contact in both.contacts[1:]:
        assert not contact.force.any()
        assert not contact.pressed.any()


def test_an_obstacle_that_is_given_twice_is_named_twice() -> None:
    peg = Cylinder(center=(0.6, 0.08, 0.0), radius=0.02, height=0.1)
    side = Grasp(u=0.25, path=Move(displacement=(0.0, 0.3, 0.0), duration=1.0))
    around = Environment(drag=0.1, table=Table(), obstacles=[peg, peg])
    prediction = predict(Scene(cable=CABLE, shape=Straight(), grasps=[side], environment=around))
    _, first, second = prediction.contacts
    assert (first.name, second.name) == ("obstacles[0]", "obstacles[1]")
    assert first.pressed.max() > 1e-3  # N
    np.testing.assert_array_equal(first.force, second.force)


def test_the_force_of_a_box_on_a_cable_pulled_over_its_edge_bears_what_grippers_do_not() -> None:
    prediction = predict(waiting(SCENES["pulled over the edge of a box"], 1.5))
    assert prediction.status == "converged", prediction.message
    scene = prediction.scene
    assert isinstance(scene.environment.obstacles[0], Box)
    weight = scene.cable.linear_density * scene.cable.length * G
    assert at_end(prediction)[2] == pytest.approx(weight, rel=0.01)


def test_the_error_of_a_force_holds_against_a_much_finer_march() -> None:
    own = predict(replace(LIFTED, quality=Quality(target_error=0.005))).contacts[0]
    fine = predict(replace(LIFTED, quality=Quality(target_error=0.0002))).contacts[0]
    finer = np.column_stack([np.interp(own.times, fine.times, fine.force[:, d]) for d in range(3)])
    assert own.force_error is not None
    assert np.mean(sizes(own.force - finer) <= own.force_error) > 0.9
    assert own.force_error.mean() < 0.1 * WEIGHT


@pytest.mark.parametrize("horizon", [0.02, 0.3, 0.5, 2.0])
def test_a_cable_that_begins_on_a_box_is_borne_by_it_from_the_beginning_within_the_error(horizon: float) -> None:
    """It gives nothing at t = 0, where it has not been pressed yet, and swings on the box for some milliseconds."""
    box = Box(center=(0.5, 0.0, -0.5 * CABLE.diameter - 0.25), size=(4.0, 4.0, 0.5))
    lifts = Grasp(u=0.0, path=Move(displacement=(0.0, 0.0, 0.2 * min(1.0, horizon) ** 2), duration=horizon))
    around = Environment(drag=0.05, obstacles=[box])
    scene = Scene(cable=CABLE, shape=Straight(), grasps=[lifts], environment=around, horizon=horizon)
    (contact,) = predict(scene).contacts
    assert contact.force_error is not None
    off = np.abs(contact.force[:, 2] - WEIGHT)
    assert off[0] < contact.force_error[0]
    assert np.all((off < contact.force_error + 0.02 * WEIGHT)[contact.times < 0.01])  # as little is lifted by then
    assert np.median(contact.force_error) < 0.02 * WEIGHT


def pressed_into_a_ball(velocity: float) -> ContactForce:
    """Return what a ball gives to a straight cable that begins 20 um deep in it, and is moved there with a velocity."""
    ball = Sphere(center=(0.5, 0.0, -0.05 - 0.0025 + 2e-5), radius=0.05)
    shape = ControlPoints(
        control_points=[(x, 0.0, 0.0) for x in (0.0, 1 / 9, 1 / 3, 2 / 3, 8 / 9, 1.0)],
        velocity=[(0.0, 0.0, 0.0, 0.0)] * 2 + [(0.0, 0.0, velocity, 0.0)] * 2 + [(0.0, 0.0, 0.0, 0.0)] * 2,
    )
    scene = Scene(
        cable=CABLE,
        shape=shape,
        grasps=[Grasp(u=0.0), Grasp(u=1.0)],
        horizon=0.01,
        environment=Environment(obstacles=[ball]),
        effects={"obstacles": "on"},
    )
    contact = predict(scene).contacts[-1]
    assert contact.name == "obstacles[0]"
    return contact


def test_what_is_pressed_in_is_pressed_out_and_more_so_as_it_comes_in() -> None:
    still, coming = (pressed_into_a_ball(velocity) for velocity in (0.0, -0.02))
    assert still.force[0, 2] > 0.0
    assert still.pressed[0] == pytest.approx(still.force[0, 2], rel=1e-3)
    assert coming.force[0, 2] > 1.2 * still.force[0, 2]


def test_contacts_are_pickled_and_taken_on_by_a_motion_like_it() -> None:
    like = predict(LIFTED)
    sent = pickle.loads(pickle.dumps(like)).contacts[0]
    again = predict(LIFTED, like=like)
    assert again.judged is like
    for other in (sent, again.contacts[0]):
        np.testing.assert_array_equal(other.force, like.contacts[0].force)
        np.testing.assert_array_equal(other.force_error, like.contacts[0].force_error)


def test_the_reference_and_a_cable_that_nothing_touches_have_none() -> None:
    side = Grasp(u=0.0, path=Move(displacement=(0.0, 0.2, 0.0), duration=1.0))
    free = Scene(cable=CABLE, shape=Straight(), grasps=[side], environment=Environment(drag=0.1, gravity=(0, 0, 0)))
    assert predict(free).contacts == ()
    assert predict(replace(free, quality=Quality(method="reference", target_error=0.02))).contacts == ()


def test_the_law_of_nodes_that_touch_at_once_is_that_of_one() -> None:
    random = np.random.default_rng(1)
    k, w, c = 6e4, 2.5e-5, 110.0
    depth, leaving = random.uniform(0.0, 3.0 * w, 50), random.uniform(-0.02, 0.02, 50)
    alone = [normal_force.py_func(k, w, c, d, v)[0] for d, v in zip(depth, leaving, strict=True)]
    assert min(alone) == 0.0 < max(alone)
    np.testing.assert_allclose(normal_forces(k, w, c, depth, leaving), alone, rtol=1e-12)


def test_a_wall_presses_on_the_end_that_is_pushed_against_it_as_the_gripper_does() -> None:
    # the force was 250 times too large, the tip a fifth of D inside, and no error told of it
    length, across = 0.3, np.sqrt(0.5)
    tip = length * across
    push = Grasp(u=0.0, hold="tangent", path=Move(displacement=(0.04, 0.0, 0.0), duration=1.0))
    cable = Cable(length=length, diameter=0.005, linear_density=0.04, bending_stiffness=5e-3, bending_damping=2e-4)
    found = predict(
        Scene(
            cable=cable,
            shape=Straight(direction=(across, across, 0.0)),
            grasps=(push,),
            environment=Environment(
                drag=0.05, table=Table(), obstacles=(Box(center=(tip + 0.0535, 0.0, 0.0), size=(0.1, 2.0, 0.2)),)
            ),
            horizon=1.5,
            quality=Quality(target_error=3e-4),
        )
    )
    assert found.status == "converged"
    reached = found.surface([length], [1.5])[0, 0, 0]
    assert reached == pytest.approx(tip + 0.0535 - 0.05 - 0.0025, abs=0.03 * 0.005)
    held, wall = found.grasps[0], found.contacts[-1]
    assert wall.force[-1, 0] == pytest.approx(-held.reaction[-1, 0], rel=0.02)
    assert wall.force[-1, 1] == pytest.approx(0.0, abs=1e-3)


def lifted_from_a_box(quality: Quality) -> Scene:
    block = Box(center=(0.5, 0.0, -0.1), size=(2.0, 1.0, 0.2), friction=0.0)
    return Scene(
        cable=replace(CABLE, bending_damping=2e-5),
        shape=Straight(start=(0.0, 0.0, 0.0025)),
        grasps=(Grasp(u=0.5, path=Move(displacement=(0.0, 0.0, 0.05), duration=1.0)),),
        environment=Environment(drag=0.3, obstacles=(block,)),
        horizon=3.0,
        quality=quality,
    )


def test_the_top_of_a_box_presses_with_the_nodes_that_the_march_had() -> None:
    # where one node stood for a diameter of them, all of them together bear a thousandth more than the weight
    lifted = lifted_from_a_box(Quality())
    np.testing.assert_allclose(at_end(predict(lifted)), [0.0, 0.0, WEIGHT], atol=1e-5 * WEIGHT)


def test_in_a_least_squares_it_presses_with_all_nodes() -> None:
    # with those of the march it were the weight and 8e-5 of it
    found = predict(lifted_from_a_box(Quality(n_u=25, n_t=33, method="spacetime", keep_grid=True)))
    assert (found.status, found.accuracy.method) == ("converged", "spacetime")
    np.testing.assert_allclose(at_end(found), [0.0, 0.0, WEIGHT], atol=1e-6 * WEIGHT)
