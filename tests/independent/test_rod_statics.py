"""Exact equilibria of the explicit discrete elastic rod."""

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline
from scipy.optimize import brentq

from benchmarks.rod import equilibrium, simulate
from dlocore.scene.cable import Cable
from dlocore.scene.scene import ControlPoints, Environment, Grasp, Load, Points, Scene, Straight, Table

WEIGHTLESS = Environment(gravity=(0.0, 0.0, 0.0))
CABLE = Cable(length=1.0, diameter=0.01, linear_density=0.05, bending_stiffness=1e-3, axial_stiffness=100.0)


def settled(scene: Scene, elements: int) -> tuple[np.ndarray, np.ndarray]:
    """Equilibrium extrapolated to h -> 0, at the nodes of the coarse rod."""
    u, coarse = equilibrium(scene, elements=elements)
    return u, (4.0 * equilibrium(scene, elements=2 * elements)[1][::2] - coarse) / 3.0


@pytest.mark.parametrize("force", [(0.0, 3e-6, 0.0), (0.0, 1e-6, 2e-6)], ids=["plane", "space"])
def test_small_cantilever_bends_by_p_l3_over_3_ei(force):
    grasps = (Grasp(u=0.0, hold="tangent"),)
    loads = (Load(u=1.0, force=force),)
    scene = Scene(cable=CABLE, shape=Straight(), grasps=grasps, loads=loads, environment=WEIGHTLESS, horizon=1.0)
    exact = np.array(force) / (3 * 1e-3)
    _, raw = equilibrium(scene, elements=20)
    # the rod sums its hinges by the trapezoidal rule: P L^3/(3 EI) (1 + h^2/(2 L^2)); slope^2 ~ 2e-6 is neglected
    np.testing.assert_allclose(raw[-1, 1:], exact[1:] * (1 + 0.5 / 20**2), rtol=2e-6)
    _, limit = settled(scene, 20)
    np.testing.assert_allclose(limit[-1, 1:], exact[1:], rtol=2e-6)  # the same neglected term


def test_a_direction_held_inside_is_a_wall_for_both_sides():
    cable_grasp = Grasp(u=0.4, hold="tangent")
    loads = (Load(u=0.0, force=(0.0, 4e-6, 0.0)), Load(u=1.0, force=(0.0, 3e-6, 0.0)))
    scene = Scene(
        cable=CABLE, shape=Straight(), grasps=(cable_grasp,), loads=loads, environment=WEIGHTLESS, horizon=1.0
    )
    _, x = settled(scene, 20)
    assert x[0, 1] == pytest.approx(4e-6 * 0.4**3 / 3e-3, rel=2e-6)  # neglected: slope^2 ~ 1e-7
    assert x[-1, 1] == pytest.approx(3e-6 * 0.6**3 / 3e-3, rel=2e-6)


def test_hanging_cable_without_stiffness_is_the_elastic_catenary():
    weight, EA, span = 0.05 * 9.81, 100.0, 0.8
    half = 0.5

    def reach(H: float, s: float) -> float:
        return H * s / EA + H / weight * np.arcsinh(weight * s / H)

    H = brentq(lambda h: 2 * reach(h, half) - span, 1e-3, 10.0)
    s = np.linspace(-half, half, 41)
    x = reach(H, s) + span / 2
    z = weight * s**2 / (2 * EA) + np.hypot(H, weight * s) / weight
    z -= z[0]

    # a start near the equilibrium: the parabola of the same ends, 1 m long
    grid = np.linspace(0.0, span, 9)
    parabola = np.column_stack([grid, 0 * grid, 1.6 * grid * (grid - span)])
    cable = Cable(length=1.0, diameter=0.01, linear_density=0.05, bending_stiffness=1e-9, axial_stiffness=EA)
    knots = np.concatenate([np.zeros(3), np.linspace(0.0, 1.0, 7), np.ones(3)])
    scene = Scene(
        cable=cable,
        shape=ControlPoints(control_points=parabola, knots=knots),
        grasps=(Grasp(u=0.0), Grasp(u=1.0)),
        horizon=1.0,
    )
    _, found = settled(scene, 40)
    # EI/(H L^2) = 5e-9 neglected; h^4 = 4e-7 remains of the discretisation, with a factor below 1
    np.testing.assert_allclose(found, np.column_stack([x, 0 * x, z]), atol=2e-7)


def test_a_cable_that_is_curved_at_rest_stays_as_it_starts():
    u = np.linspace(0.0, 1.0, 17)
    arc = make_interp_spline(u, np.column_stack([np.sin(2 * u), 1.0 - np.cos(2 * u), 0 * u]) / 2.0, k=3)
    cable = Cable(
        length=1.0,
        diameter=0.01,
        linear_density=0.05,
        bending_stiffness=1e-3,
        axial_stiffness=10.0,
        rest_shape="initial",
    )
    grasps = (Grasp(u=0.5, hold="tangent"),)
    scene = Scene(
        cable=cable,
        shape=ControlPoints(control_points=arc.c, knots=arc.t),
        grasps=grasps,
        environment=WEIGHTLESS,
        horizon=0.2,
    )
    u, rest = equilibrium(scene, elements=20)
    start = simulate(scene, elements=20, times=[0.0, 0.2])[2][0]

    def turns(r: np.ndarray) -> np.ndarray:
        heading = np.arctan2(*np.diff(r[:, 1::-1], axis=0).T)
        return np.diff(heading)

    np.testing.assert_allclose(turns(rest), turns(start), atol=1e-7)  # settled to 1e-10 of the length
    np.testing.assert_allclose(np.linalg.norm(np.diff(rest, axis=0), axis=1), np.diff(u), rtol=1e-7)


@pytest.mark.parametrize(
    "wrong",
    [
        {"shape": Points(points=np.linspace((0, 0, 0), (1, 0, 0), 5))},
        {"environment": Environment(table=Table())},
        {"effects": {"inertia": "off"}},
        {"cable": Cable.preset("paper", rest_shape=np.linspace((0, 0, 0), (1, 0, 0), 4))},
    ],
    ids=["points", "table", "no inertia", "rest shape"],
)
def test_what_is_not_modelled_is_refused(wrong):
    scene = Scene(**{"cable": CABLE, "shape": Straight(), "horizon": 0.1, **wrong})
    with pytest.raises(ValueError, match="explicit rod"):
        simulate(scene, elements=10)
