"""Bending damping in space without a twist coordinate: what sections that do not twist see (docs/model.md eq. 9)."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from benchmarks.rod import simulate
from dlocore import Cable, ControlPoints, Environment, Grasp, Quality, Scene, Waypoints, predict
from dlocore.effects import laws
from dlocore.effects.damping import Damping
from dlocore.kernels.assembly import NO_RATES, History, assemble
from dlocore.kernels.entry import remember_start
from dlocore.problem.discretisation import room_for
from dlocore.sensitivity import sensitivities
from dlocore.spline import design_matrix, uniform_knots
from tests.tables import plain_tables

Floats = NDArray[np.float64]
ETA, LENGTH = 2e-3, 1.0
AXES = (0, 1, 2)


class Damped:
    """A cable that has nothing but bending damping."""

    def __init__(self, n_u: int) -> None:
        self.knots = uniform_knots(n_u, LENGTH)
        self.tables = plain_tables(self.knots)
        self.active, self.parameters = np.zeros(laws.COUNT, np.int64), np.zeros((laws.COUNT, laws.PARAMETERS))
        self.active[laws.DAMPING], self.parameters[laws.DAMPING, 0] = 1, Damping(ETA).parameters()[0]

    def forces(self, q: Floats, v: Floats | None = None, past: tuple[Floats, ...] = (), h: float = 0.0) -> Floats:
        """Return the forces (n_u, 3) at a velocity, or by differences of step h from the two states of the `past`."""
        points = len(self.tables.curvature.w)
        history = History(
            np.zeros((points, 6)), np.zeros((points, 9)), np.zeros((len(self.tables.axial.w), 3)), np.zeros((0, 6)),
            np.zeros((0, 2)), np.zeros(0), np.zeros((0, 4)), np.zeros(room_for(3, points)),
        )  # fmt: skip
        for x in past:
            remember_start(AXES, x, self.tables, self.active, self.parameters, history)
        rates = (1.5 / h, -2.0 / h, 0.5 / h, h) if past else NO_RATES
        f = np.empty_like(q)
        assemble(
            AXES, q, np.zeros_like(q) if v is None else v, self.tables, self.active, self.parameters, history, rates,
            (0.0, 0.0, 0.0), f, np.empty((1, 1)),
        )  # fmt: skip
        return f

    def spline(self, curve: Callable[[Floats], Floats]) -> Floats:
        """Return the control points (n_u, 3) of the spline nearest to a curve."""
        u = np.linspace(0.0, LENGTH, 20 * len(self.knots))
        return np.asarray(np.linalg.lstsq(design_matrix(self.knots, u), curve(u), rcond=None)[0])


def coil(u: Floats) -> Floats:
    """Return points (k, 3) of a helix at the arclengths u (k,)."""
    turned = 0.12 * np.column_stack([np.cos(6 * u), np.sin(6 * u)])
    return np.column_stack([turned, np.sqrt(1.0 - (6 * 0.12) ** 2) * u])


def swing(u: Floats) -> Floats:
    return np.column_stack([np.sin(3 * u), 1.0 - np.cos(4 * u), u**2 * (1.0 - u)])


def least_power(knots: Floats, q: Floats, v: Floats, offset: float = 0.0) -> float:
    """Return eta times the integral of |D|^2, by 4000 points and the differential equation of the spin.

    `offset` is added to the spin of all sections [rad/s]; without it the power is the least.
    """
    u = (np.arange(4000) + 0.5) / 4000 * LENGTH
    a, c, da, dc = (design_matrix(knots, u, o) @ x for x in (q, v) for o in (1, 2))
    length = np.linalg.norm(a, axis=1)[:, None]
    t = a / length

    def across(x: Floats) -> Floats:
        return np.asarray(x - (x * t).sum(axis=1)[:, None] * t)

    turning = across(da) / length
    kappa = across(c) / length
    # d/dt of (c - (t.c) t)/l
    rate = across(dc - (t * c).sum(axis=1)[:, None] * turning) / length - kappa * (da * t).sum(axis=1)[:, None] / length
    spin = np.cumsum((t * np.cross(turning, kappa)).sum(axis=1)) * LENGTH / len(u)
    side = np.cross(t, kappa)
    rate = rate - spin[:, None] * side
    rate -= ((rate * side).sum() / (side**2).sum() + offset) * side
    return float(ETA * (rate**2).sum() * LENGTH / len(u))


def test_the_power_is_the_integral_of_the_rate_that_the_sections_see() -> None:
    errors = []
    for n_u in (17, 33):
        b = Damped(n_u)
        q, v = b.spline(coil), b.spline(swing)
        power = float((b.forces(q, v) * v).sum())
        errors.append(abs(power / least_power(b.knots, q, v) - 1.0))
    # tangents 0.03 apart, joined by great circles, miss (0.03 kappa)^2/12 of the spin; the spline's curvature more
    assert errors[0] < 3e-3
    assert errors[1] < 0.3 * errors[0]


def test_no_other_spin_of_the_sections_takes_less_power() -> None:
    b = Damped(17)
    q, v = b.spline(coil), b.spline(swing)
    least = least_power(b.knots, q, v)
    assert all(least_power(b.knots, q, v, offset) > least for offset in (-0.1, -0.01, 0.01, 0.1))


def test_forces_neither_push_nor_turn_the_cable_as_a_whole() -> None:
    b = Damped(17)
    q, v = b.spline(coil), b.spline(swing)
    h = 2e-3
    for f in (b.forces(q, v), b.forces(q, past=(q - 2 * h * v, q - h * v), h=h)):
        scale = np.abs(f).max()
        assert np.abs(f.sum(axis=0)).max() < 1e-12 * scale  # rounding
        # steps: what the spin can't explain, (h |D|/|kappa|)^2/2 of the curvature, counts cubed
        assert np.abs(np.cross(q, f).sum(axis=0)).max() < 1e-9 * scale


@pytest.mark.parametrize("angle", [1e-3, 0.3, 1.3])
def test_a_rigid_motion_costs_nothing_in_steps_of_any_size(angle: float) -> None:
    b = Damped(17)
    q = b.spline(coil)
    axis = np.array([0.6, -0.5, 0.7]) / np.linalg.norm([0.6, -0.5, 0.7])
    turned = [q @ Rotation.from_rotvec(k * angle * axis).as_matrix().T + k for k in range(3)]
    h = 0.01
    f = b.forces(turned[2], past=(turned[0], turned[1]), h=h)
    # rounding; a curvature of 6/m that did not turn would give eta kappa/h n_u = 20 N
    assert np.abs(f).max() < 1e-9


def test_a_motion_in_a_tilted_plane_is_that_in_the_plane() -> None:
    # also through a straight line, where the bend turns over from one step to the next
    b = Damped(13)
    turn = Rotation.from_rotvec([0.4, -0.8, 0.3]).as_matrix()
    h = 0.01
    flat = [b.spline(lambda u, s=s: np.column_stack([u, s * np.sin(5 * u), 0 * u])) for s in (-0.03, -0.01, 0.02)]
    f = b.forces(flat[2], past=(flat[0], flat[1]), h=h)
    tilted = b.forces(flat[2] @ turn.T, past=tuple(x @ turn.T for x in flat[:2]), h=h)
    scale = np.abs(f).max()
    np.testing.assert_allclose(tilted, f @ turn.T, atol=1e-9 * scale)  # rounding of second derivatives
    assert np.abs(f[:, 2]).max() < 1e-12 * scale
    # the curvature's rate has one component: twice the amplitude's rate, twice the force
    double = [b.spline(lambda u, s=s: np.column_stack([u, s * np.sin(5 * u), 0 * u])) for s in (-1e-6, 0.0, 1e-6)]
    once = [b.spline(lambda u, s=s: np.column_stack([u, s * np.sin(5 * u), 0 * u])) for s in (0.0, 0.5e-6, 1e-6)]
    twice, half = (b.forces(x[2], past=(x[0], x[1]), h=h) for x in (double, once))
    # all three are bent by at most 1e-6, which is its relative error; rounding is 1e-10 of a curvature of 3e-5
    np.testing.assert_allclose(twice, 2.0 * half, atol=1e-5 * np.abs(twice).max())


def shaken(twist: str, n_u: int = 17, **changes: float) -> Scene:
    """Return a coiled cable that one gripper shakes along three axes, with strong internal damping."""
    times = np.linspace(0.0, 0.8, 81)
    ramp = np.minimum(times / 0.3, 1.0) ** 2
    shift = ramp[:, None] * np.column_stack(
        [0.1 * np.sin(9 * times), 0.1 * np.sin(7 * times), 0.05 * np.sin(11 * times)]
    )
    knots = uniform_knots(13, LENGTH)
    u = np.linspace(0.0, LENGTH, 400)
    q = np.linalg.lstsq(design_matrix(knots, u), coil(u), rcond=None)[0]
    values = {"bending_stiffness": 3e-3, "bending_damping": ETA, "torsional_stiffness": 0.3} | changes
    return Scene(
        cable=Cable(length=LENGTH, diameter=0.006, linear_density=0.05, axial_stiffness=600.0, **values),
        shape=ControlPoints(control_points=q, knots=knots),
        grasps=(Grasp(u=0.0, hold="tangent", path=Waypoints(times=times, positions=q[0] + shift)),),
        environment=Environment(drag=0.06),
        effects={"twist": twist, "inertia": "on"},  # type: ignore[dict-item]
        quality=Quality(n_u=n_u, n_t=81, method="march", estimate=False),
    )


U, T = np.linspace(0.0, LENGTH, 21), np.linspace(0.0, 0.8, 21)


def motion(scene: Scene) -> Floats:
    prediction = predict(scene)
    # a fine net of a strongly damped cable is where the spin weighs most in the equations of a step
    assert prediction.said == "Every time step found its equilibrium."
    notes = prediction.message.split("Note: ")[1:]
    # a span is strained between the points at which the march looks, or bends more sharply than 17 control points show
    known = ("the surface stretches the cable", "the cable bends beside primitives[0] more sharply")
    assert all(note.startswith(known) for note in notes)
    return np.asarray(prediction.surface(U, T)[..., :3])


def test_a_cable_that_hardly_twists_moves_as_one_without_twist() -> None:
    free = motion(shaken("off"))
    effect = np.abs(motion(shaken("off", bending_damping=0.0)) - free).max()
    assert effect > 0.1
    # GJ is a hundred times EI, and three hundred: what twist is left falls to a third
    stiff, stiffer = (np.abs(motion(shaken("on", torsional_stiffness=GJ)) - free).max() for GJ in (0.3, 0.9))
    assert stiff < 0.02 * effect
    assert stiffer < 0.5 * stiff


def test_damped_motions_converge_with_the_net_as_fast_as_undamped_ones() -> None:
    found = {n: motion(shaken("off", n)) for n in (17, 33, 65)}
    errors = [np.abs(found[n] - found[65]).max() for n in (17, 33)]
    assert errors[0] < 1e-3 * LENGTH
    assert errors[1] < 0.25 * errors[0]  # at least second order


def test_the_motion_is_that_of_an_explicit_rod_with_the_same_law() -> None:
    marched = motion(shaken("off", 33))
    errors = []
    for elements in (20, 40):
        _, _, r = simulate(shaken("off"), elements=elements, times=T)
        errors.append(np.abs(r[:, :: elements // 20] - marched).max())
    # (kappa h)^2/12 of a motion of 1 m on 40 edges, and second order
    assert errors[1] < 3e-3
    assert errors[1] < 0.35 * errors[0]


def test_sensitivities_of_a_damped_motion_in_space_are_exact() -> None:
    prediction = predict(shaken("off"))
    names = ["cable.bending_damping", "cable.bending_stiffness", "environment.drag"]
    found = sensitivities(prediction, names)
    assert found.exact == (True,) * 3, found.reason
    step = 1e-3 * ETA
    above, below = (motion(shaken("off", bending_damping=ETA + s)) for s in (step, -step))
    difference = (above - below) / (2.0 * step)
    # the tolerance of the marches over a thousandth of the damping, and the square of that step
    np.testing.assert_allclose(found(U, T)[0], difference, atol=1e-3 * np.abs(difference).max())
