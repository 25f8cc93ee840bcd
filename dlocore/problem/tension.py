"""The axial strain that balances the forces along the cable, from that at the points of reduced integration, and back.

It is the quadratic spline e on the knots of the grid with

    int e phi_j du = sum_p w_p e_p phi_j(u_p)   for all quadratic basis functions phi_j,

of which the b_i' are combinations, so that the forces on all control points are those of the e_p (docs/model.md,
selective reduced integration). Where a force acts in a point a step is added, where a direction is held, with unit
length, a force on phi_j(u_g): both are as large as leaves e least curved.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from dlocore.kernels.basis import GAUSS_3, gauss_points
from dlocore.problem.grid import Grid
from dlocore.scene.scene import Scene
from dlocore.spline import DEGREE

Floats = NDArray[np.float64]

_SAME = 1e-9  # of the largest singular value: what two sides of a place differ by where they are one


def balanced(scene: Scene, grid: Grid, u: Floats) -> Floats:
    """Return the matrix (k, p) that makes the axial strain at u (k,) [m] of that at the axial points (p,) of a grid."""
    tables, knots, length = grid.tables, grid.knots[1:-1], float(grid.knots[-1])
    points, weights = gauss_points(np.array(grid.knots), *GAUSS_3)
    over = _basis(knots, points)
    mass = over.T @ (weights[:, None] * over)
    sides = _held_sides(scene)
    inside = sorted({u for u in scene.places if 0.0 < u < length})
    steps = np.array([np.heaviside(points - g, 0.5) for g in inside]).reshape(-1, len(points))
    given = np.hstack(
        [
            _basis(knots, tables.axial.u).T * tables.axial.w,
            _basis(knots, np.array(sides)).T,
            -over.T @ (weights * steps).T,
        ]
    )
    found = np.linalg.solve(mass, given)
    count = len(tables.axial.w)
    own, others = found[:, :count], found[:, count:]
    begins, ends = np.unique(knots)[:-1], np.unique(knots)[1:]
    curved = (ends - begins)[:, None] ** 2 * _basis(knots, 0.5 * (begins + ends), 2)
    # the two sides of a held place may be the same but for rounding, of which no force is to be made
    forces = -np.linalg.pinv(curved @ others, rcond=_SAME) @ (curved @ own)
    jumps = np.array([np.heaviside(u - g, 0.5) for g in inside]).reshape(-1, len(u)).T
    return _basis(knots, u) @ (own + others @ forces) + jumps @ forces[len(sides) :]


def at_points(scene: Scene, grid: Grid, strain: Callable[[Floats], Floats]) -> Floats:
    """Return the strain at the axial points (p,) of a grid that bears what a `strain` along the cable does.

    `strain` takes places (k,) [m] and returns (k,). What is returned has the forces on all control points that it has,
    and is otherwise as near to it as it can be.
    """
    tables, knots = grid.tables, grid.knots[1:-1]
    points, weights = gauss_points(np.array(grid.knots), *GAUSS_3)
    own = strain(tables.axial.u)
    forces = _basis(knots, tables.axial.u).T * tables.axial.w
    left = _basis(knots, points).T @ (weights * strain(points)) - forces @ own
    held = _basis(knots, np.array(_held_sides(scene))).T
    found = np.linalg.lstsq(np.hstack([forces, held]), left, rcond=None)[0]
    return own + found[: len(own)]


def _held_sides(scene: Scene) -> list[float]:
    """Return both sides of each place whose direction is held [m]: not the same where the knot is triple."""
    held = sorted({g.u for g in scene.grasps if g.hold != "point"})
    return [float(np.nextafter(u, to)) for u in held for to in (0.0, scene.cable.length)]


def _basis(knots: Floats, u: Floats, derivative: int = 0) -> Floats:
    """Return the quadratic splines on knots (n + 3,) [m], or derivatives, at u (k,) [m]; (k, n)."""
    from scipy.interpolate import BSpline  # slow to import, and needed only where the stretch is read

    n = len(knots) - DEGREE
    return np.asarray(BSpline(knots, np.eye(n), DEGREE - 1)(u, derivative))
