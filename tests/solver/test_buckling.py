"""A straight cable that is pushed or twisted along itself is given a side to buckle to, and nothing else is."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

from dlocore import (
    Box,
    Cable,
    ControlPoints,
    Environment,
    Grasp,
    Load,
    Move,
    PointMass,
    Points,
    Prediction,
    Quality,
    Scene,
    Sphere,
    Straight,
    Table,
    Waypoints,
    equilibrium,
    predict,
)
from dlocore.problem.buckling import BOW
from dlocore.problem.problem import pose
from dlocore.shape.shape import start_curve
from dlocore.spline import greville, uniform_knots

WEIGHTLESS = Environment(gravity=(0.0, 0.0, 0.0), drag=0.3)
LYING = Environment(drag=0.3, table=Table())
HANGING = Environment(drag=0.3)
ROUGH = Environment(drag=0.05, table=Table(friction=1.0))


def cord(**changes: Any) -> Cable:
    values = {"length": 1.0, "diameter": 0.005, "linear_density": 0.05, "bending_stiffness": 1e-2}
    return Cable(**(values | changes))


def way(*displacement: float, time: float = 2.0, **changes: Any) -> Move:
    return Move(displacement=displacement, duration=time, **changes)


BEHIND = Grasp(u=0.0, path=way(0.3, 0.0, 0.0, time=3.0))  # along the cable, which it pushes


def pushed(by: float = 0.3, around: Environment = LYING, cable: Cable | None = None, **changes: Any) -> Scene:
    """Return a straight cable whose ends come closer."""
    hold = changes.pop("hold", "point")
    grasps = (Grasp(u=0.0, hold=hold), Grasp(u=1.0, hold=hold, path=way(-by, 0.0, 0.0)))
    return Scene(cable=cable or cord(), shape=Straight(), grasps=grasps, environment=around, **changes)


def standing(stiffness: float, **changes: Any) -> Scene:
    """Return a cable that stands upright on a foot that holds its direction."""
    foot = (Grasp(u=0.0, hold="clamp"),)
    shape = Straight(direction=(0.0, 0.0, 1.0))
    cable = cord(bending_stiffness=stiffness)
    return Scene(cable=cable, shape=shape, grasps=foot, environment=replace(HANGING, drag=0.5), **changes)


def bow(scene: Scene) -> float:
    return pose(scene).start.bow


def at_end(p: Prediction, u: float) -> Any:
    return p.surface.positions([u], p.surface.horizon)[0, 0]


def elastica(apart: float) -> float:
    """Return the height of the elastica of length one whose ends are `apart`: k/K(k) with 2 E(k)/K(k) - 1 = apart."""
    m = float(brentq(lambda m: 2 * ellipe(m) / ellipk(m) - 1 - apart, 1e-6, 0.999))
    return float(np.sqrt(m) / ellipk(m))


@pytest.mark.parametrize("around", [LYING, WEIGHTLESS], ids=["table", "weightless"])
@pytest.mark.parametrize("by", [0.01, 0.3, 0.6])
def test_grippers_that_come_closer_end_at_the_elastica(by: float, around: Environment) -> None:
    scene = pushed(by, replace(around, drag=2.0), horizon=6.0)
    prediction = predict(scene)
    assert prediction.status == "converged", prediction.message
    # pushed so fast it buckles in short waves first, which may leave it on its other side
    assert abs(at_end(prediction, 0.5)[1]) == pytest.approx(elastica(1.0 - by), abs=3e-3)
    assert "no side to buckle to" in prediction.message
    assert "mirror image" in prediction.message


def test_the_side_is_the_left_of_the_cable_in_every_direction() -> None:
    scene = pushed()
    turned = replace(
        scene,
        shape=Straight(start=(1.0, 2.0, 0.0), direction=(0.0, -1.0, 0.0)),
        grasps=(Grasp(u=0.0), Grasp(u=1.0, path=way(0.0, 0.3, 0.0))),
    )
    here, there = predict(scene), predict(turned)
    y = at_end(here, 0.5)[1]
    assert y > 0.2
    assert at_end(there, 0.5)[0] == pytest.approx(1.0 + y, abs=1e-6)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_a_start_that_settles_straight_buckles_to_the_side_that_it_was_given_on(side: float) -> None:
    x = np.linspace(0.0, 1.0, 49)[:, None]
    scene = pushed(by=0.2)
    curves = [x * [1.0, 0.0, 0.0] + side * aside * x * (1.0 - x) * [0.0, 1.0, 0.0] for aside in (1e-7, 4e-6, 2e-4)]
    scenes = [replace(scene, shape=Points(points=points, settle=True)) for points in curves]
    answers = [predict(s) for s in scenes]
    for answer in answers:
        assert answer.status == "converged", answer.message
        assert f"bow of 1 mm to its {'left' if side > 0.0 else 'right'}" in answer.message
    ends = [at_end(answer, 0.5) for answer in answers]
    assert ends[0][1] * side > 0.1
    assert np.abs(ends[1] - ends[0]).max() < 2e-3
    assert np.abs(ends[2] - ends[0]).max() < 2e-3


def arc(turn: float, **changes: Any) -> Points:
    """Return an arc of length one that turns to the left from the x axis, and is to settle."""
    a = np.linspace(0.0, turn, 49)
    return Points(points=np.column_stack([np.sin(a), 1.0 - np.cos(a), np.zeros(49)]) / turn, settle=True, **changes)


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_points_that_grippers_press_straight_buckle_to_the_side_that_they_were_given_on(side: float) -> None:
    """93:19917: an arc 1.7 mm high between two pins is shorter than the cable by less than buckles it."""
    points = np.asarray(arc(8.0 * 1.7e-3).points)
    points = points @ [[1.0, 0.0, 0.0], [0.0, side, 0.0], [0.0, 0.0, 1.0]]
    inwards = -0.8 * points[-1] / np.linalg.norm(points[-1])
    grasps = (Grasp(u=0.0), Grasp(u=1.0, path=Move(displacement=inwards, duration=4.0)))
    scene = Scene(
        cable=cord(diameter=0.012, linear_density=0.2, bending_stiffness=2e-2),
        shape=Points(points=points, settle=True), grasps=grasps, environment=replace(WEIGHTLESS, drag=1.2), horizon=4.0,
    )  # fmt: skip
    assert bow(scene) == pytest.approx(-side * BOW, rel=0.02)  # an arc to the left lies on the right of its chord
    prediction = predict(scene)
    assert prediction.status == "converged", prediction.message
    chord = at_end(prediction, 1.0) - at_end(prediction, 0.0)
    across = np.cross(chord, at_end(prediction, 0.5) - at_end(prediction, 0.0))[2] / np.linalg.norm(chord)
    assert across == pytest.approx(-side * elastica(0.2), abs=3e-3)


@pytest.mark.parametrize("hold", ["tangent", "clamp"])
def test_an_arc_that_comes_to_rest_on_a_line_moves_as_one_that_was_given_there(hold: Any) -> None:
    ahead = (Grasp(u=0.0, hold=hold, path=way(0.2, 0.0, 0.0, time=1.0)),)
    scene = Scene(
        cable=cord(bending_stiffness=1e-3, linear_density=0.1), shape=arc(0.6), grasps=ahead,
        environment=replace(WEIGHTLESS, drag=5.0),
    )  # fmt: skip
    settled, given = predict(scene), predict(replace(scene, shape=Straight()))
    assert settled.status == given.status == "converged", settled.message
    away = settled.surface.sample()[2][..., :3] - given.surface.sample()[2][..., :3]
    assert np.linalg.norm(away, axis=-1).max() < 1e-3
    # a push that it bears needs no bow, and neither does a pull
    assert bow(replace(scene, cable=cord(bending_stiffness=1.0))) == 0.0
    assert bow(replace(scene, grasps=(replace(ahead[0], path=way(-0.2, 0.0, 0.0, time=1.0)),))) == 0.0


def test_a_cable_that_comes_to_hang_has_a_bow_where_it_is_lowered_to_a_table() -> None:
    u = np.linspace(0.0, 1.0, 49)
    shape = Points(points=np.column_stack([0.2 * u * (1.0 - u * u), 0.0 * u, 1.05 - u]), settle=True)
    lowered = (Grasp(u=0.0, path=way(0.0, 0.0, -0.2)),)
    scene = Scene(cable=cord(bending_stiffness=1e-3), shape=shape, grasps=lowered, environment=LYING)
    assert bow(scene) == pytest.approx(BOW, rel=0.02)
    assert bow(replace(scene, grasps=(replace(lowered[0], path=way(0.0, 0.0, 0.2)),))) == 0.0


def test_a_cable_that_would_fall_from_its_line_as_it_settles_is_not_straight_first() -> None:
    u = np.linspace(0.0, 1.0, 49)
    shape = Points(points=np.column_stack([0.05 * u * u, 0.0 * u, u]), settle=True)
    foot = (Grasp(u=0.0, hold="tangent", path=way(0.0, 0.0, 4.0, time=0.5)),)
    scene = Scene(cable=cord(bending_stiffness=1e-2), shape=shape, grasps=foot, environment=HANGING)
    assert bow(scene) == 0.0
    assert bow(replace(scene, cable=cord(bending_stiffness=0.1))) != 0.0  # it stands, until it is pushed up


AHEAD = (Grasp(u=0.0, hold="tangent", path=way(0.2, 0.0, 0.0, time=1.0)),)
STAYS_BENT = {
    "does not settle": {"shape": replace(arc(0.6), settle=False)},
    "bent without stress": {"cable": cord(bending_stiffness=1e-3, rest_shape="initial")},
    "on a rough table": {"environment": replace(LYING, drag=5.0, table=Table(friction=0.5))},
    "beside an obstacle": {
        "environment": replace(WEIGHTLESS, drag=5.0, obstacles=(Sphere(center=(0.8, 0.1, 0.0), radius=0.04),))
    },
    "held elsewhere": {"grasps": (*AHEAD, Grasp(u=0.7, path=way(0.2, 0.0, 0.0, time=1.0)))},
    "directions apart": {"grasps": (*AHEAD, Grasp(u=1.0, hold="tangent", path=way(0.1, 0.0, 0.0, time=1.0)))},
}


@pytest.mark.parametrize("changes", STAYS_BENT.values(), ids=STAYS_BENT)
def test_a_start_that_something_keeps_bent_is_not_straight(changes: dict[str, Any]) -> None:
    scene = Scene(
        cable=cord(bending_stiffness=1e-3), shape=arc(0.6), grasps=AHEAD, environment=replace(WEIGHTLESS, drag=5.0)
    )
    assert bow(scene) != 0.0
    assert bow(replace(scene, **changes)) == 0.0


@pytest.mark.parametrize("hold", ["tangent", "clamp"])
@pytest.mark.parametrize("space", [0.0, 2e-3])
def test_clamps_twist_a_curve_in_space_as_it_comes_to_rest_on_a_line(hold: Any, space: float) -> None:
    control = np.column_stack([greville(uniform_knots(9, 1.0)), np.zeros((9, 3))])
    control[2:-2, 1], control[2:-2, 2] = 2e-3, space * np.array([1.0, 0.5, 0.0, -0.5, -1.0])
    grasps = (Grasp(u=0.0, hold=hold), Grasp(u=1.0, hold=hold, path=way(-0.3, 0.0, 0.0)))
    scene = Scene(
        cable=cord(diameter=0.012, bending_stiffness=2e-2),
        shape=ControlPoints(control_points=control, settle=True), grasps=grasps, environment=WEIGHTLESS,
    )  # fmt: skip
    # by the holonomy of the curve, which no bow of a straight cable has
    assert (bow(scene) == 0.0) == (hold == "clamp" and space > 0.0)


def test_what_buckles_as_it_settles_is_not_straight_first() -> None:
    """Between two pins as before, but the cable hardly shortens: it comes to rest on its side."""
    points = np.asarray(arc(8.0 * 1.7e-3).points)
    grasps = (Grasp(u=0.0), Grasp(u=1.0, path=Move(displacement=-0.2 * points[-1], duration=2.0)))
    scene = Scene(
        cable=cord(axial_stiffness=1e5), shape=Points(points=points, settle=True), grasps=grasps,
        environment=WEIGHTLESS,
    )  # fmt: skip
    assert bow(scene) == 0.0
    assert bow(replace(scene, cable=cord(axial_stiffness=1e3))) != 0.0


def test_parts_that_are_pressed_unevenly_settle_on_their_line() -> None:
    """Three pins on a line, the middle one where both parts are pressed, one more than the other."""
    x = np.linspace(0.0, 1.0, 97)
    points = np.column_stack([x, 2e-3 * x * np.sin(4.0 * np.pi * x), 0.0 * x])
    grasps = tuple(Grasp(u=u, path=way(0.2 * (0.5 - u), 0.0, 0.0)) for u in (0.0, 0.5, 1.0))
    scene = Scene(
        cable=cord(diameter=0.012, bending_stiffness=2e-2), shape=Points(points=points, settle=True), grasps=grasps,
        environment=replace(LYING, drag=1.0), horizon=4.0,
    )  # fmt: skip
    prediction = predict(scene)
    assert prediction.status == "converged", prediction.message
    assert "no side to buckle to" in prediction.message
    given = start_curve(scene.shape, 1.0)([0.0, 0.5, 1.0])
    assert prediction.surface.positions([0.0, 0.5, 1.0], 0.0)[0] == pytest.approx(given, abs=1e-9)
    assert abs(given[0, 0] + given[2, 0] - 2.0 * given[1, 0]) > 1e-6


def test_the_scene_of_the_answer_is_the_one_that_was_given() -> None:
    prediction = predict(pushed())
    assert isinstance(prediction.scene.shape, Straight)
    assert prediction.scene.cable.rest_shape == "straight"
    start = prediction.surface.positions(np.linspace(0.0, 1.0, 65), 0.0)[0]
    assert np.abs(start - np.outer(np.linspace(0.0, 1.0, 65), [1.0, 0.0, 0.0])).max() < 1.01 * BOW


def test_what_is_grasped_stays_on_the_line_and_the_bow_is_at_rest() -> None:
    grasps = (Grasp(u=0.0), Grasp(u=0.4), Grasp(u=1.0, path=way(-0.3, 0.0, 0.0), grasp_time=1.0))
    scene = Scene(cable=cord(), shape=Straight(), grasps=grasps, environment=WEIGHTLESS, horizon=3.0)
    prediction = predict(replace(scene, quality=Quality(target_error=1e-3)))
    assert prediction.status == "converged", prediction.message
    for t in (0.0, 0.5, 1.0):
        held = prediction.surface.positions([0.0, 0.4], t)[0]
        assert np.abs(held - [[0.0, 0.0, 0.0], [0.4, 0.0, 0.0]]).max() < 1e-9
    before = prediction.surface.positions(np.linspace(0.0, 1.0, 33), [0.0, 0.9])
    assert np.abs(before[1] - before[0]).max() < 2e-5
    assert bow(scene) == pytest.approx(0.6 * BOW, rel=0.02)  # of the part that is pushed alone


@pytest.mark.parametrize("hold", ["point", "tangent"])
def test_a_part_that_is_pushed_later_has_no_bow_where_a_grasp_holds_it_first(hold: Any) -> None:
    """A hanging cable is let go as a grasp below closes: above that it stands, and buckles."""
    first = Grasp(u=0.4, hold=hold, release_time=1.0)
    grasps = (first, Grasp(u=0.9, hold="tangent", grasp_time=1.0))
    shape = Straight(direction=(0.0, 0.0, -1.0))
    limp = cord(bending_stiffness=1e-3)
    scene = Scene(cable=limp, shape=shape, grasps=grasps, environment=HANGING, horizon=2.0)
    assert abs(bow(scene)) > 0.3 * BOW
    prediction = predict(replace(scene, quality=Quality(n_u=31, n_t=61, estimate=False)))
    held = prediction.surface.positions([0.4], [0.0, 0.5])[:, 0]
    assert np.abs(held - [0.0, 0.0, -0.4]).max() < 1e-9


@pytest.mark.parametrize("hold", ["tangent", "clamp"])
def test_held_directions_stay(hold: str) -> None:
    prediction = predict(pushed(hold=hold))
    assert prediction.status == "converged", prediction.message
    near = prediction.surface.positions([1e-4, 1.0 - 1e-4], prediction.surface.horizon)[0]
    assert np.abs(near[:, 1:]).max() < 1e-6  # of 1e-4
    assert at_end(prediction, 0.5)[1] > 0.2


@pytest.mark.parametrize(
    "scene",
    [
        pushed(by=-1e-4),
        pushed(by=1e-6),  # far less than what the cable can be shortened by before it buckles
        Scene(cable=cord(), shape=Straight(), grasps=(Grasp(u=0.0, path=way(-0.5, 0.0, 0.0)),), environment=LYING),
        Scene(cable=cord(), shape=Straight(), grasps=(Grasp(u=0.5, path=way(0.0, 0.5, 0.0)),), environment=LYING),
        Scene(cable=cord(), shape=Straight(), grasps=(Grasp(u=0.0),), environment=HANGING, horizon=2.0),
        Scene(cable=cord(), shape=Straight(), environment=WEIGHTLESS, horizon=2.0),
        replace(
            Scene(cable=cord(), shape=Straight(), environment=WEIGHTLESS, horizon=2.0),
            shape=Straight(direction=(0.0, 0.0, -1.0)),
            grasps=(Grasp(u=0.0, path=way(0.0, 0.0, 0.5)),),
            environment=HANGING,
        ),
        pushed(cable=cord(rest_shape=[[0.0, 0.0], [0.3, 0.01], [0.6, 0.03], [1.0, 0.1]])),
        pushed(around=HANGING),
        replace(pushed(), loads=(Load(u=0.5, force=(0.0, 1e-6, 0.0)),)),
        replace(pushed(), shape=Straight(velocity=(0.0, 1e-3, 0.0))),
        Scene(
            cable=cord(),
            shape=Straight(start=(0.0, 0.0, 1.6), direction=(0.0, 0.0, -1.0)),
            grasps=(Grasp(u=0.0, path=way(0.0, 0.0, -0.5)),),
            environment=LYING,
        ),
        Scene(cable=cord(), shape=Straight(), grasps=(BEHIND,), environment=Environment(table=Table(friction=0.1))),
        Scene(cable=cord(), shape=Straight(), grasps=(replace(BEHIND, path=way(-0.3, 0.0, 0.0)),), environment=ROUGH),
    ],
    ids=[
        "pulled", "hardly pushed", "drawn behind", "sideways", "weight across", "at rest", "hangs", "bent by nature",
        "sags", "load across", "moves sideways",
        "lowered over the table", "against little friction", "drawn over a rough table",
    ],
)  # fmt: skip
def test_what_has_a_side_or_needs_none_stays_as_it_is(scene: Scene) -> None:
    assert bow(scene) == 0.0


RIPPLED = Points(points=[[x, 1e-12 * (-1.0) ** k, 0.0] for k, x in enumerate(np.linspace(0.0, 1.0, 21))])
THIRDS = ControlPoints(control_points=[[x, 0.0, 0.0] for x in (0.0, 1 / 3, 2 / 3, 1.0)])
INWARDS = Waypoints(times=[0, 1, 2], positions=[[1.0, 0, 0], [0.9, 0, 0], [0.7, 0, 0]])
FOOT, BALL = Grasp(u=0.0, hold="clamp"), Sphere(center=(0.5, 0.3, 0.0), radius=0.1)
WALL = Box(center=(1.2, 0.0, 0.0), size=(0.1, 1.0, 1.0))
ABOVE = Straight(start=(0.0, 0.0, 1.05), direction=(0.0, 0.0, -1.0))
PUSHED = {
    "straight": pushed(),
    "noise of 1e-12": replace(pushed(), shape=RIPPLED),
    "control points": replace(pushed(), shape=THIRDS),
    "waypoints": replace(pushed(), grasps=(Grasp(u=0.0), Grasp(u=1.0, path=INWARDS))),
    "load": replace(pushed(), grasps=(FOOT,), loads=(Load(u=1.0, force=(-0.2, 0.0, 0.0)),), horizon=2.0),
    "free, pushed by a load": replace(pushed(), grasps=(), loads=(Load(u=0.0, force=(0.5, 0.0, 0.0)),), horizon=2.0),
    "from behind": replace(
        pushed(cable=cord(bending_stiffness=1e-4)), grasps=(Grasp(u=0.0, path=way(0.5, 0.0, 0.0, time=0.7)),)
    ),
    "against friction": Scene(
        cable=cord(bending_stiffness=1e-3), shape=Straight(), grasps=(BEHIND,), environment=ROUGH
    ),
    "against quadratic drag": Scene(
        cable=cord(bending_stiffness=1e-4),
        shape=Straight(),
        grasps=(BEHIND,),
        environment=replace(LYING, drag_quadratic=5.0),
    ),
    "obstacle": pushed(around=replace(LYING, obstacles=(BALL,))),
    "table on": pushed(effects={"table": "on"}),
    "no inertia": pushed(effects={"inertia": "off"}),
    "into a wall": replace(
        pushed(around=replace(LYING, obstacles=(WALL,))), grasps=(replace(FOOT, path=way(0.4, 0.0, 0.0)),)
    ),
    "into the nearer of two walls": replace(
        pushed(around=replace(LYING, obstacles=(replace(WALL, center=(2.0, 0.0, 0.0)), WALL))),
        grasps=(replace(FOOT, path=way(0.4, 0.0, 0.0)),),
    ),
    "on to the table": Scene(
        cable=cord(), shape=ABOVE, grasps=(Grasp(u=0.0, path=way(0.0, 0.0, -0.5)),), environment=LYING
    ),
    "past two balls": replace(
        pushed(around=replace(LYING, obstacles=(BALL, replace(BALL, center=(1.5, 0.3, 0.0))))),
        cable=cord(bending_stiffness=1e-4),
        grasps=(Grasp(u=0.0, path=way(0.5, 0.0, 0.0, time=0.7)),),
    ),
    "let fall on its end": Scene(
        cable=cord(bending_stiffness=0.1), shape=replace(ABOVE, start=(0.0, 0.0, 1.2)), environment=LYING, horizon=0.6
    ),
}


@pytest.mark.parametrize("scene", PUSHED.values(), ids=PUSHED)
def test_every_kind_of_straight_start_and_push_gets_a_bow(scene: Scene) -> None:
    assert bow(scene) == pytest.approx(BOW, rel=0.02)
    prediction = predict(scene)
    assert prediction.status == "converged", prediction.message
    along = np.asarray(scene.shape.direction if isinstance(scene.shape, Straight) else (1.0, 0.0, 0.0))
    at = prediction.surface.positions(np.linspace(0.0, 1.0, 65), prediction.surface.horizon)[0]
    assert np.linalg.norm(np.cross(at - at[0], along), axis=1).max() > 1.5 * BOW


def test_a_mass_ahead_of_what_pushes_it_buckles_a_cable_that_alone_stays_straight() -> None:
    alone = Scene(
        cable=cord(bending_stiffness=0.05),
        shape=Straight(),
        grasps=(replace(BEHIND, path=way(0.3, 0.0, 0.0, time=1.0)),),
        environment=LYING,
    )
    loaded = replace(alone, cable=replace(alone.cable, point_masses=[PointMass(u=1.0, mass=1.0)]))
    assert bow(alone) == 0.0
    assert bow(loaded) == pytest.approx(BOW, rel=0.02)
    in_the_gripper = replace(alone, cable=replace(alone.cable, point_masses=[PointMass(u=0.0, mass=1.0)]))
    assert bow(in_the_gripper) == 0.0


def test_a_column_that_its_foot_bears_stands_and_a_taller_one_bends_over() -> None:
    # Greenhill: mu g L^3/EI = 7.84 is the most that stands
    stands, falls = 0.05 * 9.81 / 7.0, 0.05 * 9.81 / 12.0
    assert at_end(predict(standing(4.0, horizon=2.0)), 1.0) == pytest.approx([0.0, 0.0, 1.0], abs=1e-6)
    upright = equilibrium(standing(2.0 * stands, horizon=2.0)).positions([1.0])[0]
    assert upright == pytest.approx([0.0, 0.0, 1.0], abs=1e-5)
    scene = standing(falls, horizon=30.0)
    bent = equilibrium(scene).positions([1.0])[0]
    assert bent[0] > 0.3
    prediction = predict(scene)
    assert prediction.status == "converged", prediction.message
    assert at_end(prediction, 1.0) == pytest.approx(bent, abs=2e-3)


def test_equilibria_do_not_depend_on_the_horizon() -> None:
    short = equilibrium(standing(0.03, horizon=0.01)).positions([1.0])[0]
    assert short[0] > 0.3


@pytest.mark.parametrize(("turns", "leaves"), [(0.5, False), (3.0, True)])
def test_twist_beyond_what_a_straight_cable_bears_takes_it_off_its_line(turns: float, leaves: bool) -> None:
    # Greenhill: a torque of 2 pi EI/L, one turn where GJ = EI
    spin = way(-0.05, 0.0, 0.0, time=3.0, rotation=(2.0 * np.pi * turns, 0.0, 0.0))
    held = replace(spin, displacement=(0.0, 0.0, 0.0)) if not leaves else spin
    grasps = (Grasp(u=0.0, hold="clamp"), Grasp(u=1.0, hold="clamp", path=held))
    cable = cord(torsional_stiffness=1e-2)
    scene = Scene(cable=cable, shape=Straight(), grasps=grasps, environment=replace(WEIGHTLESS, drag=1.0))
    assert (bow(scene) > 0.0) == leaves
    prediction = predict(scene)
    assert prediction.status == "converged", prediction.message
    u = np.linspace(0.0, 1.0, 65)
    aside = np.linalg.norm(prediction.surface.positions(u, 3.0)[0, :, 1:], axis=1)
    assert (aside.max() > 0.05) == leaves


def test_a_start_that_is_twisted_more_than_it_bears_leaves_its_line() -> None:
    control = np.column_stack([np.linspace(0.0, 1.0, 4), np.zeros((4, 2)), np.linspace(0.0, 15.0, 4)])
    grasps = (Grasp(u=0.0, hold="clamp"), Grasp(u=1.0, hold="clamp"))
    scene = Scene(
        cable=cord(torsional_stiffness=1e-2),
        shape=ControlPoints(control_points=control),
        grasps=grasps,
        environment=replace(WEIGHTLESS, drag=1.0),
        horizon=3.0,
    )
    prediction = predict(scene)
    assert prediction.status == "converged", prediction.message
    aside = np.linalg.norm(prediction.surface.positions(np.linspace(0.0, 1.0, 65), 3.0)[0, :, 1:], axis=1)
    assert aside.max() > 3.0 * BOW  # between ends that do not come closer
    assert bow(replace(scene, cable=cord(torsional_stiffness=1e-3))) == 0.0


def test_a_cable_that_another_gripper_takes_over_buckles_as_without() -> None:
    # each had a bow of its own: the second to the other side, so that nothing was left of the two
    given = pushed()
    hands = (replace(given.grasps[0], release_time=0.8), Grasp(u=0.0, grasp_time=0.8), given.grasps[1])
    one, two = predict(given), predict(replace(given, grasps=hands))
    assert one.status == two.status == "converged", two.message
    assert bow(replace(given, grasps=hands)) == bow(given) == pytest.approx(BOW)
    u, t = np.linspace(0.0, 1.0, 33), np.linspace(0.0, 2.0, 33)
    away = np.linalg.norm(one.surface.positions(u, t) - two.surface.positions(u, t), axis=-1).max()
    assert away <= one.accuracy.error_estimate + two.accuracy.error_estimate


def test_parts_side_by_side_bow_to_both_sides_by_turns() -> None:
    grasps = tuple(Grasp(u=u, path=way(0.2 * (0.5 - u), 0.0, 0.0)) for u in (0.0, 0.25, 0.5, 0.75, 1.0))
    scene = Scene(cable=cord(), shape=Straight(), grasps=grasps, environment=replace(LYING, drag=1.0), horizon=4.0)
    prediction = predict(scene)
    assert prediction.status == "converged", prediction.message
    y = prediction.surface.positions([0.125, 0.375, 0.625, 0.875], 4.0)[0, :, 1]
    assert np.sign(y).tolist() in ([1.0, -1.0, 1.0, -1.0], [-1.0, 1.0, -1.0, 1.0])
    assert np.abs(y).min() > 0.02


def test_the_reference_buckles_to_the_same_side() -> None:
    scene = pushed(hold="clamp", around=replace(LYING, drag=0.5))
    ours = predict(replace(scene, quality=Quality(target_error=1e-3)))
    theirs = predict(replace(scene, quality=Quality(method="reference", target_error=3e-3)))
    assert theirs.status == "converged", theirs.message
    assert "no side to buckle to" in theirs.message
    away = ours.surface.sample()[2][..., :3] - theirs.surface.sample()[2][..., :3]
    assert np.linalg.norm(away, axis=-1).max() < 4e-3


@pytest.mark.parametrize("method", ["march", "spacetime"])
def test_given_grids_start_with_the_bow_too(method: Any) -> None:
    prediction = predict(pushed(quality=Quality(n_u=17, n_t=33, method=method, keep_grid=True)))
    assert at_end(prediction, 0.5)[1] > 0.2
    assert prediction.surface.positions([0.5], 0.0)[0, 0, 1] == pytest.approx(BOW, rel=0.05)
