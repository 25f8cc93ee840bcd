"""Exact equilibria of the reference's rods."""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from dlocore import Grasp, Load, Move, Points, Scene, Straight
from tests.reference.rods import WEIGHTLESS, cable, equilibrium, motion

TILTED = Rotation.from_rotvec([0.3, -0.7, 0.5]).as_matrix()
STIFF = {"axial_stiffness": 1e4}
# shortening u/L and deflection w/L of a cantilever under a = P L^2/EI, from elliptic integrals
ELASTICA = [(1.0, 0.05643, 0.30172), (3.0, 0.25442, 0.60325), (10.0, 0.55500, 0.81061)]


@pytest.mark.parametrize(("a", "shortening", "deflection"), ELASTICA)
def test_large_cantilever_bends_as_the_elastica(a, shortening, deflection):
    force = TILTED @ [0.0, a * 1e-3, 0.0]
    scene = Scene(
        cable=cable(**STIFF),
        shape=Straight(direction=TILTED[:, 0]),
        grasps=(Grasp(u=0.0, hold="tangent"),),
        loads=(Load(u=1.0, force=force),),
        environment=WEIGHTLESS,
        horizon=1.0,
    )
    tip = equilibrium(scene, 20)[-1] @ TILTED
    # five digits are tabled; of the discretisation h^4 a^2 = 6e-6 a^2 remains, with a factor near a tenth
    np.testing.assert_allclose(tip, [1.0 - shortening, deflection, 0.0], atol=1e-5 + 6e-7 * max(a, 5.0) ** 2)


def test_hanging_cable_without_stiffness_is_the_elastic_catenary():
    weight, EA = 0.05 * 9.81, 100.0
    grid = np.linspace(0.0, 0.8, 41)
    scene = Scene(
        cable=cable(bending_stiffness=1e-9, axial_stiffness=EA),
        shape=Points(points=np.column_stack([grid, 0 * grid, 1.6 * grid * (grid - 0.8)])),
        grasps=(Grasp(u=0.0), Grasp(u=1.0)),
        horizon=1.0,
    )
    found = equilibrium(scene, 40)
    span = found[-1, 0] - found[0, 0]  # the fit of the points leaves its ends near those given

    def reach(H, s):
        return H * s / EA + H / weight * np.arcsinh(weight * s / H)

    H = brentq(lambda h: 2 * reach(h, 0.5) - span, 1e-3, 10.0)
    s = np.linspace(-0.5, 0.5, 41)
    x = reach(H, s) + span / 2
    z = weight * s**2 / (2 * EA) + np.hypot(H, weight * s) / weight
    # EI/(H L^2) = 5e-9 neglected; h^4 = 4e-7 remains of the discretisation, with a factor below 1
    np.testing.assert_allclose(found - found[0], np.column_stack([x, 0 * x, z - z[0]]), atol=3e-7)


@pytest.mark.parametrize("turn", [np.eye(3), TILTED], ids=["plane", "space"])
def test_a_cable_with_the_natural_shape_of_a_circle_rolls_up(turn):
    phi = np.linspace(0.0, 1.9 * np.pi, 241)
    radius = 1.0 / (1.9 * np.pi)
    circle = radius * np.column_stack([np.sin(phi), 1.0 - np.cos(phi), 0 * phi])
    u = np.linspace(0.0, 1.0, 61)
    bent = 0.5 * np.column_stack([np.sin(2 * u), 1.0 - np.cos(2 * u), 0 * u])
    scene = Scene(
        cable=cable(rest_shape=circle @ turn.T, **STIFF),
        shape=Points(points=bent @ turn.T),
        grasps=(Grasp(u=0.0, hold="tangent"),),
        environment=WEIGHTLESS,
        horizon=1.0,
    )
    tip = equilibrium(scene, 20)[-1]
    # the points of both shapes are fitted; a discrete circle closes to h^4
    np.testing.assert_allclose(tip, circle[-1] @ turn.T, atol=5e-4)


def test_a_straight_cable_carries_gj_theta_over_l_and_buckles_beyond_greenhills_twist():
    """The moment is GJ theta/L; clamped without tension it buckles at M = 8.9868 EI/L.

    The cable is soft along itself, as its ends do not come nearer when it buckles.
    """
    sideways = {}
    for share in (0.9, 1.1):
        theta = share * 8.9868  # GJ = EI
        turn = Move(displacement=(0.0, 0.0, 0.0), duration=2.0, rotation=(theta, 0.0, 0.0))
        made = cable(torsional_stiffness=1e-3, bending_damping=1e-5, torsional_damping=1e-5, axial_stiffness=1.0)
        scene = Scene(
            cable=made,
            shape=Straight(),
            grasps=(Grasp(u=0.0, hold="clamp"), Grasp(u=1.0, hold="clamp", path=turn)),
            loads=(Load(u=0.5, force=[[0, 1e-6, 0], [0, 1e-6, 0]], times=[0.0, 2.0]),),
            environment=type(WEIGHTLESS)(gravity=(0, 0, 0), drag=0.2),
            horizon=12.0,
        )
        found = motion(scene, 20, 1e-5)
        moment = found.moments[:, -1, 0]
        if share < 1.0:
            np.testing.assert_allclose(moment, [-1e-3 * theta, 1e-3 * theta], rtol=2e-3)  # it bends by a millimetre
        sideways[share] = float(np.abs(found.states[-1].x[:, 1:]).max())
    # below, the load of 1e-6 N bends it by P L^3/(192 EI) = 5e-6 m, ten times that so near to buckling
    assert sideways[0.9] < 1e-4
    assert sideways[1.1] > 1e-2
