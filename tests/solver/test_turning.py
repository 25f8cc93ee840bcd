"""Starts that nothing holds from turning as they settle are told of."""

from typing import Any

import numpy as np
import pytest

from dlocore import Cable, Environment, Grasp, Points, Scene, predict
from dlocore.problem.problem import pose
from dlocore.statics.turning import turns_freely

WEIGHTLESS = Environment(gravity=(0.0, 0.0, 0.0))
S = np.linspace(0.0, 1.0, 41)
HELIX = np.column_stack([0.15 * np.sin(4.0 * S), 0.15 * np.cos(4.0 * S), 0.8 * S])
ARC = np.column_stack([0.3 * np.sin(3.0 * S), 0.0 * S, 0.3 * np.cos(3.0 * S)])


def scene(points: Any, *held: float, hold: str = "point", settle: bool = True, **changes: Any) -> Scene:
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    cable = Cable(length=length, diameter=0.005, linear_density=0.05, bending_stiffness=0.01)
    grasps = tuple(Grasp(u=share * length, hold=hold) for share in held)
    values: dict[str, Any] = {"horizon": 0.5, "environment": Environment()}
    return Scene(cable=cable, shape=Points(points=points, settle=settle), grasps=grasps, **(values | changes))


@pytest.mark.parametrize(
    ("posed", "about"),
    [
        (scene(HELIX, 0.4), "the vertical through its grasp"),
        (scene(HELIX, 0.4, environment=WEIGHTLESS), "its grasp"),
        (scene(ARC, 0.4, environment=WEIGHTLESS), "its grasp"),
        (scene(HELIX, 0.0, 1.0, environment=WEIGHTLESS), "the line through its grasps"),
        (scene(HELIX, 0.0, 1.0), ""),  # not above each other
        (scene(HELIX, 0.0, 0.5, 1.0, environment=WEIGHTLESS), ""),
        (scene(HELIX, 0.4, hold="tangent"), ""),
        (scene(HELIX, 0.4, settle=False), ""),
        (scene(ARC, 0.4), ""),  # in a vertical plane
        (scene(np.column_stack([S, 0.0 * S, 0.0 * S]), 0.4, environment=WEIGHTLESS), ""),
    ],
)
def test_what_a_start_may_turn_about(posed, about):
    assert turns_freely(pose(posed)) == about


def test_the_message_tells_of_a_start_that_turned():
    found = predict(scene(HELIX, 0.4))
    assert found.status == "converged", found.message
    assert "nothing keeps the start from turning about the vertical through its grasp" in found.message


def test_and_not_of_one_that_was_at_rest():
    # its stress-free shape is the given one, so that without weight it stays
    stays = scene(HELIX, 0.4, environment=WEIGHTLESS)
    cable = Cable(
        length=stays.cable.length, diameter=0.005, linear_density=0.05, bending_stiffness=0.01, rest_shape="initial"
    )
    found = predict(Scene(cable=cable, shape=stays.shape, grasps=stays.grasps, environment=WEIGHTLESS, horizon=0.5))
    assert "nothing holds" not in found.message
