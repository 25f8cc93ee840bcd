"""Exact motions of the explicit discrete elastic rod."""

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from benchmarks.rod import converged, richardson, simulate
from benchmarks.rod_kernel import turning_angle
from dlocore.scene.cable import Cable
from dlocore.scene.paths import Move
from dlocore.scene.scene import ControlPoints, Environment, Grasp, Load, Scene, Straight

WEIGHTLESS = Environment(gravity=(0.0, 0.0, 0.0))
EI, MU = 1e-3, 0.05
TILTED = Rotation.from_rotvec([0.3, -0.7, 0.5]).as_matrix()


def cable(**changes: float) -> Cable:
    values = {"length": 1.0, "diameter": 0.01, "linear_density": MU, "bending_stiffness": EI, "axial_stiffness": 10.0}
    return Cable(**(values | changes))


def clamped_free_mode(turn: np.ndarray, amplitude: float) -> tuple[float, ControlPoints]:
    """beta of the first mode (cos beta cosh beta = -1) and a start of that shape with tip deflection `amplitude`."""
    beta = brentq(lambda b: np.cos(b) * np.cosh(b) + 1.0, 1.5, 2.2)
    u = np.linspace(0.0, 1.0, 25)
    mix = (np.cosh(beta) + np.cos(beta)) / (np.sinh(beta) + np.sin(beta))
    y = np.cosh(beta * u) - np.cos(beta * u) - mix * (np.sinh(beta * u) - np.sin(beta * u))
    spline = make_interp_spline(u, np.column_stack([u, amplitude * y / y[-1], 0 * u]) @ turn.T, k=3)
    return beta, ControlPoints(control_points=spline.c, knots=spline.t)


@pytest.mark.parametrize("turn", [np.eye(3), TILTED], ids=["plane", "space"])
@pytest.mark.parametrize("relaxation", [0.0, 0.05], ids=["undamped", "damped"])
def test_cantilever_vibrates_and_decays_as_its_first_mode(turn, relaxation):
    # y'' + 2 b y' + w^2 y = 0 with w = beta^2 sqrt(EI/mu), 2 b = w^2 eta/EI
    beta, shape = clamped_free_mode(turn, 1e-4)
    w = beta**2 * np.sqrt(EI / MU)
    b = 0.5 * w**2 * relaxation
    wd = np.sqrt(w**2 - b**2)
    times = np.linspace(0.0, 2 * np.pi / w, 33)
    scene = Scene(
        cable=cable(bending_damping=EI * relaxation),
        shape=shape,
        grasps=(Grasp(u=0.0, hold="tangent"),),
        environment=WEIGHTLESS,
        horizon=float(times[-1]),
    )
    _, _, r = richardson(scene, elements=32)
    y = (r[:, -1] @ turn)[:, 1] / 1e-4
    exact = np.exp(-b * times) * (np.cos(wd * times) + b / wd * np.sin(wd * times))
    # remaining: h^4 of the first mode, 24 spline pieces for its shape, and axial waves of amplitude^2
    np.testing.assert_allclose(y, exact, atol=4e-4)


@pytest.mark.parametrize("hold", ["point", "tangent"])
def test_order_of_convergence_is_two_and_above_three_after_extrapolation(hold):
    path = Move(displacement=(0.0, 0.3, 0.0), duration=1.0)
    around = Environment(gravity=(0.0, 0.0, 0.0), drag=0.1)
    scene = Scene(cable=cable(), shape=Straight(), grasps=(Grasp(u=0.25, hold=hold, path=path),), environment=around)
    times = [0.5, 1.0]
    exact = richardson(scene, elements=160, times=times)[2][:, -1]
    plain = [np.linalg.norm(simulate(scene, elements=n, times=times)[2][:, -1] - exact) for n in (20, 40)]
    better = [np.linalg.norm(richardson(scene, elements=n, times=times)[2][:, -1] - exact) for n in (40, 80)]
    assert 1.8 < np.log2(plain[0] / plain[1]) < 2.2
    # four in the limit; the force of the grasp lets r''' jump, and the reference has an error of its own
    assert 3.2 < np.log2(better[0] / better[1]) < 4.5


