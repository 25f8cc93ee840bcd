"""Premises and errors of cases notice a motion that does not do what its scene is named for, or is not true to it."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.catalogue import catalogue
from benchmarks.hard.cases import CASES, posed
from benchmarks.premises import (
    comes_to_rest,
    ends_on,
    slides_on,
    stays_elastic,
    strands_meet,
    tightens,
    touches_again,
    untouched,
    yields,
)
from dlocore import Cylinder, Grasp, Move, Prediction, Scene, Table, predict
from tests.hard.checks import hold_to


def case(name: str) -> Scene:
    return posed(CASES[name])


def beyond_reach() -> Scene:
    """Return the scene of the peg with the peg where the cable does not come to."""
    scene = case("dragged around a peg")
    peg = Cylinder(center=(0.5, 0.06, 0.0), radius=0.01, height=0.1, friction=0.3)
    return replace(scene, environment=replace(scene.environment, obstacles=(peg,)))


def not_clamped() -> Scene:
    """Return the scene of the loop with grippers that let it turn, so that it opens."""
    scene = case("tightening a loop")
    return replace(scene, grasps=tuple(Grasp(u=g.u, hold="tangent", path=g.path) for g in scene.grasps))


def of_tougher_cable() -> Scene:
    scene = case("bent to just beyond yield")
    return replace(scene, cable=replace(scene.cable, yield_strain=2.0 * float(scene.cable.yield_strain or 0.0)))


MISSED = {
    "dragged around a peg": beyond_reach,
    "tightening a loop": not_clamped,
    "bent to just beyond yield": of_tougher_cable,
    "bent to just below yield": of_tougher_cable,
    "strands pressed together": lambda: replace(case("strands pressed together"), loads=()),
    "stick slip": lambda: case("pulled with less than friction bears"),
    "snap through of a clamped arch": lambda: case("jump in velocity"),
    "standing on its end": lambda: replace(case("standing on its end"), horizon=1.0),
    "smallest grid": lambda: case("longest grid"),
}


@pytest.mark.parametrize("name", MISSED)
def test_a_motion_that_misses_what_its_case_is_named_for_is_noticed(name: str) -> None:
    premise = CASES[name].premise
    assert premise is not None
    assert not premise(predict(MISSED[name]()))


def held_by_a_point() -> Scene:
    scene = case("two grasps 1 mm apart")
    return replace(scene, grasps=scene.grasps[:1])


def on_a_slippery_table(scene: Scene) -> Scene:
    return replace(scene, environment=replace(scene.environment, table=Table(friction=0.02)))


UNTRUE = {
    "two grasps 1 mm apart": held_by_a_point,
    "stick slip": lambda: on_a_slippery_table(case("stick slip")),
    "twisted past the critical twist": lambda: case("ten turns"),
}


@pytest.mark.parametrize("name", UNTRUE)
def test_an_answer_that_is_not_true_to_its_case_is_noticed(name: str) -> None:
    named = CASES[name]
    assert named.error is not None
    assert named.error(predict(UNTRUE[name]())) > named.within


def test_the_torque_is_that_of_all_the_turns() -> None:
    ten = CASES["ten turns"]
    assert ten.error is not None
    nine = posed(ten)
    first, last = nine.grasps
    assert isinstance(last.path, Move)
    turned = replace(last.path, rotation=0.9 * np.asarray(last.path.rotation))
    assert ten.error(predict(replace(nine, grasps=(first, replace(last, path=turned))))) == pytest.approx(0.1, rel=1e-2)


def test_a_case_that_misses_its_name_or_is_refused_by_another_field_fails() -> None:
    with pytest.raises(AssertionError, match="named for"):
        hold_to(replace(CASES["no gravity"], premise=strands_meet))
    with pytest.raises(AssertionError):
        hold_to(replace(CASES["zero duration"], refused="shape"))


@pytest.mark.parametrize(
    ("name", "effect"), [("falling on an obstacle", "obstacles"), ("strands pressed together", "self_contact")]
)
def test_what_passes_through_something_is_noticed(name: str, effect: str) -> None:
    named = CASES[name]
    assert named.error is not None
    assert named.error(predict(replace(posed(named), effects={effect: "off"}))) > named.within


@pytest.fixture(scope="module")
def lying() -> Prediction:
    """Return the motion of a cable that lies on a table all the time, and is dragged by its end until it rests."""
    return predict(catalogue()["cable dragged along itself"])


def test_what_lies_on_the_table_all_the_time_touches_it_once(lying: Prediction) -> None:
    assert ends_on("table")(lying)
    assert not untouched("table")(lying)
    assert not touches_again("table")(lying)
    assert untouched("obstacles[0]")(lying)


def test_a_straight_elastic_cable_is_not_taken_for_another(lying: Prediction) -> None:
    assert not strands_meet(lying)
    assert not tightens(1.0)(lying)
    assert stays_elastic(lying)
    assert not yields(lying)


def test_what_has_stopped_does_not_slide_on(lying: Prediction) -> None:
    assert comes_to_rest(lying)
    assert not slides_on(lying)
