"""Forces and tangents of a cable with twist: derivatives of one energy, against frames that are carried along."""

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from dlocore import SplineSurface
from dlocore.effects import laws
from dlocore.effects.bend import Bend
from dlocore.effects.stretch import Stretch
from dlocore.effects.twist import Twist
from dlocore.kernels.assembly import NO_RATES, History, assemble, stored_energy
from dlocore.kernels.basis import graded_knots
from dlocore.kernels.entry import remember_start
from dlocore.kernels.twisted import start_frames
from dlocore.kernels.twisted_rows import LAST, PAST
from dlocore.problem.discretisation import room_for
from tests.tables import plain_tables

Floats = NDArray[np.float64]
N_U, LENGTH = 9, 1.0
RADIUS = Twist(1.0, 0.005).radius
AXES = (0, 1, 2, 3)


class Body:
    """A discretised cable with stretch, bending and twist, and a bent and twisted stress-free shape."""

    def __init__(self, remembered: bool = True) -> None:
        one = np.ones(1, np.int64)
        self.knots = graded_knots(N_U, LENGTH, np.array([0.3]), one, np.array([0.6]), np.array([0.02]))
        self.tables = plain_tables(self.knots)
        self.active = np.zeros(laws.COUNT, np.int64)
        self.p = np.zeros((laws.COUNT, laws.PARAMETERS))
        effects = ((laws.STRETCH, Stretch(60.0)), (laws.BEND, Bend(1e-3)), (laws.TWIST, Twist(2e-3, 0.005)))
        for row, effect in effects:
            self.active[row] = 1
            self.p[row, : len(effect.parameters())] = effect.parameters()
        points = len(self.tables.curvature.w)
        memory = np.tile([2.0, -1.0, 0.7, 2.0, -1.0, 0.7], (points, 1)) * remembered
        axial = np.zeros((len(self.tables.axial.w), 3))
        self.history = History(
            memory, np.zeros((points, PAST)), axial, np.zeros((0, 6)), np.zeros((0, 2)), np.zeros(0), np.zeros((0, 4)),
            np.zeros(room_for(4, points)),
        )  # fmt: skip

    def carry_frames(self, q: Floats) -> None:
        start_frames(self.knots, q, self.tables.curvature, np.array([0.0, 1.0, 0.2]), self.history.past)

    def energy(self, q: Floats) -> float:
        return float(stored_energy(AXES, q, self.tables, self.active, self.p, self.history))

    def forces(self, q: Floats) -> Floats:
        f = np.empty_like(q)
        self._assemble(q, (0.0, 0.0, 0.0), f, np.empty((1, 1)))
        return f

    def tangent(self, q: Floats, geometric: float) -> Floats:
        band = np.empty((4 * N_U, 16))
        self._assemble(q, (1.0, 0.0, geometric), np.empty_like(q), band)
        K = np.zeros((4 * N_U, 4 * N_U))
        for o in range(16):
            j = np.arange(4 * N_U - o)
            K[j + o, j] = K[j, j + o] = band[: 4 * N_U - o, o]
        return K

    def remember(self, q: Floats) -> None:
        remember_start(AXES, q, self.tables, self.active, self.p, self.history)

    def _assemble(self, q: Floats, scales: tuple[float, float, float], f: Floats, K: Floats) -> None:
        assemble(AXES, q, 0 * q, self.tables, self.active, self.p, self.history, NO_RATES, scales, f, K)


def bent(body: Body, seed: int = 7) -> Floats:
    """Return a strained, bent and twisted cable (N_U, 4)."""
    rng = np.random.default_rng(seed)
    q = np.zeros((N_U, 4))
    q[:, 0] = (body.knots[1:-3] + body.knots[2:-2] + body.knots[3:-1]) / 3.0
    q[:, 1], q[:, 2] = 0.2 * np.sin(3 * q[:, 0]), 0.2 * np.cos(4 * q[:, 0])
    q[:, 3] = RADIUS * 1.5 * np.sin(5 * q[:, 0])
    q[:, :3] += 0.02 * rng.normal(size=(N_U, 3))
    return q


