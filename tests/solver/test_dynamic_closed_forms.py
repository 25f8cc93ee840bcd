"""Motions against closed forms: strings, chains, pendulums, towed and whirling cables (Lamb, Routh, Kolodner)."""

import numpy as np
import pytest
from scipy.integrate import cumulative_simpson, solve_ivp
from scipy.interpolate import make_interp_spline
from scipy.optimize import brentq
from scipy.special import ellipk, j0, jn_zeros

from dlocore import (
    Cable,
    ControlPoints,
    Environment,
    Grasp,
    Move,
    PointMass,
    Quality,
    Scene,
    Straight,
    Waypoints,
    predict,
    sensitivities,
)
from tests.solver.scenes import WEIGHTLESS, Floats, G, cable, converged

MU = 0.05
LIMP = {"bending_stiffness": 1e-9, "axial_stiffness": 1e4}


def shape(u: Floats, r: Floats, velocity: Floats | None = None, strain: float | None = None) -> ControlPoints:
    """Return the start through r (n, 3) [m] at u (n,) [m], with velocities (n, 3) [m/s] there and a uniform strain."""
    through = make_interp_spline(u, r, k=3)
    return ControlPoints(
        control_points=through.c,
        knots=through.t,
        velocity=None if velocity is None else make_interp_spline(u, velocity, k=3).c,
        strain=None if strain is None else np.full(len(u), strain),
    )


@pytest.mark.parametrize("mode", [1, 3])
def test_a_hanging_chain_swings_at_the_zeros_of_the_bessel_function(mode):
    zero = jn_zeros(0, mode)[-1]
    omega, u = 0.5 * zero * np.sqrt(G), np.linspace(0.0, 1.0, 81)
    aside = 1e-3 * j0(zero * np.sqrt(1.0 - u))
    scene = Scene(
        cable=cable(**LIMP),
        shape=shape(u, np.column_stack([aside, 0 * u, -u])),
        grasps=(Grasp(u=0.0),),
        horizon=2 * np.pi / omega,
        quality=Quality(target_error=2e-5),
    )
    t = np.linspace(0.0, scene.horizon, 17)
    x = converged(scene).surface.positions(u, t)[..., 0]
    np.testing.assert_allclose(x, np.cos(omega * t)[:, None] * aside, atol=2e-5)


@pytest.mark.parametrize(("mode", "stiffness"), [(1, 1e-3), (5, 1e-2)])
def test_a_taut_string_vibrates_at_the_frequency_of_its_tension_and_its_bending(mode, stiffness):
    # omega^2 = (T k^2/(1 + e) + EI k^4/(1 + e)^2)/mu, k the wave number along the unstrained string
    tension, EA, k = 10.0, 1e4, mode * np.pi
    e, u = tension / EA, np.linspace(0.0, 1.0, 65)
    omega = np.sqrt((tension * k**2 / (1 + e) + stiffness * k**4 / (1 + e) ** 2) / MU)
    scene = Scene(
        cable=cable(bending_stiffness=stiffness, axial_stiffness=EA),
        shape=shape(u, np.column_stack([(1 + e) * u, 1e-4 * np.sin(k * u), 0 * u]), strain=e),
        grasps=(Grasp(u=0.0), Grasp(u=1.0)),
        environment=WEIGHTLESS,
        horizon=2 * np.pi / omega,
        quality=Quality(target_error=2e-6),
    )
    found = converged(scene)
    t = np.linspace(0.0, scene.horizon, 17)
    y = found.surface.positions(u, t)[..., 1]
    np.testing.assert_allclose(y, 1e-4 * np.cos(omega * t)[:, None] * np.sin(k * u), atol=2e-6)
    pull = found.grasps[1]
    assert abs(pull.reaction[-1, 0] - tension) < 2 * pull.reaction_error[-1]  # 7 mN, 6 mN estimated


