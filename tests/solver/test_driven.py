"""Grippers that drive what they hold into something, as only the motion tells: a status that names them."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.hard.generator import draw
from benchmarks.hard.judge import DRIVEN, faults, run
from benchmarks.hard.shares import GROWTHS, Strata, is_left, strata
from dlocore import Environment, Grasp, Move, Points, Prediction, Quality, Scene, Sphere, Straight, Table, predict
from dlocore.problem.checks import TOO_DEEP
from tests.solver.scenes import WEIGHTLESS, cable, march

FOLLOWS = "which no cable can follow"


def late(way: tuple[float, float, float], environment: Environment, start: float = 0.3) -> Scene:
    """Return a straight cable, held at one end, whose other end is grasped late and moved."""
    path = Move(displacement=way, duration=0.5)
    grasps = (Grasp(u=0.0), Grasp(u=1.0, path=path, grasp_time=start))
    shape = Straight(start=(0.0, 0.0, 0.0))
    return Scene(cable=cable(), shape=shape, grasps=grasps, environment=environment, horizon=1.0)


def with_ball(way: float) -> Prediction:
    """Return the motion of a late grasp that goes sideways by a way [m], to a ball whose surface is 0.1 m away."""
    ball = Sphere(center=(1.0, 0.15, 0.0), radius=0.05)
    return predict(late((0.0, way, 0.0), replace(WEIGHTLESS, obstacles=(ball,), drag=0.1)))


def test_a_late_grasp_that_drives_its_point_into_an_obstacle_is_named():
    diameter = cable().diameter
    found = with_ball(0.1)  # the surface of the cable is half a diameter inside
    assert found.status == "stalled"
    assert f"primitives[1] drives the point that it holds {0.5:.0%} of the cable's diameter into" in found.message
    assert f"into obstacles[0] at 0.8 s, {FOLLOWS}" in found.message
    for inside, status in ((0.9 * TOO_DEEP, "converged"), (1.1 * TOO_DEEP, "stalled")):
        assert with_ball(0.1 + (inside - 0.5) * diameter).status == status


def test_one_that_lets_go_before_is_not():
    scene = late((0.0, 0.1, 0.0), replace(WEIGHTLESS, obstacles=(Sphere(center=(1.0, 0.15, 0.0), radius=0.05),)))
    first, second = scene.grasps
    found = predict(replace(scene, grasps=(first, replace(second, release_time=0.5))))
    assert found.status == "converged"


def test_what_a_grid_that_was_asked_for_shows_is_told_as_well():
    scene = late(
        (0.0, 0.1, 0.0), replace(WEIGHTLESS, obstacles=(Sphere(center=(1.0, 0.15, 0.0), radius=0.05),), drag=0.1)
    )
    found = predict(replace(scene, quality=march(17, 33)))
    assert found.status == "stalled"
    assert found.message.startswith("primitives[1] drives")


def falling(down: float) -> Scene:
    """Return a cable above a table that one grasp lifts, and another, that closes later, moves down again."""
    lift, lower = Move(displacement=(0.0, 0.0, 0.3), duration=0.5), Move(displacement=(0.0, 0.0, -down), duration=0.5)
    grasps = (
        Grasp(u=0.5, path=lift, release_time=0.5, hold="tangent"),
        Grasp(u=0.5, path=lower, grasp_time=0.5, hold="tangent"),
    )
    shape = Straight(start=(0.0, 0.0, 0.05))
    environment = Environment(drag=0.5, table=Table())
    stiff = cable(bending_stiffness=0.1)
    return Scene(cable=stiff, shape=shape, grasps=grasps, environment=environment, quality=Quality(target_error=0.01))


def test_a_late_grasp_may_go_down_from_where_the_cable_is_by_then():
    found = predict(falling(0.25))  # refused from where the cable started
    assert found.status == "converged"
    u = np.linspace(0.0, 1.0, 33)
    assert found.surface.positions(u, [found.surface.horizon])[0, 16, 2] == pytest.approx(0.1, abs=1e-6)


def test_but_not_into_the_table():
    found = predict(falling(0.36))
    assert found.status == "stalled"
    assert "primitives[1] drives the point that it holds" in found.message
    assert f"into the table at 1 s, {FOLLOWS}" in found.message


@pytest.mark.parametrize(("gap", "status"), [(2.0, "converged"), (0.5, "stalled")])
def test_held_points_within_a_diameter_of_each_other_are_named(gap: float, status: str):
    angle = np.linspace(-0.75 * np.pi, 0.75 * np.pi, 41)
    radius = 1.0 / (1.5 * np.pi)
    points = radius * np.column_stack([np.cos(angle), np.sin(angle), 0.0 * angle])
    thick = cable(diameter=0.02, bending_stiffness=0.05, rest_shape="initial")
    apart = 2.0 * radius * np.sin(0.25 * np.pi)
    way = 0.5 * (apart - gap * thick.diameter)
    grasps = tuple(
        Grasp(u=u, path=Move(displacement=(0.0, side * way, 0.0), duration=1.0))
        for u, side in ((0.0, 1.0), (1.0, -1.0))
    )
    environment = replace(WEIGHTLESS, drag=0.5)
    found = predict(
        Scene(
            cable=thick, shape=Points(points=points), grasps=grasps, environment=environment,
            effects={"self_contact": "on"}, quality=Quality(target_error=0.01),
        )
    )  # fmt: skip
    assert found.status == status, found.message
    named = (
        "primitives[1] drives the point that it holds 50% of the cable's diameter into the one that primitives[0] holds"
    )
    assert (named in found.message) == (status == "stalled")


def test_the_judge_counts_such_a_scene_as_impossible():
    drawn = draw(34, 2787)
    record = run(drawn, 30.0, False)
    assert drawn.possible
    assert not record["possible"]
    assert record["status"] == "stalled"
    assert record["shown"] in record["message"] or "into obstacles[0]" in record["shown"]
    assert record["families"] == (DRIVEN, *drawn.families)
    assert record["faults"] == []
    assert faults({**record, "status": "converged"}) == ["converged on an impossible scene"]
    assert not is_left(record)
    first = [{**record, "possible": True, "index": 0}, {**record, "possible": True, "status": "converged", "index": 1}]
    assert strata(1, first, [{**record, "index": 0}], GROWTHS[0]) == Strata(1, 0, 1, 0, 0, 1)
