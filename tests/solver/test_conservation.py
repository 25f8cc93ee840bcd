"""Laws that every motion keeps: energy, momentum, free fall, balance of forces."""

from dataclasses import replace

import numpy as np
import pytest

from dlocore import (
    ControlPoints,
    Environment,
    Grasp,
    Load,
    Move,
    Points,
    Prediction,
    Scene,
    Straight,
    energies,
    predict,
)
from dlocore.answer.report import elastic_energy
from dlocore.problem.discretisation import make_grid
from dlocore.problem.problem import pose
from dlocore.spline import design_matrix
from tests.solver.scenes import (
    WEIGHTLESS,
    Floats,
    G,
    along,
    arc,
    cable,
    centre,
    march,
    momentum,
    paper_scene,
    without_table,
)

MU = 0.05


def energy(prediction: Prediction, t: Floats) -> Floats:
    """Return elastic, kinetic and potential energy together (k,) [J] at the times t (k,)."""
    surface, problem = prediction.surface, pose(prediction.scene)
    grid = make_grid(problem, len(surface.knots_u) - 4)
    states = np.einsum("kj,jid->kid", design_matrix(surface.knots_t, t), surface.control_points[..., :3])
    elastic = [
        elastic_energy(problem, grid, np.ascontiguousarray(problem.plane.points(q)), grid.history) for q in states
    ]
    u, w = along(surface)
    v = surface(u, t, dt=1)[..., :3]
    kinetic = 0.5 * MU * np.einsum("u,kud->k", w, v * v)
    lifted = centre(surface, t) @ -np.asarray(prediction.scene.environment.gravity) * MU * surface.length
    return np.array(elastic) + kinetic + lifted


def swing(drag: float, hold: str = "point", damping: float = 0.0) -> Prediction:
    """Return a cable that is let go level and falls about one held end."""
    scene = Scene(
        cable=cable(bending_damping=damping),
        shape=Straight(),
        grasps=(Grasp(u=0.0, hold=hold),),  # type: ignore[arg-type]
        environment=Environment(drag=drag),
        horizon=1.2,
        quality=march(21, 129),
    )
    prediction = predict(scene)
    assert prediction.status == "converged"
    return prediction


@pytest.mark.parametrize(("effect", "kind"), [("inertia", "kinetic"), ("gravity", "gravity")])
def test_what_is_off_has_no_energy(effect, kind):
    lifted = Scene(
        cable=cable(),
        shape=Straight(direction=(0.0, 0.0, -1.0)),
        grasps=(Grasp(u=0.0, path=Move(displacement=(0.2, 0.0, 0.1), duration=0.5)),),
        environment=Environment(drag=0.1),
        quality=march(9, 13),
    )
    off = replace(lifted, effects={effect: "off"})
    found, without = (energies(s, predict(s).surface, [0.0, 0.25])[kind][1] for s in (lifted, off))
    assert found > 5e-3
    assert without == 0.0


@pytest.mark.parametrize("hold", ["point", "tangent"])
def test_energy_of_an_undamped_swing_never_grows(hold):
    t = np.linspace(0.0, 1.2, 97)
    scale = MU * G * 0.5  # of a fall by half the length
    total = energy(swing(0.0, hold), t) / scale
    assert np.diff(np.maximum.accumulate(total)).sum() < 1e-3
    assert total[-1] > -0.05  # and the scheme loses little


@pytest.mark.parametrize(("drag", "damping"), [(0.05, 0.0), (0.0, 1e-3)])
def test_energy_of_a_damped_swing_falls(drag, damping):
    t = np.linspace(0.0, 1.2, 97)
    total = energy(swing(drag, damping=damping), t) / (MU * G * 0.5)
    assert np.diff(total).max() < 1e-3
    assert total[-1] < -0.02