def test_a_chain_whirls_on_in_its_relative_equilibrium():
    # p = T sin/mu and x' = -p/T: dp/ds = omega^2 x, dx/ds = -p/sqrt(p^2 + g^2 s^2) from the free end (Kolodner 1955);
    # its end is 0.6 L from the axis at 1.11 times the frequency of small whirls
    def from_free_end(omega: float, s: Floats) -> Floats:
        def slope(s: float, y: Floats) -> list[float]:
            return [-y[1] / np.hypot(y[1], G * s), omega**2 * y[0]]

        begin = 1e-9
        return solve_ivp(slope, (begin, 1.0), [0.6, omega**2 * 0.6 * begin], t_eval=s, rtol=1e-10, atol=1e-12).y

    omega = brentq(lambda w: from_free_end(w, np.array([1.0]))[0, 0], 4.0, 4.5)
    assert omega == pytest.approx(1.1124 * 0.5 * jn_zeros(0, 1)[0] * np.sqrt(G), rel=1e-4)
    u = np.linspace(0.0, 1.0, 161)
    x, p = from_free_end(omega, np.clip(1.0 - u, 1e-9, None)[::-1])[:, ::-1]
    down = 1.0 / np.hypot(p / (G * np.clip(1.0 - u, 1e-9, None)), 1.0)
    z = -cumulative_simpson(down, x=u, initial=0.0)
    start = shape(u, np.column_stack([x, 0 * u, z]), velocity=np.column_stack([0 * u, omega * x, 0 * u]))
    scene = Scene(cable=cable(**LIMP), shape=start, grasps=(Grasp(u=0.0),), horizon=2 * np.pi / omega)
    found = converged(scene)
    t = np.linspace(0.0, scene.horizon, 17)
    c, s = np.cos(omega * t)[:, None], np.sin(omega * t)[:, None]
    exact = np.stack([c * x, s * x, z + 0 * c], axis=-1)
    off = np.linalg.norm(found.surface.positions(u, t) - exact, axis=-1).max()
    assert off < found.accuracy.error_estimate < 2e-3
    grip = found.grasps[0]
    at_end = np.array([-MU * p[0], 0.0, MU * G])
    np.testing.assert_allclose(grip.reaction[-1], at_end, atol=5e-3 * np.linalg.norm(at_end))


def test_a_bob_swings_from_a_light_cable_with_the_period_and_the_tension_of_a_pendulum():
    angle, mass = np.radians(80), 1.0
    period = 4 * np.sqrt(1 / G) * ellipk(np.sin(angle / 2) ** 2)
    light = Cable(
        length=1.0, diameter=0.005, linear_density=1e-4, bending_stiffness=1e-6, axial_stiffness=1e5,
        point_masses=(PointMass(u=1.0, mass=mass),),
    )  # fmt: skip
    start = np.array([np.sin(angle), 0.0, -np.cos(angle)])
    found = converged(Scene(cable=light, shape=Straight(direction=start), grasps=(Grasp(u=0.0),), horizon=period))
    assert np.linalg.norm(found.surface.positions([1.0], [period])[0, 0] - start) < 2 * found.accuracy.error_estimate
    # it is lowest after a quarter of the period: m g (3 - 2 cos angle) there, along the whole cable
    tension = 1e5 * found.stretch.along([0.0, 0.5, 1.0], [period / 4])
    np.testing.assert_allclose(tension, mass * G * (3 - 2 * np.cos(angle)), rtol=2e-3)


@pytest.mark.parametrize(("linear", "quadratic"), [(0.3, 0.0), (0.0, 0.1)])
def test_a_towed_cable_is_straight_at_the_angle_of_drag_and_weight(linear, quadratic):
    speed = 2.0
    drag = linear * speed + quadratic * speed**2
    pull = np.hypot(drag, MU * G)
    u = np.linspace(0.0, 1.0, 13)
    away = np.array([-drag, 0.0, -MU * G]) / pull
    scene = Scene(
        cable=cable(bending_stiffness=1e-6, axial_stiffness=1e4),
        shape=shape(u, np.outer(u, away), velocity=np.tile([speed, 0.0, 0.0], (13, 1))),
        grasps=(Grasp(u=0.0, path=Move(displacement=(speed, 0.0, 0.0), duration=1.0, profile="linear")),),
        environment=Environment(drag=linear, drag_quadratic=quadratic),
        horizon=1.0,
    )
    found = converged(scene)
    exact = np.array([speed, 0.0, 0.0]) + np.outer(u, away)
    np.testing.assert_allclose(found.surface.positions(u, [1.0])[0], exact, atol=1e-4)  # it stretches by 4e-5
    np.testing.assert_allclose(found.grasps[0].reaction[-1], [drag, 0.0, MU * G], rtol=1e-3, atol=1e-4)
    tension = 1e4 * found.stretch.along(u, [1.0])[0]
    np.testing.assert_allclose(tension, pull * (1 - u), atol=2e-3 * pull)


