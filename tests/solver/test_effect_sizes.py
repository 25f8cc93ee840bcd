"""How large an effect was is its largest value anywhere in the motion, however narrow the peak is."""

from dataclasses import replace

import numpy as np
import pytest

from dlocore import Grasp, Move, predict
from tests.solver.scenes import cable, march, paper_scene


def test_reported_sizes_of_bend_and_damping_are_the_largest_of_the_motion() -> None:
    turned = Move(displacement=(0.0, 0.2, 0.0), rotation=(0.0, 0.0, 1.0), duration=1.0)
    scene = paper_scene(0.36, quality=march(25, 37))
    limp = cable(bending_stiffness=1e-4, bending_damping=1e-5)
    grasp = Grasp(u=0.36, hold="tangent", path=turned)
    prediction = predict(replace(scene, cable=limp, grasps=(grasp,), horizon=None))
    u, t = np.linspace(0.0, 1.0, 1001), np.linspace(0.0, prediction.surface.horizon, 1001)
    curvature = prediction.surface.curvature(u, t)
    sizes = {effect.name: effect.magnitude for effect in prediction.effects}
    assert sizes["bend"] == pytest.approx(1e-4 * curvature.max(), rel=0.01)
    assert sizes["damping"] == pytest.approx(1e-5 * np.abs(np.gradient(curvature, t, axis=0)).max(), rel=0.02)
