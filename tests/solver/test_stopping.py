"""A cable that is thrown, and that drag stops within a time step or a few."""

from typing import Any

import numpy as np
import pytest

from dlocore import Cable, Environment, Prediction, Quality, Scene, Straight, predict
from tests.solver.scenes import Floats, G

THROWN = np.array([1.0, 0.5, 2.0])  # [m/s]


def scene(drag: float, density: float, **rest: Any) -> Scene:
    """Return the scene of a cable that flies as one."""
    cable = Cable(length=1.0, diameter=0.005, linear_density=density, bending_stiffness=1e-3)
    shape = Straight(velocity=THROWN)
    return Scene(**{"cable": cable, "shape": shape, "environment": Environment(drag=drag), "horizon": 5.0, **rest})


def off(found: Prediction) -> float:
    """Return how far a prediction is from the motion of a point with drag [m]."""
    t = np.linspace(0.0, found.surface.horizon, 501)
    lasts = found.scene.cable.linear_density / found.scene.environment.drag
    falls = lasts * np.array([0.0, 0.0, -G])
    way: Floats = falls * t[:, None] + lasts * (THROWN - falls) * (1.0 - np.exp(-t / lasts))[:, None]
    return float(np.linalg.norm(found.surface.positions([0.5], t)[:, 0] - [0.5, 0.0, 0.0] - way, axis=1).max())


@pytest.mark.parametrize("twist", ["auto", "on"])
def test_a_velocity_that_drag_stops_at_once_takes_no_fine_steps(twist: Any) -> None:
    # within 2e-6 s: it took 12,800 steps to come down to an estimate of 7 mm
    found = predict(scene(500.0, 1e-3, effects={"twist": twist}))
    assert found.status == "converged", found.message
    assert found.accuracy.steps < 1000
    assert off(found) < 2e-3  # what is aimed at


@pytest.mark.parametrize("method", ["march", "spacetime"])
def test_the_way_of_a_velocity_that_steps_do_not_follow_counts_in_the_estimate(method: Any) -> None:
    # it goes 4.6 mm within some ms, where steps are of 30
    found = predict(scene(5.0, 1e-2, quality=Quality(n_u=9, n_t=33, method=method, keep_grid=True)))
    assert found.status == "converged", found.message
    assert 1e-3 < off(found) < (found.accuracy.error_estimate or 0.0) < 0.01