def tumbling(turn: Floats) -> Prediction:
    """Return a bent cable that flies, turns and straightens without any force."""
    x = np.linspace(0.0, 1.0, 9)
    knots = np.concatenate([np.zeros(3), np.linspace(0, 1, 7), np.ones(3)])
    x = (knots[1:-3] + knots[2:-2] + knots[3:-1]) / 3
    control = np.column_stack([x, 0.15 * np.sin(np.pi * x), 0.05 * x * x])
    spin = np.array([0.5, 0.2, -0.1]) + np.cross([0.3, 0.0, 2.0], control - [0.5, 0, 0])
    scene = Scene(
        cable=cable(),
        shape=ControlPoints(control_points=control @ turn.T, knots=knots, velocity=spin @ turn.T),
        environment=WEIGHTLESS,
        horizon=0.8,
        quality=march(13, 65),
    )
    prediction = predict(scene)
    assert prediction.status == "converged"
    return prediction


def test_a_cable_without_forces_keeps_its_momentum():
    prediction = tumbling(np.eye(3))
    t = np.linspace(0.0, 0.8, 33)
    linear, angular = momentum(prediction.surface, MU, t)
    # the scheme keeps linear momentum to the Newton tolerance, 3e-7 m; angular momentum in second order of the step
    np.testing.assert_allclose(linear, np.tile(linear[0], (33, 1)), atol=1e-8)
    np.testing.assert_allclose(angular, np.tile(angular[0], (33, 1)), atol=1e-5)
    total = energy(prediction, t)
    assert np.ptp(total) < 1e-2 * total[0]  # velocities of the time spline at the frequencies of the sharp bend


@pytest.mark.parametrize("gravity", [(0.0, 0.0, -G), (1.0, -2.0, 3.0)])
def test_a_cable_falls_freely_along_a_parabola(gravity):
    v = np.array([0.3, 2.0, -0.6])
    scene = Scene(
        cable=cable(),
        shape=Straight(velocity=v, direction=(1.0, 1.0, 0.2)),
        environment=Environment(gravity=gravity),
        horizon=1.0,
        quality=march(9, 13),
    )
    prediction = predict(scene)
    u, t = np.linspace(0.0, 1.0, 11), np.linspace(0.0, 1.0, 9)
    start = np.array([1.0, 1.0, 0.2]) / np.linalg.norm([1.0, 1.0, 0.2]) * u[:, None]
    fall = v * t[:, None] + 0.5 * np.array(gravity) * t[:, None] ** 2
    np.testing.assert_allclose(
        prediction.surface.positions(u, t), start + fall[:, None], atol=3e-7
    )  # the Newton tolerance


@pytest.mark.parametrize(("linear", "quadratic"), [(0.1, 0.0), (0.0, 0.2)])
def test_a_drifting_cable_is_braked_by_drag(linear, quadratic):
    v0 = np.array([0.3, 2.0, -0.6])
    scene = Scene(
        cable=cable(),
        shape=Straight(velocity=v0),
        environment=Environment(gravity=(0, 0, 0), drag=linear, drag_quadratic=quadratic),
        horizon=1.0,
        quality=march(9, 25),
    )
    end = predict(scene).surface.positions([0.0, 0.4, 1.0], 1.0)[0]
    speed = np.linalg.norm(v0)
    way = (
        MU / linear * (1 - np.exp(-linear / MU)) * speed
        if quadratic == 0.0
        else MU / quadratic * np.log1p(quadratic * speed / MU)
    )
    exact = np.outer([0.0, 0.4, 1.0], [1, 0, 0]) + way * v0 / speed
    np.testing.assert_allclose(end, exact, atol=3e-4)  # (h c/mu)^2/12 of the way at h = 8 ms, times a few


def test_a_cable_pulled_along_itself_asks_for_mass_times_acceleration_and_drag():
    scene = Scene(
        cable=cable(axial_stiffness=1e4),
        shape=Straight(),
        grasps=(Grasp(u=1.0, path=Move(displacement=(0.5, 0.0, 0.0), duration=1.0)),),
        environment=Environment(gravity=(0.0, 0.0, 0.0), drag=0.05),
        quality=march(9, 25),
    )
    pull = predict(scene).grasps[0]
    x = pull.times
    acceleration = 0.5 * (60 * x - 180 * x**2 + 120 * x**3)
    velocity = 0.5 * 30 * x**2 * (1 - x) ** 2
    force = MU * acceleration + 0.05 * velocity
    # axial waves of up to 1 %, which 125 steps don't resolve; a reaction half a step late would be off by 5 %
    np.testing.assert_allclose(pull.reaction[:, 0], force, atol=2e-2 * np.abs(force).max())
    np.testing.assert_allclose(pull.reaction[:, 1:], 0.0, atol=1e-9)