@pytest.mark.parametrize("hold", ["point", "tangent"])
def test_a_swing_keeps_its_energy(hold):
    g, N, EA, eps = 9.81, 24, 50.0, 1e-6
    moments = np.linspace(0.1, 0.7, 13)
    times = np.sort(np.concatenate([moments - eps, moments, moments + eps]))
    scene = Scene(
        cable=cable(axial_stiffness=EA), shape=Straight(), grasps=(Grasp(u=0.0, hold=hold),), horizon=float(times[-1])
    )
    _, _, r = simulate(scene, elements=N, times=times)
    h = 1.0 / N
    mass = MU * np.append(np.append(h / 2, np.full(N - 1, h)), h / 2)
    drift = []
    for k in range(1, len(times), 3):
        velocity = (r[k + 1] - r[k - 1]) / (2 * eps)
        edges = np.diff(r[k], axis=0)
        heading = np.unwrap(np.arctan2(edges[:, 2], edges[:, 0]))
        energy = 0.5 * mass @ (velocity**2).sum(1) + g * mass @ r[k, :, 2]
        energy += EA / 2 * h * ((np.linalg.norm(edges, axis=1) / h - 1.0) ** 2).sum()
        energy += EI / (2 * h) * (np.diff(heading) ** 2).sum()
        energy += EI / h * heading[0] ** 2 if hold == "tangent" else 0.0
        drift.append(energy / (g * MU * 0.5))
    # of the energy of the whole fall; at 0.8 of its limit a leapfrog lets the axial waves' share waver
    assert np.abs(drift).max() < 2e-3
    assert r[-1, -1, 2] < -0.3  # it did swing


def test_a_rigid_swing_costs_no_bending_damping():
    # a rod too stiff to bend falls as a rigid pendulum: theta'' = -3/2 g/L cos(theta), whatever its damping
    scene = Scene(
        cable=cable(bending_stiffness=20.0, axial_stiffness=4e3, bending_damping=1e-2),
        shape=Straight(),
        grasps=(Grasp(u=0.0),),
        horizon=0.5,
    )
    _, _, r = simulate(scene, elements=10, times=[0.5])
    N = 10
    inertia = (1 + 0.5 / N**2) / 3  # of the lumped masses
    theta, rate, dt = 0.0, 0.0, 1e-4
    for _ in range(5000):
        rate += dt * -0.5 * 9.81 / inertia * np.cos(theta + 0.5 * dt * rate)
        theta += dt * rate
    tip = np.array([np.cos(theta), 0.0, np.sin(theta)])
    np.testing.assert_allclose(r[0, -1], tip, atol=1e-3)  # mu g L^3/(8 EI) = 3e-3 rad of bending, and the midpoint rule


@pytest.mark.parametrize(("linear", "quadratic"), [(0.1, 0.0), (0.0, 0.2), (0.1, 0.2)])
def test_a_drifting_cable_is_braked_by_drag(linear, quadratic):
    scene = Scene(
        cable=cable(),
        shape=Straight(velocity=(0.3, 2.0, -0.6)),
        environment=Environment(gravity=(0, 0, 0), drag=linear, drag_quadratic=quadratic),
        horizon=1.0,
    )
    _, u, r = simulate(scene, elements=20, times=[1.0])
    v0 = np.array([0.3, 2.0, -0.6])
    speed = np.linalg.norm(v0)
    if quadratic == 0.0:
        way = MU / linear * (1 - np.exp(-linear / MU)) * speed
    elif linear == 0.0:
        way = MU / quadratic * np.log1p(quadratic * speed / MU)
    else:
        way = MU / quadratic * np.log1p(quadratic * speed / linear * (1 - np.exp(-linear / MU)))
    exact = u[:, None] * np.array([1.0, 0.0, 0.0]) + way * v0 / speed
    np.testing.assert_allclose(r[0], exact, atol=3e-5)  # steps of 3 ms: (3 ms c/mu)^2 of a way of 1 m, and less


def test_motion_does_not_depend_on_the_orientation_of_space():
    def scene(turn: np.ndarray) -> Scene:
        lift = Move(displacement=turn @ [0, 0.3, 0], duration=0.5, rotation=turn @ [0, 0, 1])
        grasps = (
            Grasp(u=0.25, hold="tangent", path=lift),
            Grasp(u=0.8, path=Move(displacement=turn @ [-0.1, 0.2, 0], duration=0.5), grasp_time=0.1, release_time=0.4),
        )
        around = Environment(gravity=turn @ [0, -9.81, 0], drag=0.05, drag_quadratic=0.1)
        loads = (Load(u=0.6, force=turn @ [0, 0.02, 0]),)
        shape = Straight(direction=turn[:, 0])
        return Scene(cable=cable(), shape=shape, grasps=grasps, loads=loads, environment=around, horizon=0.6)

    planar = simulate(scene(np.eye(3)), elements=20)[2]
    spatial = simulate(scene(TILTED), elements=20)[2]
    assert np.ptp(planar[-1], axis=0).min() == 0.0
    np.testing.assert_allclose(spatial, planar @ TILTED.T, atol=1e-11)  # the same sums in two and three coordinates


