"""Bending vibrations of small amplitude against the exact modes of a beam."""

import numpy as np
import pytest
from scipy.interpolate import make_interp_spline
from scipy.optimize import brentq

from dlocore import ControlPoints, Grasp, Scene, predict
from tests.solver.scenes import WEIGHTLESS, Floats, cable, march

EI, MU, AMPLITUDE = 1e-3, 0.05, 1e-4
FREE, CLAMPED = "free-free", "clamped-free"
MODES = [(FREE, 4.73004), (FREE, 7.85320), (FREE, 10.99561), (CLAMPED, 1.87510), (CLAMPED, 4.69409), (CLAMPED, 7.85476)]


def mode(ends: str, beta: float, u: Floats) -> Floats:
    """Return the mode shape at u, largest value 1; beta solves cos(b) cosh(b) = 1 (free-free) or -1 (clamped-free)."""
    target = 1.0 if ends == FREE else -1.0
    b = brentq(lambda x: np.cos(x) - target / np.cosh(x), beta - 0.01, beta + 0.01)
    c, s, ch, sh = np.cos(b * u), np.sin(b * u), np.cosh(b * u), np.sinh(b * u)
    if ends == FREE:
        y = ch + c - (np.cosh(b) - np.cos(b)) / (np.sinh(b) - np.sin(b)) * (sh + s)
    else:
        y = ch - c - (np.cosh(b) + np.cos(b)) / (np.sinh(b) + np.sin(b)) * (sh - s)
    return y / 2.0


def vibration(ends: str, beta: float, damping: float = 0.0, tilt: float = 0.0) -> tuple[Floats, Floats]:
    """Return phases omega t (33,) over one period and the share of the mode that the predicted cable has then."""
    omega = beta**2 * np.sqrt(EI / MU)
    at = np.linspace(0.0, 1.0, 33)
    shape = np.column_stack([at, AMPLITUDE * mode(ends, beta, at), 0 * at])
    turn = np.array([[np.cos(tilt), 0, np.sin(tilt)], [0, 1, 0], [-np.sin(tilt), 0, np.cos(tilt)]])
    spline = make_interp_spline(at, shape @ turn.T, k=3)
    scene = Scene(
        cable=cable(bending_damping=damping),
        shape=ControlPoints(control_points=spline.c, knots=spline.t),
        grasps=(Grasp(u=0.0, hold="tangent"),) if ends == CLAMPED else (),
        environment=WEIGHTLESS,
        horizon=2 * np.pi / omega,
        quality=march(25, 65),
    )
    prediction = predict(scene)
    assert prediction.status == "converged"
    u, t = np.linspace(0.0, 1.0, 201), np.linspace(0.0, scene.horizon, 33)
    y = prediction.surface.positions(u, t)[..., 1]
    shares = np.trapezoid(y * mode(ends, beta, u), u, axis=1) / np.trapezoid(mode(ends, beta, u) ** 2, u)
    return omega * t, shares / AMPLITUDE


@pytest.mark.parametrize(("ends", "beta"), MODES)
def test_bending_modes_vibrate_at_their_exact_frequencies(ends, beta):
    phase, share = vibration(ends, beta)
    # 325 steps a period make the period 2 (pi/325)^2/3 = 6e-5 too long, 4e-4 rad at its end; the spline's third mode
    # and the damping of the scheme at rho = 0.9 are smaller
    np.testing.assert_allclose(share, np.cos(phase), atol=1e-3)


def test_internal_damping_shrinks_a_mode_by_its_logarithmic_decrement():
    # y'' + 2 b y' + w^2 y = 0 with 2 b = w^2 eta/EI
    beta, relaxation = 1.87510, 0.05
    omega = beta**2 * np.sqrt(EI / MU)
    b = 0.5 * omega**2 * relaxation
    damped = np.sqrt(omega**2 - b**2)
    phase, share = vibration(CLAMPED, beta, damping=EI * relaxation)
    t = phase / omega
    exact = np.exp(-b * t) * (np.cos(damped * t) + b / damped * np.sin(damped * t))
    np.testing.assert_allclose(share, exact, atol=1e-3)  # as above


def test_a_mode_vibrates_alike_in_any_plane():
    share = vibration(FREE, 4.73004)[1]
    np.testing.assert_allclose(vibration(FREE, 4.73004, tilt=0.7)[1], share, atol=1e-6)  # rounding, times EA/EI