def test_a_rod_that_is_caught_at_its_end_turns_about_it_with_three_quarters_of_its_energy():
    speed = 1.0
    stiff = cable(bending_stiffness=1e3, bending_damping=1.0)
    rod = Scene(
        cable=stiff,
        shape=Straight(velocity=(0.0, speed, 0.0)),
        grasps=(Grasp(u=0.0, grasp_time=0.2),),
        environment=WEIGHTLESS,
        horizon=1.0,
    )
    found = converged(rod)
    (end,) = found.surface.positions([1.0], [1.0])[0]
    angle = 1.5 * speed * 0.8
    np.testing.assert_allclose(end, [np.cos(angle), 0.2 + np.sin(angle), 0.0], atol=found.accuracy.error_estimate)
    assert found.energies([1.0])["kinetic"][0] == pytest.approx(0.75 * 0.5 * MU * speed**2, rel=2e-3)
    grip = found.grasps[0]
    assert np.linalg.norm(grip.reaction[-1]) == pytest.approx(MU * 1.5**2 / 2, abs=2 * grip.reaction_error[-1])


def test_sensitivities_of_a_vibrating_cantilever_are_those_of_its_closed_form():
    # y = a exp(-b t) (cos w t + b/w sin w t) with w^2 = beta^4 EI/mu and 2 b = c/mu + w^2 eta/EI
    EI, beta, a, u = 1e-3, 1.87510407, 1e-3, np.linspace(0.0, 1.0, 33)
    w = beta**2 * np.sqrt(EI / MU)
    share = (np.cosh(beta) + np.cos(beta)) / (np.sinh(beta) + np.sin(beta))
    y = np.cosh(beta * u) - np.cos(beta * u) - share * (np.sinh(beta * u) - np.sin(beta * u))
    scene = Scene(
        cable=cable(bending_stiffness=EI),
        shape=shape(u, np.column_stack([u, 0.5 * a * y, 0 * u])),
        grasps=(Grasp(u=0.0, hold="tangent"),),
        environment=WEIGHTLESS,
        horizon=2 * np.pi / w,
        quality=Quality(n_u=17, n_t=65),
    )
    t = np.linspace(0.0, scene.horizon, 33)
    by_w, by_b = -a * t * np.sin(w * t), a * (np.sin(w * t) / w - t * np.cos(w * t))
    exact = {
        "cable.bending_stiffness": by_w * w / (2 * EI),
        "cable.linear_density": -by_w * w / (2 * MU),
        "cable.bending_damping": by_b * 0.5 * w**2 / EI,
        "environment.drag": by_b * 0.5 / MU,
    }
    slopes = sensitivities(predict(scene), wrt=list(exact))([1.0], t)[:, :, 0, 1]
    for found, expected in zip(slopes, exact.values(), strict=True):
        np.testing.assert_allclose(found, expected, atol=2e-3 * np.abs(expected).max())


def test_a_wire_that_is_bent_to_an_arc_and_back_has_the_moment_of_its_law():
    # M = EI (kappa - eps_0) with eps_0 = (kappa - kappa_M)/(1 + H) as it bends on, and unchanged as it is bent back
    EI, L, limit, H, n = 1e-2, 0.5, 1.0, 0.1, 41
    kept = 2.0 * limit / (1 + H)
    kappa = np.concatenate([np.linspace(0.0, 3.0, n), np.linspace(3.0, kept, n)[1:]])
    times, turn = np.linspace(0.0, 4.0, len(kappa)), kappa * L
    half = 0.5 * turn
    chord = L * np.sinc(half / np.pi)
    path = Waypoints(
        times=times,
        positions=np.column_stack([chord * np.cos(half), chord * np.sin(half), 0 * half]),
        orientations=np.column_stack([np.cos(half), 0 * half, 0 * half, np.sin(half)]),
    )
    wire = Cable(
        length=L, diameter=0.005, linear_density=0.02, bending_stiffness=EI, yield_strain=0.0025 * limit,
        memory_rate=1e5, hardening=H,
    )  # fmt: skip
    scene = Scene(
        cable=wire,
        shape=Straight(),
        grasps=(Grasp(u=0.0, hold="tangent"), Grasp(u=L, hold="tangent", path=path)),
        environment=WEIGHTLESS,
        horizon=4.0,
        effects={"inertia": "off"},
    )
    found = converged(scene)
    grip = found.grasps[1]
    turned = path.rotation_at(grip.times)
    k = np.arctan2(turned[:, 1, 0], turned[:, 0, 0]) / L
    permanent = np.maximum(np.maximum.accumulate(k) - limit, 0.0) / (1 + H)
    later = grip.times > 0.15  # up to the second waypoint the path, which starts from rest, is no arc
    np.testing.assert_allclose(grip.moment[later, 2], (EI * (k - permanent))[later], atol=5e-3 * EI)
    assert found.material is not None
    np.testing.assert_allclose(found.material.memory[-1, :, 0], permanent[-1], atol=3e-3)
