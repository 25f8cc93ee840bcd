"""What a cable that springs away, or is let go, begins with: only what lasts for a step (docs/model.md eq. 13a)."""

from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.choices import GENERAL, SPRINGS, sprung
from benchmarks.hard.generator import draw
from dlocore import Prediction, Quality, predict
from tests.solver.scenes import Floats, march


def positions(found: Prediction) -> Floats:
    return found.surface.positions(np.linspace(0.0, 1.0, 65), np.linspace(0.0, SPRINGS, 41))


@pytest.mark.parametrize("path", ["in one call", "general", "twist"])
def test_more_control_points_do_not_hold_a_rod_back_that_springs_straight(path):
    scene = sprung(march(41, 61))
    if path == "twist":
        scene = replace(scene, effects={**scene.effects, "twist": "on"})
    with GENERAL if path == "general" else nullcontext():
        few, many = (predict(replace(scene, quality=march(n, 61)), keep_grid=True) for n in (41, 129))
    # 40 mm with all of the acceleration of its start
    assert np.linalg.norm(positions(few) - positions(many), axis=-1).max() < 1e-4


def test_a_rod_springs_straight_as_the_reference_says():
    found = predict(sprung(Quality(target_error=2e-3)))
    known = predict(sprung(Quality(method="reference", target_error=5e-3)))
    assert found.status == known.status == "converged"
    assert found.accuracy.error_estimate is not None
    assert known.accuracy.error_estimate is not None
    away = np.linalg.norm(positions(found) - positions(known), axis=-1).max()
    assert away < found.accuracy.error_estimate + known.accuracy.error_estimate


def test_a_stiff_arc_that_springs_open_converges():
    # a random scene, 30:703, of which every finer grid was 1 cm from the one before
    found = predict(draw(30, 703).make())
    assert found.status == "converged"
    assert found.accuracy.n_u < 100
