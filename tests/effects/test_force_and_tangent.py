"""What every effect's compiled law owes: forces, tangents and energies that belong together, and no preferred frame."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from dlocore.effects import laws
from dlocore.effects.bend import Bend
from dlocore.effects.damping import Damping
from dlocore.effects.drag import QuadraticDrag
from dlocore.effects.stretch import Stretch, StretchDamping
from dlocore.kernels.assembly import NO_RATES, History, assemble, stored_energy
from dlocore.kernels.basis import Tables, graded_knots
from dlocore.kernels.entry import remember_start
from dlocore.problem.discretisation import room_for
from dlocore.spline import design_matrix
from tests.tables import plain_tables

Floats = NDArray[np.float64]
N_U, LENGTH = 9, 1.0
LAWS = {
    "stretch": (laws.STRETCH, Stretch(640.0)),
    "stretch damping": (laws.STRETCH_DAMPING, StretchDamping(3.0)),
    "bend": (laws.BEND, Bend(1e-3)),
    "damping": (laws.DAMPING, Damping(2e-3)),
    "quadratic drag": (laws.QUADRATIC_DRAG, QuadraticDrag(0.3)),
}
ELASTIC = ["stretch", "bend", "bend with memory"]
DIMENSIONS = pytest.mark.parametrize("nc", [2, 3], ids=["plane", "space"])
EVERY = pytest.mark.parametrize("name", [*LAWS, "bend with memory", "all"])


@dataclass(frozen=True)
class Body:
    """A discretised cable with some laws switched on."""

    nc: int
    knots: Floats
    tables: Tables
    active: NDArray[np.int64]
    parameters: Floats
    history: History
    rates: tuple[float, float, float, float] = NO_RATES

    def after(self, h: float, *steps: Floats) -> "Body":
        """Return this body with the rate of curvature by backward differences of step h from the two last `steps`."""
        for q in steps:
            remember_start(tuple(range(self.nc)), q, self.tables, self.active, self.parameters, self.history)
        return replace(self, rates=(1.5 / h, -2.0 / h, 0.5 / h, h))

    def forces(self, q: Floats, v: Floats) -> Floats:
        f = np.empty_like(q)
        assemble(*self._state(q, v), (0.0, 0.0, 0.0), f, np.empty((1, 1)))
        return f

    def tangent(self, q: Floats, v: Floats, scales: tuple[float, float, float]) -> Floats:
        """Return the dense tangent; the band holds the lower triangle by columns."""
        size = q.size
        band = np.empty((size, 4 * self.nc))
        assemble(*self._state(q, v), scales, np.empty_like(q), band)
        K = np.zeros((size, size))
        for o in range(4 * self.nc):
            j = np.arange(size - o)
            K[j + o, j] = K[j, j + o] = band[: size - o, o]
        return K

    def energy(self, q: Floats) -> float:
        axes = tuple(range(self.nc))
        return float(stored_energy(axes, q, self.tables, self.active, self.parameters, self.history))

    def _state(self, q: Floats, v: Floats) -> tuple:
        laws_at = (self.tables, self.active, self.parameters, self.history, self.rates)
        return tuple(range(self.nc)), q, v, *laws_at


def body(name: str, nc: int, n_u: int = N_U, rest: float = 0.0) -> Body:
    """Return a body with one law, or "all"; "bend with memory" is naturally curved by 3/L (in space: straight)."""
    feature = np.array([0.3])
    one = np.ones(1, np.int64)
    knots = graded_knots(n_u, LENGTH, feature, one, np.array([0.6]), np.array([0.02]))
    tables = plain_tables(knots)
    active, parameters = np.zeros(laws.COUNT, np.int64), np.zeros((laws.COUNT, laws.PARAMETERS))
    chosen = list(LAWS) if name == "all" else [name.removesuffix(" with memory")]
    for row, effect in (LAWS[c] for c in chosen):
        active[row] = 1
        values = effect.parameters()
        parameters[row, : len(values)] = values
    memory = np.zeros((len(tables.curvature.w), 2 if nc == 2 else 6))
    if name.endswith("memory") and nc == 2:
        memory[:] = rest or 3.0
    past = np.zeros((len(memory), 2 if nc == 2 else 9))
    none = np.zeros((0, 6)), np.zeros((0, 2)), np.zeros(0), np.zeros((0, 4)), np.zeros(room_for(nc, len(memory)))
    history = History(memory, past, np.zeros((len(tables.axial.w), 3)), *none)
    return Body(nc, knots, tables, active, parameters, history)


def bent(nc: int, n_u: int = N_U, seed: int = 7) -> tuple[Floats, Floats]:
    """Return a strained, bent, moving cable: control points and velocities (n_u, nc), with tension and compression."""
    rng = np.random.default_rng(seed)
    q = rng.normal(0.0, 0.03, (n_u, nc))
    q[:, 0] += np.linspace(0.0, LENGTH, n_u)
    q[:, 1] += 0.2 * np.sin(np.linspace(0.0, 5.0, n_u))
    return q, rng.normal(0.0, 0.5, (n_u, nc))


def differences(function, x: Floats, step: float) -> Floats:
    """Return central differences of a vector function by the components of x; (values, x.size)."""
    columns = []
    for i in range(x.size):
        e = np.zeros(x.size)
        e[i] = step
        e = e.reshape(x.shape)
        columns.append((np.ravel(function(x + e)) - np.ravel(function(x - e))) / (2 * step))
    return np.column_stack(columns)


@DIMENSIONS
@pytest.mark.parametrize("name", ELASTIC)
def test_force_is_the_gradient_of_the_stored_energy(name, nc):
    b = body(name, nc)
    q, v = bent(nc)
    f = b.forces(q, v).ravel()
    # rounding of the energy over the step, and step^2 of its third derivative: 1e-8 of the largest force
    np.testing.assert_allclose(differences(b.energy, q, 1e-6)[0], f, atol=1e-7 * np.abs(f).max())


@DIMENSIONS
@pytest.mark.parametrize("name", ELASTIC)
def test_tangent_is_the_derivative_of_the_force(name, nc):
    b = body(name, nc)
    q, v = bent(nc)
    K = b.tangent(q, v, (1.0, 0.0, 1.0))
    # rounding of the force over the step, and step^2 of its third derivative
    np.testing.assert_allclose(differences(lambda x: b.forces(x, v), q, 1e-6), K, atol=1e-7 * np.abs(K).max())


@DIMENSIONS
@EVERY
def test_damping_matrix_is_the_derivative_of_the_force_by_velocity(name, nc):
    b = body(name, nc)
    q, v = bent(nc)
    C = b.tangent(q, v, (0.0, 1.0, 0.0))
    # rounding of the force over the step; |v| v has a third derivative where v is small
    scale = max(np.abs(C).max(), 1e-3)
    exact = differences(lambda x: b.forces(q, x), v, 1e-6)
    if nc == 3 and b.active[laws.DAMPING]:
        # the spin of the sections, which depends on all of the cable, is not in the band (test_damping_in_space.py)
        np.testing.assert_allclose(exact, exact.T, atol=2e-7 * scale)
        assert np.linalg.eigvalsh(exact)[0] > -2e-7 * scale * len(C)
    else:
        np.testing.assert_allclose(exact, C, atol=2e-7 * scale)


@DIMENSIONS
def test_tangents_of_effects_add_up(nc):
    q, v = bent(nc)
    K = body("all", nc).tangent(q, v, (1.0, 37.0, 1.0))
    parts = sum(body(name, nc).tangent(q, v, (1.0, 37.0, 1.0)) for name in LAWS)
    np.testing.assert_allclose(K, parts, atol=1e-12 * np.abs(K).max())  # rounding of sums


@DIMENSIONS
@EVERY
def test_positive_part_of_the_tangent_has_no_negative_eigenvalue(name, nc):
    b = body(name, nc)
    for seed in range(5):
        q, v = bent(nc, seed=seed)
        for scales in ((1.0, 0.0, 0.0), (1.0, 37.0, 0.0), (0.0, 1.0, 0.0)):
            eigenvalues = np.linalg.eigvalsh(b.tangent(q, v, scales))
            assert eigenvalues[0] >= -1e-12 * max(eigenvalues[-1], 1.0)  # rounding


@DIMENSIONS
def test_full_tangent_of_a_compressed_cable_is_indefinite(nc):
    # the part that a buckling cable needs: a straight cable shortened by 5 %
    q = np.zeros((N_U, nc))
    b = body("stretch", nc)
    q[:, 0] = 0.95 * greville(b.knots)
    assert np.linalg.eigvalsh(b.tangent(q, 0 * q, (1.0, 0.0, 1.0)))[0] < -1.0
    assert np.linalg.eigvalsh(b.tangent(q, 0 * q, (1.0, 0.0, 0.0)))[0] > -1e-9


@DIMENSIONS
@EVERY
def test_forces_turn_and_shift_with_the_cable(name, nc):
    b = body(name, nc)
    q, v = bent(nc)
    R = Rotation.from_rotvec([0.3, -0.7, 0.5] if nc == 3 else [0.0, 0.0, 2.1]).as_matrix()[:nc, :nc]
    shift = np.array([1.0, -2.0, 0.5])[:nc]
    f, K = b.forces(q, v), b.tangent(q, v, (1.0, 37.0, 1.0))
    turned = np.kron(np.eye(N_U), R)
    # rounding at coordinates of a few metres, times the largest stiffness
    np.testing.assert_allclose(b.forces(q @ R.T + shift, v @ R.T), f @ R.T, atol=1e-11 * np.abs(K).max())
    np.testing.assert_allclose(
        b.tangent(q @ R.T + shift, v @ R.T, (1.0, 37.0, 1.0)), turned @ K @ turned.T, atol=1e-11 * np.abs(K).max()
    )
    if name in ELASTIC:
        assert b.energy(q @ R.T + shift) == pytest.approx(b.energy(q), rel=1e-11)


@pytest.mark.parametrize("name", [*LAWS, "all"])
def test_space_gives_the_same_forces_as_the_plane(name):
    q, v = bent(2)
    in_space = [np.column_stack([x, np.zeros(N_U)]) for x in (q, v)]
    b2, b3 = body(name, 2), body(name, 3)
    f, f3 = b2.forces(q, v), b3.forces(*in_space)
    scale = np.abs(b2.tangent(q, v, (1.0, 37.0, 1.0))).max()
    np.testing.assert_allclose(f3[:, :2], f, atol=1e-13 * scale)  # rounding
    np.testing.assert_array_equal(f3[:, 2], 0.0)


def greville(knots: Floats) -> Floats:
    """Return the control points [m] of u itself."""
    return (knots[1:-3] + knots[2:-2] + knots[3:-1]) / 3.0


def control_points_of(b: Body, curve) -> Floats:
    """Return the control points (n_u, nc) of the spline nearest to a curve."""
    u = np.linspace(0.0, LENGTH, 20 * len(b.knots))
    return np.ascontiguousarray(np.linalg.lstsq(design_matrix(b.knots, u), curve(u), rcond=None)[0][:, : b.nc])


def circle(kappa: float):
    return lambda u: np.column_stack([np.sin(kappa * u), 1.0 - np.cos(kappa * u), 0 * u]) / kappa


@DIMENSIONS
@pytest.mark.parametrize("name", ["stretch", "bend", "damping", "all"])
def test_a_straight_cable_at_rest_bears_no_force(name, nc):
    b = body(name, nc)
    q = np.zeros((N_U, nc))
    q[:, : 3 if nc == 3 else 2] = greville(b.knots)[:, None] * np.array([0.6, 0.8, 0.0])[:nc]
    f = b.forces(q, 0 * q)
    assert np.abs(f).max() < 1e-11  # rounding of a strain of 1e-15, times EA
    assert b.energy(q) < 1e-24


def test_a_naturally_curved_cable_at_rest_stores_no_energy():
    b = body("bend with memory", 2, n_u=33)
    q = control_points_of(b, circle(3.0))
    # the square of what a cubic spline misses of a circle's curvature
    assert b.energy(q) < 1e-6 * body("bend", 2, n_u=33).energy(q)


@DIMENSIONS
def test_a_circle_stores_half_ei_kappa_squared(nc):
    b = body("bend", nc, n_u=33)
    exact = 0.5 * 1e-3 * 3.0**2 * LENGTH
    # the curvature of a cubic spline misses (kappa h)^2/24 of a circle's, here 1e-4 of it on average
    assert b.energy(control_points_of(b, circle(3.0))) == pytest.approx(exact, rel=2e-4)


@DIMENSIONS
def test_a_stretched_cable_pulls_with_ea_times_strain(nc):
    b = body("stretch", nc)
    q = np.zeros((N_U, nc))
    q[:, 0] = 1.01 * greville(b.knots)
    f = b.forces(q, 0 * q)
    assert f[-1, 0] == pytest.approx(6.4, rel=1e-12)
    assert f[0, 0] == pytest.approx(-6.4, rel=1e-12)
    # inside, one point a span leaves forces that do no work in an even stretch (and vanish on even knots)
    assert f[:, 0] @ greville(b.knots) == pytest.approx(6.4 * LENGTH, rel=1e-12)
    assert b.energy(q) == pytest.approx(0.5 * 640.0 * 0.01**2, rel=1e-12)


@DIMENSIONS
def test_quadratic_drag_of_a_drifting_cable(nc):
    b = body("quadratic drag", nc)
    q, _ = bent(nc)
    v = np.tile(np.array([0.3, -2.0, 0.6])[:nc], (N_U, 1))
    speed = np.linalg.norm(v[0])
    np.testing.assert_allclose(b.forces(q, v).sum(axis=0), 0.3 * speed * v[0], rtol=1e-12)  # rounding


def test_quadratic_drag_at_rest_is_smooth():
    b = body("quadratic drag", 3)
    q, _ = bent(3)
    assert not b.forces(q, 0 * q).any()
    assert not b.tangent(q, 0 * q, (0.0, 1.0, 0.0)).any()


def power(b: Body, q: Floats, v: Floats) -> float:
    return float((b.forces(q, v) * v).sum())


@DIMENSIONS
def test_damping_takes_eta_times_rate_of_curvature_squared(nc):
    # a circle that tightens at d(kappa)/dt = 2/(m s)
    b = body("damping", nc, n_u=33)
    rate, step = 2.0, 1e-4
    q = control_points_of(b, circle(3.0))
    v = (control_points_of(b, circle(3.0 + step)) - control_points_of(b, circle(3.0 - step))) / (2 * step) * rate
    # the spline's curvature, as above
    assert power(b, q, v) == pytest.approx(2e-3 * rate**2 * LENGTH, rel=2e-4)


@DIMENSIONS
def test_damping_does_no_work_in_a_rigid_swing(nc):
    b = body("damping", nc)
    rng = np.random.default_rng(3)
    for seed in range(5):
        q, _ = bent(nc, seed=seed)
        spin = rng.normal(0.0, 3.0, 3) if nc == 3 else np.array([0.0, 0.0, 5.0])
        in_space = np.zeros((N_U, 3))
        in_space[:, :nc] = q
        v = np.ascontiguousarray((np.cross(spin, in_space) + rng.normal(size=3))[:, :nc])
        assert abs(power(b, q, v)) < 1e-12  # rounding


@DIMENSIONS
def test_axial_damping_takes_its_coefficient_times_the_rate_of_strain_squared(nc):
    # a straight cable that lengthens at 2/s: N = 3 N s x 2/s
    b = body("stretch damping", nc)
    q = np.zeros((N_U, nc))
    q[:, 0] = greville(b.knots)
    assert power(b, q, 2.0 * q) == pytest.approx(3.0 * 2.0**2 * LENGTH, rel=1e-12)  # rounding


@DIMENSIONS
def test_axial_damping_does_no_work_in_a_rigid_swing(nc):
    b = body("stretch damping", nc)
    for seed in range(5):
        q, _ = bent(nc, seed=seed)
        spin = np.array([1.0, -2.0, 3.0]) if nc == 3 else np.array([0.0, 0.0, 5.0])
        in_space = np.zeros((N_U, 3))
        in_space[:, :nc] = q
        v = np.ascontiguousarray((np.cross(spin, in_space) + np.array([0.3, -2.0, 0.6]))[:, :nc])
        assert abs(power(b, q, v)) < 1e-12  # rounding


@DIMENSIONS
def test_axial_damping_by_differences_has_a_potential(nc):
    # so its tangent, material and geometric, is all of dF/dq
    q, v = bent(nc)
    h = 0.01
    b = body("stretch damping", nc).after(h, q - 0.02 * v, q - 0.01 * v)
    K = b.tangent(q, v, (1.0, 1.5 / h, 1.0))
    np.testing.assert_allclose(differences(lambda x: b.forces(x, v), q, 1e-6), K, atol=1e-7 * np.abs(K).max())


def test_damping_by_differences_has_a_potential_in_the_plane():
    # so its tangent, material and geometric, is all of dF/dq
    q, v = bent(2)
    h = 0.01
    b = body("damping", 2).after(h, q - 0.02 * v, q - 0.01 * v)
    K = b.tangent(q, v, (1.0, 1.5 / h, 1.0))
    np.testing.assert_allclose(differences(lambda x: b.forces(x, v), q, 1e-6), K, atol=1e-7 * np.abs(K).max())


@DIMENSIONS
@pytest.mark.parametrize("name", ["damping", "stretch damping"])
def test_damping_by_differences_tends_to_that_by_velocity(name, nc):
    q, v = bent(nc)
    exact = body(name, nc).forces(q, v)
    errors = []
    for h in (1e-3, 5e-4):
        f = body(name, nc).after(h, q - 2 * h * v, q - h * v).forces(q, v)
        errors.append(np.abs(f - exact).max() / np.abs(exact).max())
    assert errors[1] < 1e-3
    assert 1.8 < np.log2(errors[0] / errors[1]) < 2.2  # second order


@DIMENSIONS
def test_axial_damping_by_differences_does_no_work_in_a_rigid_turn(nc):
    q, _ = bent(nc)
    h = 1e-2
    turned = [q @ Rotation.from_rotvec([0.0, 0.0, k * h * 5.0]).as_matrix()[:nc, :nc].T for k in (-2, -1, 0)]
    b = body("stretch damping", nc).after(h, *turned[:2])
    assert np.abs(b.forces(turned[2], 0 * q)).max() < 1e-10  # rounding / h, however long the step


@DIMENSIONS
def test_damping_by_differences_does_no_work_in_a_rigid_turn(nc):
    q, _ = bent(nc)
    h = 1e-3
    spin = np.array([1.0, -2.0, 3.0]) if nc == 3 else np.array([0.0, 0.0, 5.0])
    turned = [q @ Rotation.from_rotvec(k * h * spin).as_matrix()[:nc, :nc].T for k in (-2, -1, 0)]
    b = body("damping", nc).after(h, *turned[:2])
    v = (turned[2] - turned[1]) / h
    assert abs(power(b, q, v)) < 1e-9  # rounding / h


@DIMENSIONS
@pytest.mark.parametrize("shape", ["straight", "inflected"])
def test_energy_and_forces_are_continuous_at_zero_curvature(shape, nc):
    # Frenet torsion, undefined there, made the twist energy of a straight cable jump by 0.1 J under such noise
    b = body("all", nc)
    q = np.zeros((N_U, nc))
    q[:, 0] = greville(b.knots)
    if shape == "inflected":
        q[:, 1] = 0.1 * np.sin(2 * np.pi * q[:, 0])
    rng = np.random.default_rng(11)
    v = rng.normal(0.0, 0.5, q.shape)
    if nc == 3 and shape == "straight":
        # of a straight cable as a whole only steps tell how it got there, and with it how its sections spin
        b = b.after(0.01, q - 0.02 * v, q - 0.01 * v)
    f, energy = b.forces(q, v), b.energy(q)
    K = b.tangent(q, v, (1.0, 37.0, 1.0))
    for size in (1e-12, 1e-9, 1e-6):
        noise = size * rng.normal(size=q.shape)
        assert abs(b.energy(q + noise) - energy) <= 10 * np.abs(f).max() * size * N_U + 10 * np.abs(K).max() * size**2
        change = np.abs(b.forces(q + noise, v) - f).max()
        assert change <= 50 * np.abs(K).max() * size + 1e-11  # Lipschitz with the stiffness, plus rounding
        assert np.abs(b.tangent(q + noise, v, (1.0, 37.0, 1.0)) - K).max() <= 1e3 * np.abs(K).max() * size + 1e-9
