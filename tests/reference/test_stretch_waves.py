"""Damping of stretch in the reference: that of the closed form, and the same as that of the march."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline
from scipy.spatial.transform import Rotation

from dlocore import ControlPoints, Environment, Grasp, Move, Quality, Scene, Straight, predict
from dlocore.reference.sampling import samples
from tests.reference.rods import WEIGHTLESS, cable, motion
from tests.solver.scenes import apart

EA, MU = 10.0, 0.05
SLOWEST = 0.5 * np.pi * np.sqrt(EA / MU)  # [rad/s] of a cable of 1 m that is held at one end
TILTED = Rotation.from_rotvec([0.3, -0.7, 0.5]).as_matrix()


@pytest.mark.parametrize("turn", [np.eye(3), TILTED], ids=["plane", "space"])
@pytest.mark.parametrize("share", [0.0, 0.3, 3.0], ids=["undamped", "a third of critical", "more than critical"])
def test_a_wave_of_stretch_decays_as_its_mode(share, turn):
    # velocity sin(pi u/2): x'' + 2 b x' + w^2 x = 0 with w = pi/2 sqrt(EA/mu), 2 b = w^2 eta/EA
    u, speed, b = np.linspace(0.0, 1.0, 33), 0.1, share * SLOWEST
    along = make_interp_spline(u, u[:, None] * turn[0], k=3)
    moving = make_interp_spline(u, speed * np.sin(0.5 * np.pi * u)[:, None] * turn[0], k=3)
    scene = Scene(
        cable=cable(bending_stiffness=1.0, axial_stiffness=EA, axial_damping=2.0 * b / SLOWEST**2 * EA),
        shape=ControlPoints(control_points=along.c, knots=along.t, velocity=moving.c),
        grasps=(Grasp(u=0.0),),
        environment=WEIGHTLESS,
        horizon=0.4,
    )
    t = np.linspace(0.0, 0.4, 41)
    found = samples(motion(scene, 40, 1e-8)).positions(t)[:, -1] @ turn[0] - 1.0
    wd = np.sqrt(complex(SLOWEST**2 - b**2))
    exact = (np.exp(-b * t) * np.sin(wd * t) / wd).real * speed
    # a chain of 40 edges is slower by (pi/2)^2/24/40^2 = 6e-5, over 9 rad; steps of 1e-8 m of 4e-3 m
    assert np.abs(found - exact).max() < 1.5e-3 * speed / SLOWEST


@pytest.mark.parametrize("yields", [False, True], ids=["elastic", "yielding"])
def test_reference_and_march_agree_on_a_soft_cable_that_is_jerked(yields):
    law: dict[str, Any] = {"yield_stretch": 0.002, "memory_rate": 20.0} if yields else {}
    jerk = Move(displacement=(0.3, 0.2, 0.0), duration=0.4, profile="linear")
    scene = Scene(
        cable=cable(axial_stiffness=20.0, axial_damping=2.0, **law),
        shape=Straight(),
        grasps=(Grasp(u=1.0, path=jerk),),
        environment=Environment(gravity=(0.0, 0.0, 0.0), drag=0.1),
        effects={"plasticity": "on"} if yields else {},
    )
    found = predict(replace(scene, quality=Quality(target_error=2e-3, method="march")))
    truth = predict(replace(scene, quality=Quality(target_error=1e-3, method="reference")))
    assert found.status == truth.status == "converged", (found.message, truth.message)
    assert apart(found.surface, truth.surface).max() < 3e-3  # both targets
    # a tenth of that damping is another motion, by more than both may be wrong
    weak = replace(scene, cable=replace(scene.cable, axial_damping=0.2))
    other = predict(replace(weak, quality=Quality(target_error=1e-3, method="reference")))
    assert apart(other.surface, truth.surface).max() > 5e-3
