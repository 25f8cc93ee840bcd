"""A cable that is pressed too deep into something: the message says into what, where along it and when."""

import math
import re
from dataclasses import replace

import pytest

from dlocore import Cylinder, Environment, Grasp, Move, Points, Quality, Scene, Straight, Table, predict
from dlocore.levels.level import run_level
from dlocore.levels.pressed import pressed_into
from dlocore.problem.problem import pose
from dlocore.shape.shape import fit_to_knots, start_curve
from dlocore.solvers.monitor import Monitor
from tests.solver.scenes import arc, cable

FAR = Cylinder(center=(0.0, 0.9, 0.0), radius=0.001, height=0.1)  # met by nothing
THIN = Cylinder(center=(0.5, 0.05, 0.0), radius=0.001, height=0.1)


def test_a_cable_that_is_pulled_taut_around_a_needle_is_told_where_it_is_pressed_into_which() -> None:
    pulls = [
        Grasp(u=u, path=Move(displacement=(aside, 0.45, 0.0), duration=1.0)) for u, aside in ((0.0, 0.02), (1.0, -0.02))
    ]
    scene = Scene(
        cable=cable(bending_stiffness=2e-3), shape=Straight(), grasps=pulls,
        environment=Environment(table=Table(), drag=0.1, obstacles=(FAR, THIN)),
        quality=Quality(n_u=17, n_t=25, estimate=False),
    )  # fmt: skip
    found = predict(scene)
    assert found.status == "stalled"
    told = re.search(
        r"pressed \d+% of its diameter into obstacles\[1\], at u = (\S+) m and (\S+) s\. Press it in less", found.said
    )
    assert told is not None, found.said
    assert float(told[1]) == pytest.approx(0.5, abs=0.01)
    assert 0.1 < float(told[2]) < 1.0


def test_the_table_is_named_where_it_is_what_the_cable_is_in() -> None:
    falling = Scene(
        cable=cable(), shape=Straight(start=(0.0, 0.0, 0.1)), grasps=[Grasp(u=0.0)], horizon=0.1,
        environment=Environment(table=Table(), drag=0.1),
    )  # fmt: skip
    problem = pose(falling)
    motion = run_level(problem, 9, 13, 20, Monitor()).motion
    assert pressed_into(problem, motion) == "the table, an obstacle or itself"  # it is in nothing
    states = motion.states.copy()
    states[7, -1, 2] -= 0.11  # the end, from near 0.1 m
    told = pressed_into(problem, replace(motion, states=states))
    assert told == f"the table, at u = 1 m and {motion.times[7]:.3g} s"


def test_two_strands_that_meet_are_told_by_both_places() -> None:
    wire = cable()
    bent = Scene(
        cable=wire, shape=Points(points=arc(1.0, 3.0, 81)), grasps=[Grasp(u=0.0)], horizon=0.1,
        environment=Environment(gravity=(0.0, 0.0, 0.0), drag=0.1), effects={"self_contact": "on", "twist": "off"},
    )  # fmt: skip
    problem = pose(bent)
    motion = run_level(problem, 17, 13, 20, Monitor()).motion
    states = motion.states.copy()
    circle = start_curve(Points(points=arc(1.0, 6.6, 201)), 1.0)  # which ends on its beginning
    states[5] = problem.plane.points(fit_to_knots(circle, motion.grid.knots))
    words = pressed_into(problem, replace(motion, states=states))
    told = re.fullmatch(r"itself, u = (\S+) m into u = (\S+) m, at (\S+) s", words)
    assert told is not None, words
    assert float(told[2]) - float(told[1]) == pytest.approx(2.0 * math.pi / 6.6, abs=0.01)
    assert float(told[3]) == pytest.approx(motion.times[5], rel=1e-2)