def moved(q: Floats, size: float, seed: int = 3) -> Floats:
    rng = np.random.default_rng(seed)
    return q + size * rng.normal(size=q.shape) * [1.0, 1.0, 1.0, RADIUS]


def differences(function, q: Floats) -> Floats:
    """Return central differences by the components of q; (values, q.size)."""
    columns = []
    for i in range(q.size):
        e = np.zeros(q.size)
        e[i] = 1e-6
        e = e.reshape(q.shape)
        columns.append((np.ravel(function(q + e)) - np.ravel(function(q - e))) / 2e-6)
    return np.column_stack(columns)


@pytest.mark.parametrize("away", [0.0, 0.02], ids=["at the frames", "away from the frames"])
def test_force_is_the_gradient_of_the_energy_however_far_the_frames_are_carried(away):
    body = Body()
    q = bent(body)
    body.carry_frames(q)
    q = moved(q, away)
    f = body.forces(q).ravel()
    # rounding of the energy over the step, and step^2 of its third derivative
    np.testing.assert_allclose(differences(body.energy, q)[0], f, atol=1e-7 * np.abs(f).max())


def test_tangent_is_the_derivative_of_the_force_at_the_frames():
    body = Body()
    q = bent(body)
    body.carry_frames(q)
    K = body.tangent(q, 1.0)
    np.testing.assert_allclose(differences(body.forces, q), K, atol=1e-7 * np.abs(K).max())


def test_tangent_away_from_the_frames_is_off_by_less_the_nearer_they_are():
    body = Body()
    start = bent(body)
    errors = []
    for size in (0.01, 0.005):
        body.carry_frames(start)
        q = moved(start, size)
        errors.append(np.abs(differences(body.forces, q) - body.tangent(q, 1.0)).max())
    assert errors[1] < 0.7 * errors[0]  # first order or better


def test_positive_part_has_no_negative_eigenvalue():
    body = Body()
    for seed in range(5):
        q = bent(body, seed)
        body.carry_frames(q)
        eigenvalues = np.linalg.eigvalsh(body.tangent(moved(q, 0.02), 0.0))
        assert eigenvalues[0] >= -1e-12 * eigenvalues[-1]  # rounding


def test_carrying_the_frames_on_changes_no_strain():
    body = Body(remembered=False)
    q = bent(body)
    body.carry_frames(q)
    q = moved(q, 0.02)
    before = body.energy(q)
    body.remember(q)
    strain = body.history.past[:, LAST : LAST + 3].copy()
    body.remember(q)
    assert body.energy(q) == pytest.approx(before, rel=1e-12)  # rounding
    np.testing.assert_allclose(body.history.past[:, LAST : LAST + 3], strain, atol=1e-12 * np.abs(strain).max())