def test_damping_of_strong_bending_in_space_is_that_in_the_plane():
    def scene(turn: np.ndarray, eta: float) -> Scene:
        path = Move(displacement=turn @ [0.0, 0.3, 0.0], duration=0.8)
        shape = Straight(direction=turn[:, 0])
        return Scene(
            cable=cable(bending_damping=eta), shape=shape, grasps=(Grasp(u=0.5, path=path),), environment=WEIGHTLESS
        )

    free, planar = (simulate(scene(np.eye(3), eta), elements=32)[2] for eta in (0.0, 1e-4))
    spatial = simulate(scene(TILTED, 1e-4), elements=32)[2] @ TILTED
    effect = np.abs(planar - free).max()
    assert effect > 0.01
    # the same sums, but for the series of phi/|D| where it is small
    assert np.abs(spatial - planar).max() < 1e-4 * effect


def test_turning_angle_is_the_arctangent_to_rounding():
    angles = np.concatenate([np.linspace(-3.1, 3.1, 1001), np.linspace(-0.1, 0.1, 1001)])
    found = [turning_angle(s, c) for s, c in zip(np.sin(angles), np.cos(angles), strict=True)]
    np.testing.assert_allclose(found, angles, rtol=2e-15, atol=1e-15)


@pytest.mark.parametrize("u", [0.0, 0.5, 1.0])
def test_a_turned_grasp_turns_the_cable(u):
    turn = np.array([0.3, 0.4, 1.1])
    grasp = Grasp(u=u, hold="tangent", path=Move(displacement=(0.0, 0.0, 0.0), duration=0.5, rotation=turn))
    around = Environment(gravity=(0.0, 0.0, 0.0), drag=0.5)
    scene = Scene(
        cable=cable(bending_stiffness=0.1), shape=Straight(), grasps=(grasp,), environment=around, horizon=8.0
    )
    _, nodes, r = simulate(scene, elements=10, times=[8.0])
    exact = [u, 0.0, 0.0] + (nodes - u)[:, None] * Rotation.from_rotvec(turn).as_matrix()[:, 0]
    np.testing.assert_allclose(r[0], exact, atol=1e-6)  # exp(-2.5 t/s) of the slowest motion


def test_grasps_close_where_the_cable_is_and_leave_it_free_when_they_open():
    grasps = (
        Grasp(u=0.25, path=Move(displacement=(0.0, 0.1, 0.0), duration=0.3), release_time=0.2),
        Grasp(u=0.6, grasp_time=0.3),
    )
    times = np.array([0.2, 0.2 + 1e-6, 0.3 - 1e-6, 0.3, 0.45])
    scene = Scene(cable=cable(), shape=Straight(), grasps=grasps, horizon=0.45)
    _, _, r = simulate(scene, elements=20, times=times)
    x = 0.2 / 0.3
    np.testing.assert_allclose(r[0, 5], [0.25, 0.1 * x**3 * (10 - 15 * x + 6 * x**2), 0.0], atol=1e-12)
    mass = np.append(np.append(0.5, np.ones(19)), 0.5) / 20
    centre = np.einsum("n,tnd->td", mass, r)
    # in free flight only gravity moves the centre
    gained = (centre[3] - centre[2] - centre[1] + centre[0]) / 1e-6
    np.testing.assert_allclose(gained, [0.0, 0.0, -9.81 * 0.1], atol=1e-4)  # differences over 1 us
    np.testing.assert_allclose(r[4, 12], r[3, 12], atol=1e-12)


def test_converged_meets_its_tolerance_and_says_when_it_did_not():
    path = Move(displacement=(0.0, 0.3, 0.0), duration=0.8)
    around = Environment(gravity=(0, 0, 0), drag=0.1)
    scene = Scene(cable=cable(), shape=Straight(), grasps=(Grasp(u=0.25, path=path),), environment=around)
    loose, tight = converged(scene, 1e-3), converged(scene, 1e-5)
    error = np.linalg.norm(loose.positions - tight.positions, axis=-1).max()
    assert loose.tolerance_met
    assert tight.tolerance_met
    assert error < loose.error_estimate < 1e-3
    assert not converged(scene, 1e-5, most_updates=1e6).tolerance_met
