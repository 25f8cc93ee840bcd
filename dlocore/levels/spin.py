"""The inertia of the sections, which turn about the cable as it moves, in a motion that is solved without twist.

Even without twist, a moving cable turns its sections. Where it bends and its tangent t turns too, their spin w about
the tangent varies along the cable: w' = -sigma' with sigma' = t . (t_dot x kappa) (docs/model.md, eq. 9). The inertia
mu rho^2 per length, rho = D/sqrt(8), requires a torque T with T' = mu rho^2 w_dot that vanishes at both ends. Its
virtual work per length is T (kappa x t) . delta t. It matters only where the cable bends to a few diameters.
"""

import numpy as np
from numpy.typing import NDArray

from dlocore.kernels.assembly import largest_curvature
from dlocore.problem.grid import Grid
from dlocore.problem.problem import Problem

Floats = NDArray[np.float64]

SHARP = 16.0  # diameters: the radius of bends above which the inertia of the sections is ignored
_STRIDE = 8  # one of this many states is checked for sharp bends
_CONTROLS = np.arange(4)


def bends_sharply(problem: Problem, grid: Grid, states: Floats) -> bool:
    """Tell whether states (k, n_u, nc) bend to a radius below `SHARP` diameters."""
    some = np.ascontiguousarray(states[::_STRIDE])
    most = float(largest_curvature(problem.axes, some, grid.tables.curvature, grid.history.memory))
    return most * SHARP * problem.scene.cable.diameter > 1.0


def spin_forces(problem: Problem, grid: Grid, q: Floats, v: Floats, a: Floats, clamped: float | None) -> Floats:
    """Return the generalised forces (n_u, 3) [N] of the sections' inertia.

    They stand on the side of M q_ddot in docs/model.md eq. 10.

    Args:
        problem: of a motion in space, without twist.
        grid: its grid.
        q, v, a: control points, their velocities and accelerations (n_u, 3) [m, m/s, m/s^2].
        clamped: where a gripper keeps a section from turning [m]; None: the mean of the spin is conserved.
    """
    cable, tables = problem.scene.cable, grid.tables
    inertia = cable.linear_density * cable.diameter**2 / 8.0
    u, w = tables.curvature.u, tables.curvature.w
    reach = tables.curvature.first[:, None] + _CONTROLS

    def derivative(b: Floats, x: Floats) -> Floats:
        return np.einsum("pi,pid->pd", b, x[reach])

    def across(x: Floats) -> Floats:
        return np.asarray(x - np.einsum("pd,pd->p", x, t)[:, None] * t)

    slope = derivative(tables.curvature.b1, q)
    size = np.linalg.norm(slope, axis=1, keepdims=True)
    t = slope / size
    kappa, rate = (across(derivative(tables.curvature.b2, x)) / size**2 for x in (q, v))
    turns, turned = (across(derivative(tables.curvature.b1, x)) / size for x in (v, a))
    slip = np.einsum("pd,pd->p", t, np.cross(turned, kappa) + np.cross(turns, rate))
    spin = -np.cumsum(slip * w)
    spin -= np.average(spin, weights=w) if clamped is None else np.interp(clamped, u, spin)
    torque = inertia * np.cumsum(spin * w)
    if clamped is not None:
        torque[u > clamped] -= torque[-1]
    force = np.zeros_like(q)
    work = across(np.cross(kappa, t)) * (torque * w)[:, None] / size
    np.add.at(force, reach, tables.curvature.b1[:, :, None] * work[:, None, :])
    return force
