"""Exact motions of the reference's rods, and how fast they converge."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from benchmarks.hard.generator import draw
from benchmarks.hard.laws import measure
from dlocore import ControlPoints, Environment, Grasp, Load, Move, Points, Quality, Scene, Straight, predict
from dlocore.reference.chain import chain, grip
from dlocore.reference.energy import energies
from dlocore.reference.sampling import samples
from tests.reference.rods import WEIGHTLESS, cable, motion

EI, MU = 1e-3, 0.05
TILTED = Rotation.from_rotvec([0.3, -0.7, 0.5]).as_matrix()


def extrapolated(scene, elements, tolerance, t):
    coarse, fine = (samples(motion(scene, elements, tolerance, k)).positions(t) for k in (0, 1))
    return (4.0 * fine[:, ::2] - coarse) / 3.0


@pytest.mark.parametrize("turn", [np.eye(3), TILTED], ids=["plane", "space"])
@pytest.mark.parametrize("relaxation", [0.0, 0.05], ids=["undamped", "damped"])
def test_cantilever_vibrates_and_decays_as_its_first_mode(turn, relaxation):
    # y'' + 2 b y' + w^2 y = 0 with w = beta^2 sqrt(EI/mu), 2 b = w^2 eta/EI
    beta = brentq(lambda b: np.cos(b) * np.cosh(b) + 1.0, 1.5, 2.2)
    u, amplitude = np.linspace(0.0, 1.0, 25), 1e-3
    mix = (np.cosh(beta) + np.cos(beta)) / (np.sinh(beta) + np.sin(beta))
    y = np.cosh(beta * u) - np.cos(beta * u) - mix * (np.sinh(beta * u) - np.sin(beta * u))
    spline = make_interp_spline(u, np.column_stack([u, amplitude * y / y[-1], 0 * u]) @ turn.T, k=3)
    w = beta**2 * np.sqrt(EI / MU)
    b = 0.5 * w**2 * relaxation
    wd = np.sqrt(w**2 - b**2)
    t = np.linspace(0.0, 2 * np.pi / w, 33)
    scene = Scene(
        cable=cable(bending_damping=EI * relaxation),
        shape=ControlPoints(control_points=spline.c, knots=spline.t),
        grasps=(Grasp(u=0.0, hold="tangent"),),
        environment=WEIGHTLESS,
        horizon=float(t[-1]),
    )
    found = (extrapolated(scene, 20, 1e-9, t)[:, -1] @ turn)[:, 1] / amplitude
    exact = np.exp(-b * t) * (np.cos(wd * t) + b / wd * np.sin(wd * t))
    # 24 spline pieces for the shape of the mode, h^4 of it, and axial motion of the order of the amplitude squared
    np.testing.assert_allclose(found, exact, atol=1e-3)


@pytest.mark.parametrize("hold", ["point", "tangent"])
def test_the_error_falls_as_the_square_of_the_spacing_and_extrapolated_faster(hold):
    path = Move(displacement=(0.0, 0.3, 0.0), duration=1.0)
    around = Environment(gravity=(0.0, 0.0, 0.0), drag=0.1)
    scene = Scene(cable=cable(), shape=Straight(), grasps=(Grasp(u=0.25, hold=hold, path=path),), environment=around)
    t = np.linspace(0.0, 1.0, 11)
    levels = [samples(motion(scene, 20, 5e-8, k)).positions(t)[:, :: 2**k] for k in range(4)]
    changes = [np.abs(a - b).max() for a, b in pairwise(levels)]
    assert 1.8 < np.log2(changes[1] / changes[2]) < 2.2
    limits = [(4.0 * b - a) / 3.0 for a, b in pairwise(levels)]
    better = [np.abs(a - b).max() for a, b in pairwise(limits)]
    # four in the limit, where the force of the grasp does not let r''' jump
    assert 2.8 < np.log2(better[0] / better[1]) < 4.5


def test_the_error_in_time_falls_with_the_tolerance():
    path = Move(displacement=(0.0, 0.3, 0.0), duration=1.0)
    around = Environment(gravity=(0.0, 0.0, 0.0), drag=0.1)
    scene = Scene(cable=cable(), shape=Straight(), grasps=(Grasp(u=0.25, path=path),), environment=around)
    t = np.linspace(0.0, 1.0, 11)
    exact = samples(motion(scene, 20, 1e-10)).positions(t)
    errors = [np.abs(samples(motion(scene, 20, tolerance)).positions(t) - exact).max() for tolerance in (1e-5, 1e-7)]
    # about in proportion to the error of a step
    assert errors[1] < errors[0] / 20
    assert errors[0] < 100 * 1e-5  # of some 50 steps


def test_the_errors_of_the_steps_add_up_to_no_more_than_their_sum():
    # a cable that hardly stretches, dragged off and released: what a step leaves of error in the velocity goes on
    scene = Scene(
        cable=cable(linear_density=0.04, bending_stiffness=0.02, bending_damping=2e-3, axial_stiffness=4e6),
        shape=Straight(),
        grasps=(Grasp(u=0.25, path=Move(displacement=(0.4, 0.0, 0.0), duration=0.6), release_time=0.3),),
        environment=Environment(),
        horizon=0.9,
    )
    t, tolerance = np.linspace(0.0, 0.9, 19), 1e-6
    exact = samples(motion(scene, 20, 1e-2 * tolerance, 1)).positions(t)
    found = motion(scene, 20, tolerance, 1)
    assert np.linalg.norm(samples(found).positions(t) - exact, axis=-1).max() < found.steps * tolerance


@pytest.mark.parametrize("turn", [np.eye(3), TILTED], ids=["plane", "space"])
def test_a_swing_keeps_its_energy(turn):
    scene = Scene(
        cable=cable(axial_stiffness=50.0, axial_damping=0.0),
        shape=Straight(direction=turn[:, 0]),
        grasps=(Grasp(u=0.0, hold="tangent"),),
        environment=Environment(gravity=turn @ [0.0, -9.81, 0.0]),
        horizon=0.5,
    )
    found = motion(scene, 20, 1e-7)
    link = chain(found.rod, (grip(found.rod, scene.grasps[0], found.rod.start),), 0.0, 0.5)
    energy = []
    for now in found.states:
        fall = -(link.body.weight[:, :3] * now.x[link.node_of]).sum()
        energy.append(sum(energies(link.body, link.state(now))) + fall)
    lost = (np.array(energy) - energy[0]) / (9.81 * MU * 0.5)  # of the energy of the whole fall
    # the steps damp the waves they do not resolve: a part of the energy that stretch has, 5e-3 of the whole
    assert lost.max() < 1e-4
    assert lost.min() > -3e-3
    assert (found.states[-1].x[-1] @ found.rod.axes @ turn)[1] < -0.3  # it did swing


@pytest.mark.parametrize(("linear", "quadratic"), [(0.1, 0.0), (0.0, 0.2), (0.1, 0.2)])
def test_a_drifting_cable_is_braked_by_drag(linear, quadratic):
    v0 = np.array([0.3, 2.0, -0.6])
    scene = Scene(
        cable=cable(),
        shape=Straight(velocity=v0),
        environment=Environment(gravity=(0, 0, 0), drag=linear, drag_quadratic=quadratic),
        horizon=1.0,
    )
    taken = samples(motion(scene, 10, 1e-7))
    speed = np.linalg.norm(v0)
    if quadratic == 0.0:
        way = MU / linear * (1 - np.exp(-linear / MU)) * speed
    elif linear == 0.0:
        way = MU / quadratic * np.log1p(quadratic * speed / MU)
    else:
        way = MU / quadratic * np.log1p(quadratic * speed / linear * (1 - np.exp(-linear / MU)))
    exact = taken.u[:, None] * np.array([1.0, 0.0, 0.0]) + way * v0 / speed
    np.testing.assert_allclose(taken.x[-1], exact, atol=3e-6)  # some 30 steps to 1e-7


def test_motion_in_space_is_that_in_the_plane():
    def scene(turn, switch):
        path = Move(displacement=turn @ [0, 0.3, 0], duration=0.5, rotation=turn @ [0, 0, 1])
        later = Move(displacement=turn @ [-0.1, 0.2, 0], duration=0.5)
        return Scene(
            cable=cable(bending_damping=1e-5),
            shape=Straight(direction=turn[:, 0]),
            grasps=(
                Grasp(u=0.25, hold="tangent", path=path),
                Grasp(u=0.8, path=later, grasp_time=0.1, release_time=0.4),
            ),
            loads=(Load(u=0.6, force=turn @ [0, 0.02, 0]),),
            environment=Environment(gravity=turn @ [0, -9.81, 0], drag=0.05, drag_quadratic=0.1),
            effects={"twist": switch},
            horizon=0.6,
        )

    t = np.linspace(0.0, 0.6, 13)
    planar = motion(scene(np.eye(3), "auto"), 10, 1e-7)
    spatial = motion(scene(TILTED, "on"), 10, 1e-7)
    assert planar.rod.planar
    assert not spatial.rod.planar
    found = samples(spatial).positions(t) @ TILTED
    np.testing.assert_allclose(found, samples(planar).positions(t), atol=2e-5)  # some 100 steps to 1e-7, each its own


@pytest.mark.parametrize("hold", ["point", "tangent", "clamp"])
def test_nodes_follow_the_grippers_exactly(hold):
    turn = None if hold == "point" else np.array([0.3, 0.4, 0.9])
    path = Move(displacement=(0.1, 0.2, -0.1), duration=1.0, rotation=turn)
    scene = Scene(
        cable=cable(bending_stiffness=0.1, torsional_damping=1e-4),
        shape=Points(points=np.column_stack([np.linspace(0, 0.95, 30), 0.15 * np.sin(np.linspace(0, 3, 30))])),
        grasps=(Grasp(u=0.37, hold=hold, path=path),),
        environment=Environment(drag=0.3),
    )
    found = motion(scene, 10, 1e-4)
    taken = samples(found)
    node = found.rod.node(0.37)
    exact = path.at(taken.times, found.rod.problem.start(0.37)[0])
    np.testing.assert_allclose(taken.x[:, node], exact, atol=1e-12)  # rounding
    if hold != "point":
        tangent = path.rotation_at(taken.times[-1:])[0] @ found.rod.problem.start(0.37, 1)[0]
        beside = 0.5 * (found.states[-1].t[node - 1] + found.states[-1].t[node]) @ found.rod.axes
        # kappa^2 h^2/2 of the bend of the weight, mu g L^2/(2 EI) = 2.5 1/m over 0.1 m, and of the start
        np.testing.assert_allclose(beside, tangent / np.linalg.norm(tangent), atol=0.05)


def test_grasps_close_where_the_cable_is_and_leave_it_free_when_they_open():
    grasps = (
        Grasp(u=0.25, path=Move(displacement=(0.0, 0.1, 0.0), duration=0.3), release_time=0.2),
        Grasp(u=0.6, hold="tangent", grasp_time=0.3),
    )
    scene = Scene(cable=cable(), shape=Straight(), grasps=grasps, horizon=0.45)
    found = motion(scene, 20, 1e-6)
    taken = samples(found)
    x = 0.2 / 0.3
    r = taken.positions(np.array([0.2, 0.3, 0.45]))
    np.testing.assert_allclose(r[0, 5], [0.25, 0.1 * x**3 * (10 - 15 * x + 6 * x**2), 0.0], atol=1e-12)
    np.testing.assert_allclose(r[2, 12], r[1, 12], atol=1e-12)
    free = (taken.times > 0.2) & (taken.times < 0.3)
    mass = np.append(np.append(0.5, np.ones(19)), 0.5) / 20
    momentum = np.einsum("n,tnd->td", mass, taken.v[free])
    gained = np.diff(momentum, axis=0) / np.diff(taken.times[free])[:, None]
    np.testing.assert_allclose(gained, np.broadcast_to([0.0, 0.0, -9.81], gained.shape), atol=1e-5)  # Newton's leavings


@pytest.mark.parametrize("index", [66, 226])
def test_coarse_steps_of_a_stiff_cable_keep_the_momentum(index: int) -> None:
    # a half and three quarters of the impulses had been missing, at 0.1 % of the length from the march
    scene = draw(34, index).make()
    found = predict(replace(scene, quality=Quality(method="reference", target_error=3e-3 * scene.cable.length)))
    assert found.status == "converged"
    assert found.accuracy.steps < 200
    laws = measure(found)
    assert laws.momentum is not None
    assert laws.momentum < 0.05


def test_what_grippers_give_is_what_the_cable_gains():
    """The forces of two grippers, integrated over time, are the change of momentum less the weight."""
    grasps = (Grasp(u=0.0, hold="tangent"), Grasp(u=1.0, path=Move(displacement=(-0.2, 0.1, 0.1), duration=0.8)))
    scene = Scene(cable=cable(), shape=Straight(), grasps=grasps)
    found = motion(scene, 20, 1e-6)
    taken = samples(found)
    mass = MU * np.append(np.append(0.5, np.ones(19)), 0.5) / 20
    momentum = np.einsum("n,nd->d", mass, taken.v[-1] - taken.v[0])
    given = np.trapezoid(found.forces.sum(axis=0), found.given_times, axis=0) + MU * np.array([0, 0, -9.81]) * 0.8
    np.testing.assert_allclose(given, momentum, atol=2e-3)  # of 0.4 N s of weight; the trapezoidal rule over the steps
