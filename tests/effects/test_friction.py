"""Coulomb friction against closed forms: sliding, sticking, stopping, turning, dragging and winding."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation
from scipy.special import j0, jn_zeros

from dlocore import (
    Box,
    Cable,
    Cylinder,
    Environment,
    Grasp,
    Load,
    Move,
    Points,
    Prediction,
    Quality,
    Scene,
    Straight,
    Table,
    Waypoints,
    predict,
)
from dlocore.effects.friction import slip_of
from tests.solver.scenes import Floats, G, apart, cable, converged, march, momentum, refined

MASS = 0.05  # [kg] of the paper's cable, 1 m long
STICK = 1e-4  # [m] that a sticking cable gives way before it slides


def rough(mu: float, gravity: tuple[float, float, float] = (0.0, 0.0, -G)) -> Environment:
    """Return a table with friction."""
    return Environment(gravity=gravity, table=Table(friction=mu))


def at(prediction: Prediction, times: Floats, grasp: int = 0) -> Floats:
    """Return the reaction of a grasp at the times (k,), linear between those reported; (k, 3) [N]."""
    found = prediction.grasps[grasp]
    return np.column_stack([np.interp(times, found.times, found.reaction[:, d]) for d in range(3)])


# --- sliding and sticking as a block ---


def pulled_along(mu: float, horizon: float = 3.0) -> Scene:
    """Return a straight cable pulled by its leading end along itself, 0.1 m in 3 s."""
    grasp = Grasp(u=0.0, path=Move(displacement=(-0.1, 0.0, 0.0), duration=3.0))
    return Scene(cable=cable(), shape=Straight(), grasps=(grasp,), environment=rough(mu), horizon=horizon)


@pytest.mark.parametrize("mu", [0.1, 0.3, 0.8])
def test_a_cable_pulled_along_itself_resists_with_mu_m_g_and_its_inertia(mu):
    sliding = converged(pulled_along(mu))
    t = np.linspace(0.6, 2.4, 37)  # by 0.6 s it has moved 6 mm, far beyond sticking
    x = t / 3.0
    acceleration = 0.1 / 3.0**2 * (60 * x - 180 * x**2 + 120 * x**3)
    # axial waves after the start of sliding, 113 m/s, are over; what is left is the time step's
    np.testing.assert_allclose(-at(sliding, t)[:, 0], MASS * (mu * G + acceleration), rtol=0.01)
    assert np.abs(at(sliding, t)[:, 1]).max() < 1e-3 * mu * MASS * G  # nothing across


def test_tension_in_a_dragged_cable_falls_linearly_to_its_free_end():
    soft = replace(pulled_along(0.5), cable=cable(axial_stiffness=64.0))
    t, u = np.linspace(1.4, 1.6, 9), np.linspace(0.2, 0.8, 7)  # the acceleration is below 0.02 m/s^2
    tension = 64.0 * converged(soft).surface.axial_strain(u, t).mean(axis=0)
    np.testing.assert_allclose(tension, 0.5 * MASS * G * (1 - u), atol=0.02 * 0.5 * MASS * G)  # of the largest


def test_a_slow_drag_does_not_chatter():
    sliding = converged(pulled_along(0.3))
    found = sliding.grasps[0]
    steady = (found.times > 0.3) & (found.times < 2.7)
    force = -found.reaction[steady, 0]
    # the inertial part goes up and down once by 0.06/2.94 of the friction
    assert np.abs(np.diff(force)).sum() < 0.15 * 0.3 * MASS * G
    assert (force > 0).all()


def test_friction_holds_what_the_drag_has_left_behind():
    held = converged(pulled_along(0.3, horizon=4.0))
    u = np.linspace(0.0, 1.0, 51)
    still = held.surface.positions(u, np.linspace(3.05, 4.0, 21))
    assert np.linalg.norm(still - still[0], axis=-1).max() < STICK
    assert np.abs(at(held, np.linspace(3.05, 4.0, 21))[:, 0]).max() < 1.01 * 0.3 * MASS * G


@pytest.mark.parametrize("direction", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.6, 0.8, 0.0)])
@pytest.mark.parametrize("mu", [0.2, 0.6])
def test_a_cable_sticks_on_a_slope_below_the_limit(mu, direction):
    slope = rough(mu, gravity=(0.9 * mu * G, 0.0, -G))
    lying = Scene(cable=cable(), shape=Straight(direction=direction), environment=slope, horizon=10.0)
    resting = refined(lying, 3e-4)
    slip = resting.surface.positions(np.linspace(0, 1, 33), np.linspace(0, 10, 65))
    # let go at once, it runs 0.1 mm into the stick with v^2 = 0.8 mu g 0.1 mm and stops after 0.4 mm; it never creeps
    assert np.linalg.norm(slip - slip[0], axis=-1).max() < 1e-3
    assert np.linalg.norm(slip[-1] - slip[32], axis=-1).max() < STICK


@pytest.mark.parametrize("direction", [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.6, 0.8, 0.0)])
@pytest.mark.parametrize("mu", [0.2, 0.6])
def test_a_cable_slides_down_a_slope_above_the_limit_as_a_block(mu, direction):
    slope = rough(mu, gravity=(1.1 * mu * G, 0.0, -G))
    lying = Scene(cable=cable(), shape=Straight(direction=direction), environment=slope, horizon=1.5)
    sliding = refined(lying, 5e-4)
    way = sliding.surface.positions(np.linspace(0, 1, 9), [0.5, 1.0, 1.5])
    acceleration = (way[2] - 2 * way[1] + way[0]) / 0.5**2
    # 1 %: the target of 0.5 mm is 0.4 % of the way between, at the smaller of the two accelerations
    np.testing.assert_allclose(acceleration, np.broadcast_to([0.1 * mu * G, 0.0, 0.0], (9, 3)), atol=1e-3 * mu * G)


@pytest.mark.parametrize("along", [True, False])
def test_a_thrown_cable_stops_after_v_squared_over_2_mu_g(along):
    velocity = (1.0, 0.0, 0.0) if along else (0.0, 1.0, 0.0)
    scene = Scene(cable=cable(), shape=Straight(velocity=velocity), environment=rough(0.4), horizon=0.8)
    thrown = converged(scene)
    u, way = np.linspace(0, 1, 33), 1.0 / (2 * 0.4 * G)
    stopped = thrown.surface.positions(u, [0.8])[0] - thrown.surface.positions(u, [0.0])[0]
    # the target error of 2 mm, and what sticking gives way
    np.testing.assert_allclose(stopped @ np.array(velocity), way, atol=2e-3 + STICK)
    assert np.linalg.norm(thrown.surface(u, [0.8], dt=1)[..., :3], axis=-1).max() < 2e-3  # [m/s]


@pytest.mark.parametrize("fall", [0.3, 1.0])
@pytest.mark.parametrize("body", ["table", "box"])
def test_a_strike_slows_a_sliding_cable_by_mu_times_its_impulse(body, fall):
    mu, speed, end = 0.25, 1.5, 0.25
    ground = rough(mu)
    if body == "box":
        box = Box(center=(0.5, 0.0, -0.05), size=(2.0, 2.0, 0.1), friction=mu)
        ground = Environment(gravity=(0.0, 0.0, -G), obstacles=(box,))
    shape = Straight(start=(0.0, 0.0, 0.04), velocity=(0.0, speed, -fall))
    thrown = converged(Scene(cable=cable(), shape=shape, environment=ground, horizon=end))
    across, up = thrown.surface(np.linspace(0, 1, 9), [end], dt=1)[0, :, 1:3].T
    # dv_y = -mu (dv_z + g t) for as long as it slides, however the cable bounces
    np.testing.assert_allclose(speed - across, mu * (up + fall + G * end), rtol=0.02)
    assert (across > 0.3).all()


def test_a_spinning_rod_stops_after_omega_squared_l_over_6_mu_g():
    omega, mu = 3.0, 0.3
    x = np.linspace(-0.5, 0.5, 21)
    velocity = np.column_stack([0 * x, omega * x, 0 * x])
    stiff = cable(bending_stiffness=1.0, axial_stiffness=1e4)
    scene = Scene(cable=stiff, shape=Straight(velocity=velocity), environment=rough(mu), horizon=0.6)
    spun = converged(scene)
    ends = spun.surface.positions([0.0, 1.0], [0.6])[0]
    turned = np.arctan2(*(ends[1] - ends[0])[[1, 0]])
    # the torque is mu m g L/4 and the inertia m L^2/12; the rod bends by less than a per cent of the angle
    assert turned == pytest.approx(omega**2 / (6 * mu * G), rel=0.01)
    np.testing.assert_allclose(ends.mean(axis=0), [0.5, 0.0, 0.0], atol=1e-3)


# --- distributed friction on a rod and on a chain that are dragged ---

ROD = cable(length=0.3, bending_stiffness=1.0, axial_stiffness=1e4)  # friction bends it by less than 0.1 mm


def test_a_rod_pushed_across_its_end_turns_about_l_over_root_2():
    mu = 0.5
    grasp = Grasp(u=0.0, path=Move(displacement=(0.0, 0.01, 0.0), duration=2.0))
    turning = converged(
        Scene(cable=ROD, shape=Straight(), grasps=(grasp,), environment=rough(mu), quality=march(17, 33))
    )
    u = np.linspace(0.0, 0.3, 301)
    y = turning.surface.positions(u, [2.0])[0, :, 1]
    # within 0.1 mm/(0.01/0.21 rad) = 2 mm of the pivot it sticks
    assert u[np.argmax(y < 0)] == pytest.approx(0.3 / np.sqrt(2), abs=2e-3)
    # balance of moments about it: F = (sqrt 2 - 1) mu m g; 1 % for the part that sticks
    force = at(turning, np.array([1.0, 1.2, 1.4]))[:, 1]
    np.testing.assert_allclose(force, (np.sqrt(2) - 1) * mu * 0.3 * MASS * G, rtol=0.015)


def rod_angle(way: Floats, length: float) -> Floats:
    """Return the angle (k,) [rad] of a rough rod whose end was dragged quasi-statically by `way` (k,) [m] from 90 deg.

    The moment of friction about the dragged end vanishes: integral of s e . v/|v| over s, with e across the rod.
    """

    def moment(omega: float, phi: float) -> float:
        def density(s: float) -> float:
            across = omega * s - np.sin(phi)
            return s * across / np.hypot(across, np.cos(phi))

        return quad(density, 0.0, length, points=[min(length, np.sin(phi) / max(omega, 1e-9))])[0]

    def rate(_: float, phi: Floats) -> list[float]:
        return [brentq(moment, 0.0, 10.0 / length, args=(phi[0],))]

    return solve_ivp(rate, (0.0, way[-1]), [np.pi / 2], t_eval=way, rtol=1e-6).y[0]


def test_a_rod_dragged_by_its_end_swings_in_behind_it_as_the_moment_of_friction_says():
    grasp = Grasp(u=0.0, path=Move(displacement=(0.5, 0.0, 0.0), duration=10.0))
    start = Straight(direction=(0.0, 1.0, 0.0))
    dragged = converged(Scene(cable=ROD, shape=start, grasps=(grasp,), environment=rough(1.0), quality=march(9, 41)))
    t = np.linspace(3.0, 10.0, 8)
    ends = dragged.surface.positions([0.0, 0.3], t)
    rod = ends[:, 1] - ends[:, 0]
    # inertia: v^2/(mu g L) = 0.3 %
    np.testing.assert_allclose(np.arctan2(rod[:, 1], rod[:, 0]), rod_angle(ends[:, 0, 0], 0.3), atol=0.015)


def test_a_dragged_chain_straightens_by_exp_of_minus_1_446_of_its_length():
    # with T = mu w (L - u) and v nearly along the drag X: dy/dX = d/du((L - u) dy/du), whose first mode is
    # J0(j sqrt(1 - u/L)) and decays by j^2/4L, j the first zero of J0; friction itself drops out
    j = float(jn_zeros(0, 1)[0])
    u = np.linspace(0.0, 1.0, 201)
    mode = 0.02 * j0(j * np.sqrt(1 - u))
    start = Points(points=np.column_stack([-u, mode]))
    grasp = Grasp(u=0.0, path=Move(displacement=(1.0, 0.0, 0.0), duration=8.0))
    limp = cable(bending_stiffness=1e-5, axial_stiffness=640.0)
    scene = Scene(cable=limp, shape=start, grasps=(grasp,), environment=rough(1.0), horizon=8.0)
    chain = converged(replace(scene, quality=march(25, 97)))
    t = np.array([3.0, 4.0, 5.0, 8.0])
    way = chain.surface.positions([0.0], t)[:, 0, 0]
    tail = chain.surface.positions([1.0, 0.6], t)[..., 1]
    expected = 0.02 * np.exp(-(j**2) / 4 * way)[:, None] * j0(j * np.sqrt(1 - np.array([1.0, 0.6])))
    # 0.2 mm: inertia v^2/(mu g L) = 0.4 % and the slope squared of 20 mm, and a stick displacement
    np.testing.assert_allclose(tail, expected, atol=3e-4)


@pytest.mark.slow
def test_a_cable_dragged_far_trails_straight_behind_the_gripper_with_tension_mu_w():
    u = np.linspace(0.0, 1.0, 101)
    bent = np.column_stack([-0.5 * np.sin(2 * u), -0.5 * (1 - np.cos(2 * u))])
    grasp = Grasp(u=0.0, path=Move(displacement=(0.0, 4.0, 0.0), duration=12.0, profile="cubic"))
    limp = cable(bending_stiffness=1e-4, axial_stiffness=64.0)
    scene = Scene(cable=limp, shape=Points(points=bent), grasps=(grasp,), environment=rough(0.8))
    trailing = converged(scene)
    behind = trailing.surface.positions(u, [12.0])[0]
    # the first mode has decayed by exp(-1.446 4) = 0.3 % of at most 0.7 m
    assert np.abs(behind[:, 0] - behind[0, 0]).max() < 4e-3
    np.testing.assert_allclose(behind[0, 1] - behind[:, 1], u, atol=4e-3)
    middle = at(trailing, np.array([6.0]))[0]  # the acceleration is zero
    assert middle[1] == pytest.approx(0.8 * MASS * G, rel=0.02)


# --- the capstan ---


def wound(phi: float, mu: float, pull: float) -> Scene:
    """Return a light cable around an upright rough cylinder, loaded by 1 N at u = L and pulled by `pull` [m] at u = 0.

    The cylinder is centred at the origin and wound by `phi` [rad], on a smooth table. The load is on at 0.3 s.
    """
    radius, leg = 0.05, 0.15
    around = radius * phi
    length = 2 * leg + around
    s = np.linspace(0.0, length, 241)
    turn = np.clip((s - leg) / radius, 0.0, phi)
    before, after = np.minimum(s - leg, 0.0), np.maximum(s - leg - around, 0.0)
    x = radius * np.sin(turn) + before + after * np.cos(phi)
    y = -radius * np.cos(turn) + after * np.sin(phi)
    light = Cable(length=length, diameter=0.002, linear_density=0.01, bending_stiffness=1e-6, axial_stiffness=2e3)
    drum = Cylinder(center=(0.0, 0.0, 0.0), radius=radius - 0.001, height=0.1, friction=mu)
    force = np.array([np.cos(phi), np.sin(phi), 0.0])
    return Scene(
        cable=light,
        shape=Points(points=np.column_stack([x, y])),
        grasps=(Grasp(u=0.0, path=Move(displacement=(-pull, 0.0, 0.0), duration=2.0)),),
        loads=(Load(u=length, force=[0.01 * force, force, force], times=[0.0, 0.3, 2.0]),),
        environment=Environment(drag=0.05, table=Table(), obstacles=(drum,)),
    )


@pytest.mark.parametrize(("phi", "mu"), [(np.pi / 2, 0.3), (np.pi, 0.2), (np.pi, 0.4), (np.pi, 0.0)])
@pytest.mark.parametrize("way", [0.02, -0.02])
def test_tension_around_a_cylinder_grows_by_exp_mu_phi(phi, mu, way):
    if mu == 0.0 and way < 0:
        pytest.skip("without friction both ways are one")
    scene = wound(phi, mu, way)
    pulled = converged(scene)
    t = np.linspace(0.8, 1.4, 13)  # by 0.8 s it has slid 6 mm
    ratio = np.linalg.norm(at(pulled, t), axis=1)
    # 3 %: drag 0.1 %, and the stretches where the cable leaves the cylinder, sqrt(EI/T)/R = 2 % of a radian
    np.testing.assert_allclose(ratio, np.exp(np.sign(way) * mu * phi), rtol=0.03)


# --- in space ---


def test_a_cable_dragged_by_a_lifted_end_resists_with_mu_times_what_rests_on_the_table():
    mu = 0.4
    path = Waypoints(times=[0.0, 1.5, 2.0, 5.0], positions=[(0, 0, 0), (0, 0, 0.08), (-0.02, 0, 0.08), (-0.3, 0, 0.08)])
    scene = Scene(
        cable=cable(bending_damping=1e-4), shape=Straight(), grasps=(Grasp(u=0.0, path=path),), environment=rough(mu)
    )
    dragged = converged(scene)
    t = np.linspace(2.8, 4.2, 8)
    force = at(dragged, t)
    p = momentum(dragged.surface, MASS, np.concatenate([t - 0.05, t + 0.05]))[0]
    inertia = (p[len(t) :] - p[: len(t)]) / 0.1
    resting = MASS * G - force[:, 2] + inertia[:, 2]
    np.testing.assert_allclose(-force[:, 0] + inertia[:, 0], mu * resting, rtol=0.03)  # all of it slides one way


# --- what friction does not depend on ---


def wide_scene(turn: float = 0.0) -> Scene:
    """Return a bent cable dragged sideways at 0.3 m, with the whole table turned by `turn` [rad]."""
    R = Rotation.from_euler("z", turn).as_matrix()
    u = np.linspace(0.0, 1.0, 41)
    bent = np.column_stack([np.sin(1.5 * u), 1 - np.cos(1.5 * u), 0 * u]) / 1.5
    grasp = Grasp(u=0.3, path=Move(displacement=R @ [0.05, 0.25, 0.0], duration=1.0))
    return Scene(
        cable=cable(rest_shape="initial"),
        shape=Points(points=bent @ R.T),
        grasps=(grasp,),
        environment=rough(0.4),
        quality=march(17, 25),
    )


def test_friction_has_no_preferred_direction_on_the_table():
    turn = 0.7
    R = Rotation.from_euler("z", turn).as_matrix()
    straight, turned = predict(wide_scene()), predict(wide_scene(turn))
    u, t = np.linspace(0, 1, 33), np.linspace(0, 1, 17)
    expected = straight.surface.positions(u, t) @ R.T
    # Newton's iterations end at 3e-7 L, and sliding begins a little earlier or later for it
    np.testing.assert_allclose(turned.surface.positions(u, t), expected, atol=1e-4)


def test_friction_switched_off_is_a_smooth_table():
    scene = wide_scene()
    without = predict(replace(scene, effects={"friction": "off"}))
    smooth = predict(replace(scene, environment=rough(0.0)))
    assert apart(without.surface, smooth.surface).max() < 1e-9  # the same equations
    assert apart(predict(scene).surface, smooth.surface).max() > 0.02  # which friction matters to


def test_friction_takes_exactly_the_work_that_the_gripper_gives():
    sliding = converged(pulled_along(0.3))
    found = sliding.grasps[0]
    path = sliding.surface.positions([0.0], found.times)[:, 0]
    work = np.trapezoid(found.reaction[:, 0], path[:, 0])
    # it begins and ends at rest; 0.1 mm of the 0.1 m are given way before it slides
    assert work == pytest.approx(0.3 * MASS * G * 0.1, rel=0.01)


# --- Coulomb's law as the limit of the elastic slip ---


def pushed_together(turn: float = 0.0) -> Scene:
    """Return a straight cable on a rough table whose end is brought nearer to the other, and turned by `turn` [rad].

    Which way it buckles, and where, friction decides while it holds: a cable that gives way by 0.1 mm before friction
    holds ends up to 0.15 L elsewhere.
    """
    share = 0.5 if turn else 1.0
    rotation = (0.0, 0.0, turn) if turn else None
    path = Move(displacement=(0.2 * share, 0.1 * share, 0.0), duration=2.0, rotation=rotation)
    grasps = (Grasp(u=0.0, hold="tangent" if turn else "point", path=path), Grasp(u=1.0))
    around = Environment(drag=0.05, table=Table(friction=0.4))
    return Scene(
        cable=cable(),
        shape=Straight(),
        grasps=grasps,
        environment=around,
        effects={"self_contact": "off"},
    )


@pytest.mark.parametrize("turn", [0.0, 0.78])
def test_a_cable_pushed_together_on_a_rough_table_is_where_the_reference_takes_it(turn):
    scene = pushed_together(turn)
    found = converged(scene)
    reference = converged(replace(scene, quality=Quality(method="reference", target_error=2e-3)))
    told = found.accuracy.error_estimate + reference.accuracy.error_estimate
    assert told < 4e-3
    assert apart(found.surface, reference.surface).max() < 1.5 * told


def test_an_estimate_on_a_given_grid_tells_of_the_slip_before_friction_holds():
    scene = pushed_together(0.78)
    truth = converged(replace(scene, quality=Quality(target_error=1e-3)))
    for n_u, n_t in ((17, 33), (33, 65)):
        found = predict(replace(scene, quality=Quality(n_u=n_u, n_t=n_t, method="march")), keep_grid=True)
        off = apart(found.surface, truth.surface).max()
        assert off > 5e-3  # so that there is something to tell
        assert found.accuracy.error_estimate > 0.5 * off


def test_the_slip_goes_with_the_square_of_the_step_between_its_bounds():
    diameter, length = 0.005, 4.0
    coarse = slip_of(diameter, length, 0.1)  # of the coarsest grid
    assert coarse == pytest.approx(0.02 * diameter)
    assert slip_of(diameter, length, 5.0) == coarse
    assert slip_of(diameter, length, 0.05) == pytest.approx(coarse / 4.0)
    assert slip_of(diameter, length, 1e-9) == pytest.approx(1e-7 * length)
    assert slip_of(1e-9, length, 0.1) == pytest.approx(2e-11)  # never above what it begins with
