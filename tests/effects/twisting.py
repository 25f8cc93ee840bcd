"""Cables that are twisted, and how much: what the tests of twist share."""

from typing import Any

import numpy as np
from scipy.interpolate import make_interp_spline

from dlocore import ControlPoints, Equilibrium, Grasp, Prediction
from tests.solver.scenes import Floats, samples

EI, GJ = 1e-3, 1e-3
# EI = 100 GJ: straight up to 8.99 EI/GJ = 899 rad of twist
STIFF = {"bending_stiffness": 0.1, "torsional_stiffness": GJ}
START = Grasp(u=0.0, hold="clamp")


def spline(u: Floats, r: Floats, first: Floats, last: Floats, theta: Floats) -> ControlPoints:
    """Return the cubic spline through r (n, 3) [m] and theta (n,) [rad] at u (n,) [m], r' given at both ends.

    Its parameter is the material coordinate.
    """
    rate = np.array([(theta[1] - theta[0]) / u[1], (theta[-1] - theta[-2]) / (u[-1] - u[-2])])
    ends = ([(1, np.append(first, rate[0]))], [(1, np.append(last, rate[1]))])
    through = make_interp_spline(u, np.column_stack([r, theta]), k=3, bc_type=ends)
    return ControlPoints(control_points=through.c, knots=through.t, strain=np.zeros(len(through.c)))


def total_twist(found: Prediction | Equilibrium) -> Any:
    """Return theta(L) - theta(0) [rad] of an equilibrium, or at 65 times of a prediction."""
    if isinstance(found, Equilibrium):
        return float(found.control_points[-1, 3] - found.control_points[0, 3])
    theta = found.surface([0.0, found.surface.length], samples(found.surface, 2, 65)[1])[..., 3]
    return theta[:, 1] - theta[:, 0]


def bowed(twist: float, amplitude: float) -> ControlPoints:
    """Return a nearly straight cable of 1 m from 0 to 1 m on x, off it by about `amplitude` in both directions."""
    u = np.linspace(0.0, 1.0, 41)
    side = 0.5 * (1 - np.cos(2 * np.pi * u))
    r = np.column_stack([u, amplitude * side, amplitude * side * np.sin(2 * np.pi * u)])
    along_x = np.array([1.0, 0.0, 0.0])
    return spline(u, r, along_x, along_x, twist * u)
