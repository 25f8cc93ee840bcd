"""The inertia of sections that turn about the cable: its torque, and that twist is simulated where it matters."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dlocore import Cable, Environment, Grasp, Move, Points, Quality, Scene, predict
from dlocore.levels.spin import SHARP, bends_sharply, spin_forces
from dlocore.problem.discretisation import make_grid
from dlocore.problem.problem import pose

LENGTH, RADIUS = 0.3, 0.3 / np.pi
ANGLES = np.linspace(0.0, np.pi, 61)
HALF_RING = np.column_stack([RADIUS * np.sin(ANGLES), RADIUS * (1.0 - np.cos(ANGLES)), 0.0 * ANGLES])


def hose(diameter: float, **changes: Any) -> Scene:
    """Return a soft half ring that is level and held at a point, when it is let go."""
    cable = Cable(
        length=LENGTH, diameter=diameter, linear_density=0.7, bending_stiffness=2e-4, torsional_stiffness=1.3e-4,
        axial_stiffness=5e3,
    )  # fmt: skip
    values: dict[str, Any] = {
        "grasps": (Grasp(u=0.1),),
        "environment": Environment(drag=0.5),
        "horizon": 0.3,
    }
    return Scene(cable=cable, shape=Points(points=HALF_RING), **(values | changes))


def apart(a: Any, b: Any) -> float:
    """Return the largest distance of two predictions, a part of the length."""
    u, t = np.linspace(0.0, LENGTH, 31), np.linspace(0.0, 0.3, 25)
    return float(np.linalg.norm(a.surface.positions(u, t) - b.surface.positions(u, t), axis=-1).max()) / LENGTH


def twist(found: Any) -> Any:
    return next(e for e in found.effects if e.name == "twist")


@pytest.mark.parametrize("clamped", [None, 0.0, 0.5 * LENGTH, LENGTH])
def test_turning_a_half_ring_meets_the_rotary_inertia_of_its_sections(clamped):
    # turned about x by an acceleration, a section turns about its tangent by t.x = cos(u/R), less what one of them, or
    # their mean, is kept from; the work against a turn about x is mu rho^2 times the square of that
    scene = hose(0.01)
    problem = pose(scene)
    grid = make_grid(problem, 65)
    q = grid.start
    about_x = np.cross([1.0, 0.0, 0.0], q)
    f = spin_forces(problem, grid, q, 0.0 * q, about_x, clamped)
    inertia = scene.cable.linear_density * scene.cable.diameter**2 / 8.0
    kept = 0.0 if clamped is None else np.cos(clamped / RADIUS)
    u = np.linspace(0.0, LENGTH, 2001)
    exact = inertia * np.trapezoid((np.cos(u / RADIUS) - kept) ** 2, u)
    assert float((f * about_x).sum()) == pytest.approx(exact, rel=0.02)
    # it is a couple: it moves no centre of mass
    np.testing.assert_allclose(f.sum(axis=0), 0.0, atol=1e-9 * np.abs(f).max())


def test_a_thick_hose_is_simulated_with_twist_and_agrees_with_the_reference():
    scene = hose(0.012)
    found = predict(scene)
    assert found.status == "converged"
    assert twist(found).active
    assert "sharp bends" in twist(found).reason
    judge = predict(replace(scene, quality=Quality(method="reference", target_error=3e-3 * LENGTH)))
    assert judge.status == "converged"
    told = (found.accuracy.error_estimate + judge.accuracy.error_estimate) / LENGTH
    assert apart(found, judge) < told < 5e-3
    without = predict(replace(scene, effects={"twist": "off"}))
    assert "twist is off, though it would move the cable by" in without.message
    assert apart(without, judge) > 0.02


@pytest.mark.parametrize(("diameter", "sharp"), [(0.99 * RADIUS / SHARP, False), (1.01 * RADIUS / SHARP, True)])
def test_a_bend_is_sharp_from_sixteen_diameters_on(diameter, sharp):
    problem = pose(hose(diameter))
    grid = make_grid(problem, 65)
    assert bends_sharply(problem, grid, grid.start[None]) == sharp


def test_a_thin_hose_is_simulated_without_twist():
    assert not twist(predict(hose(4e-4))).active


def test_what_is_left_out_counts_in_the_estimate():
    # a small move, with a bend just sharp enough to be looked at
    scene = hose(0.0062, grasps=(Grasp(u=0.1, path=Move(displacement=(0.0, 0.0, 0.001), duration=0.3)),))
    found = predict(replace(scene, environment=Environment(gravity=(0.0, 0.0, 0.0), drag=0.5)))
    assert not twist(found).active, twist(found)
    assert 0.0 < found.accuracy.neglected < 1e-4 * LENGTH
    assert found.accuracy.error_parts["neglected"] == found.accuracy.neglected
