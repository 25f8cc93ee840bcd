"""Scenes in which a cable is too short for what is in its way: the judge finds them out, and nothing else."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.hard.generator import draw
from benchmarks.hard.judge import TOO_SHORT, run
from benchmarks.hard.taut import words_if_too_short
from dlocore import Cable, Capsule, Environment, Grasp, Move, Points, Quality, Scene, predict


def pulled_down_over_a_bar(by: float) -> Scene:
    """Return a cable over a bar, whose ends come down beside it by so much [m]."""
    turn = np.linspace(np.pi, 0.0, 81)
    points = np.column_stack([np.cos(turn), 0.0 * turn, np.sin(turn)]) / np.pi
    bar = Capsule(start=(0.0, -0.3, 0.0), end=(0.0, 0.3, 0.0), radius=0.02)
    down = Move(displacement=(0.0, 0.0, -by), duration=1.0)
    return Scene(
        cable=Cable(length=1.0, diameter=0.006, linear_density=0.05, bending_stiffness=1e-3, axial_stiffness=1e5),
        shape=Points(points=points),
        grasps=(Grasp(u=0.0, path=down), Grasp(u=1.0, path=down)),
        environment=Environment(drag=0.3, obstacles=(bar,)),
        quality=Quality(target_error=0.01),
    )


def test_what_hangs_over_a_bar_has_length_enough():
    answer = predict(pulled_down_over_a_bar(0.25))
    assert answer.status == "converged"
    assert words_if_too_short(replace(answer, status="stalled"), answer.scene, 20.0) == ""


def test_what_is_pulled_down_farther_than_it_is_long_is_too_short():
    # from the bar to an end at (0.32, -0.38) it is half a metre, and the bar has to be gone around
    answer = predict(pulled_down_over_a_bar(0.38))
    assert answer.status != "converged"
    assert "is stretched by" in words_if_too_short(replace(answer, status="stalled"), answer.scene, 20.0)


@pytest.mark.slow
def test_the_judge_counts_such_a_scene_as_impossible():
    drawn = draw(90, 49064)
    record = run(drawn, 20.0, checked=False)
    assert record["status"] == "stalled"
    assert not record["possible"]
    assert "stretched by" in record["shown"]
    assert record["families"] == (TOO_SHORT, *drawn.families)
    assert record["faults"] == []