@pytest.mark.parametrize("hold", ["point", "tangent"])
def test_impulse_of_all_forces_is_the_change_of_momentum(hold):
    scene = Scene(
        cable=cable(),
        shape=Straight(),
        grasps=(Grasp(u=0.25, hold=hold, path=Move(displacement=(0.0, 0.3, 0.1), duration=0.8)),),
        loads=(Load(u=0.75, force=[[0, 0, 0], [0, 0, 0.05]], times=[0.0, 0.8]),),
        environment=Environment(gravity=(0.1, 0.0, 0.05), drag=0.05),
        quality=march(17, 65),
    )
    prediction = predict(scene)
    assert prediction.status == "converged"
    pull = prediction.grasps[0]
    t = pull.times
    for k in range(len(t) // 4, len(t), len(t) // 4):
        impulse = np.trapezoid(pull.reaction[: k + 1], t[: k + 1], axis=0)
        impulse += [0, 0, 0.5 * t[k] ** 2 / 0.8 * 0.05] + t[k] * MU * np.array([0.1, 0.0, 0.05])
        way = centre(prediction.surface, t[[0, k]])
        impulse -= 0.05 * (way[1] - way[0])
        change = momentum(prediction.surface, MU, t[[k]])[0][0]
        # of up to 0.02 N s; second order of 325 steps, and the velocity of the time spline
        np.testing.assert_allclose(change, impulse, atol=3e-5)


@pytest.mark.parametrize("hold", ["point", "tangent", "clamp"])
def test_impulse_of_all_torques_is_the_change_of_angular_momentum(hold):
    drag, gravity = 0.05, np.array([0.1, 0.0, -1.0])
    turned = None if hold == "point" else (0.2, 0.3, -0.6)
    way = Move(displacement=(0.0, 0.3, 0.1), rotation=turned, duration=0.8)
    scene = Scene(
        cable=cable(bending_damping=1e-4),
        shape=Points(points=arc(1.0, 1.0)),
        grasps=(Grasp(u=0.25, hold=hold, path=way), Grasp(u=1.0)),
        loads=(Load(u=0.75, force=(0.0, 0.02, 0.05)),),
        environment=Environment(gravity=gravity, drag=drag),
        quality=march(25, 65),
    )
    prediction = predict(scene)
    assert prediction.status == "converged"
    surface, t = prediction.surface, prediction.grasps[0].times
    u, w = along(surface)
    r, v = surface(u, t)[..., :3], surface(u, t, dt=1)[..., :3]
    torque = np.einsum("u,kud->kd", w, np.cross(r, MU * gravity - drag * v))
    torque += np.cross(surface.positions(0.75, t)[:, 0], [0.0, 0.02, 0.05])
    for g in prediction.grasps:
        torque += np.cross(surface.positions(g.u, t)[:, 0], g.reaction) + g.moment
    impulse = np.concatenate(
        [np.zeros((1, 3)), np.cumsum(0.5 * (torque[1:] + torque[:-1]) * np.diff(t)[:, None], axis=0)]
    )
    change = momentum(surface, MU, t)[1]
    off = (change - impulse)[len(t) // 8 :]  # from where the first waves, as the bent cable springs, are gone
    np.testing.assert_allclose(off, np.tile(off[0], (len(off), 1)), atol=2e-4 * np.abs(change).max())  # second order


def test_reactions_over_time_do_not_depend_on_the_step():
    def reaction(n_t: int) -> Floats:
        scene = without_table(paper_scene(0.25, quality=march(13, n_t)))
        hold = predict(scene).grasps[0]
        return np.array([np.interp(np.linspace(0.1, 1.5, 57), hold.times, hold.reaction[:, d]) for d in (0, 1)])

    coarse, fine = reaction(25), reaction(97)
    # second order of 125 steps, and axial waves: 1.1 %; a reaction half a step late would be off by 2.5 %
    assert np.abs(coarse - fine).max() < 1.7e-2 * np.abs(fine).max()