def test_sections_of_a_bent_stress_free_shape_turn_by_what_theta_misses_and_no_other_strain_changes():
    # the energy changes here, as the bend of the sections turns against that of their stress-free shape
    plain, body = Body(remembered=False), Body()
    q = bent(body)
    for one in (plain, body):
        one.carry_frames(q)
    q = moved(q, 0.02)
    for one in (plain, body):
        one.remember(q)
    known, found = (one.history.past[:, LAST : LAST + 3].copy() for one in (plain, body))
    turned = np.abs((found - known)[:, :2]).max()
    assert turned > 1e-3 * np.abs(known[:, :2]).max()  # there is something to turn
    np.testing.assert_allclose(found[:, 2], known[:, 2], rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(np.hypot(*found.T[:2]), np.hypot(*known.T[:2]), rtol=1e-12)
    energy = body.energy(q)
    body.remember(q)  # what was kept is measured, and there is no more to keep
    assert body.energy(q) == pytest.approx(energy, rel=1e-12)
    np.testing.assert_allclose(body.history.past[:, LAST : LAST + 3], found, atol=1e-12 * np.abs(found).max())


def angle_between(a: Floats, b: Floats, axis: Floats) -> float:
    return float(np.arctan2(np.cross(a, b) @ axis, a @ b))


def test_frames_carried_in_time_have_the_twist_that_frames_without_twist_along_the_cable_miss():
    # the sections do not turn against the carried frames: their twist is all that eq. 19 gathers on the way
    body, fresh = Body(remembered=False), Body(remembered=False)
    q = bent(body)
    u = q[:, 0] = (body.knots[1:-3] + body.knots[2:-2] + body.knots[3:-1]) / 3.0
    q[:, 1], q[:, 2], q[:, 3] = 0.2 * np.sin(3 * u), 0.2 * np.cos(3 * u), 0.0
    body.carry_frames(q)
    body.remember(q)
    end = q.copy()
    end[:, 1] += 0.2 * np.cos(2 * u)
    end[:, 2] -= 0.2 * np.sin(3 * u)
    for s in np.linspace(0.0, 1.0, 21)[1:]:
        body.remember(q + s * (end - q))
    fresh.carry_frames(end)
    turned = [angle_between(b[6:9], a[6:9], b[:3]) for a, b in zip(body.history.past, fresh.history.past, strict=True)]
    rate = body.history.past[:, LAST + 2]
    u = body.tables.curvature.u
    total = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(u))])
    assert np.ptp(total) > 0.02  # there is something to compare
    # the trapezoidal sum over points up to 8 cm apart
    np.testing.assert_allclose(np.unwrap(turned) - turned[0], total, atol=0.02 * np.ptp(total))


def test_energy_does_not_know_where_the_cable_is_or_how_it_is_turned():
    body = Body(remembered=False)
    q = bent(body)
    body.carry_frames(q)
    energy = body.energy(q)
    R = Rotation.from_rotvec([0.3, -0.7, 0.5]).as_matrix()
    turned = q.copy()
    turned[:, :3] = q[:, :3] @ R.T + [1.0, -2.0, 0.5]
    body.carry_frames(turned)
    assert body.energy(turned) == pytest.approx(energy, rel=1e-11)  # rounding at coordinates of a few metres


@pytest.mark.parametrize("shape", ["straight", "inflected"])
def test_energy_and_forces_are_continuous_at_zero_curvature(shape):
    # the Frenet torsion, undefined there, made the twist energy of a straight cable jump by 0.1 J under such noise
    body = Body(remembered=False)
    q = bent(body)
    q[:, 1:3] = 0.0
    if shape == "inflected":
        q[:, 1] = 0.1 * np.sin(2 * np.pi * q[:, 0])
    body.carry_frames(q)
    energy, f, K = body.energy(q), body.forces(q), body.tangent(q, 1.0)
    steepest, stiffest = np.abs(f).max(), np.abs(K).max()
    for size in (1e-12, 1e-9, 1e-6):
        noise = moved(0 * q, size, seed=11)
        change = 10 * steepest * size * N_U + 100 * stiffest * size**2
        assert abs(body.energy(q + noise) - energy) <= change + 1e-15
        assert np.abs(body.forces(q + noise) - f).max() <= 50 * stiffest * size + 1e-11


def test_the_papers_frenet_twist_of_a_nearly_straight_cable_is_noise():
    body = Body()
    control = np.zeros((4, N_U, 4))
    control[..., 0] = bent(body)[:, 0]
    control[..., 1:3] = 1e-6 * np.random.default_rng(5).normal(size=(1, N_U, 2))
    surface = SplineSurface(control, body.knots, np.array([0.0] * 4 + [1.0] * 4))
    u = np.linspace(0.05, 0.95, 50)
    assert np.abs(surface.twist_rate(u, [0.0])).max() == 0.0
    assert np.abs(surface.frenet_twist(u, [0.0], 1e-9)).max() > 10.0  # rad/m, of a cable straight to a micrometre
    assert np.abs(surface.frenet_twist(u, [0.0], 1.0)).max() < 1e-3  # the regularisation removes it, and all twist
