"""The axial strain that balances the forces along the cable, from that at the points of reduced integration, and back.

It is the quadratic spline e on the knots of the grid with

    int e phi_j du = sum_p w_p e_p phi_j(u_p)   for all quadratic basis functions phi_j.

The b_i' are combinations of these phi_j, so that the forces on all control points are those of the e_p (docs/model.md,
selective reduced integration). Two terms are added: a step where a force acts at a point, and a force on phi_j(u_g)
where a direction is held with unit length. Their sizes are those that make e least curved, except that e is determined
by the force on an end whose direction is held, or beside which another force acts in a tip without a span of its own.
"""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from dlocore.kernels.basis import GAUSS_3, gauss_points
from dlocore.problem.features import SAME
from dlocore.problem.grid import Grid
from dlocore.scene.scene import Scene
from dlocore.spline import DEGREE

Floats = NDArray[np.float64]

_SAME = 1e-9  # of the largest singular value: smaller ones are the rounding between two equal sides of a place


def told_ends(scene: Scene, grid: Grid) -> list[float]:
    """Return the ends [m] at which the force on them gives the strain: those without a point mass, if ...

    - a direction is held there: the force of its gripper,
    - or a force acts in a tip that has no span of its own: there the strain is that of a free end.
    """
    heavy, held, length = {mass.u for mass in scene.cable.point_masses}, _held(scene), scene.cable.length
    beside = {0.0 if u < 0.5 * length else length for u in _in_tips(scene, grid) if u not in held}
    return [u for u in (0.0, length) if u not in heavy and (u in held or u in beside)]


def _in_tips(scene: Scene, grid: Grid) -> set[float]:
    """Return the places [m] of a scene in tips that have no span of their own, so that no knot lies there."""
    return {u for u in scene.places if np.abs(grid.knots - u).min() > SAME * scene.cable.length}


def balanced(scene: Scene, grid: Grid, u: Floats, ends: Sequence[float] = ()) -> Floats:
    """Return the matrix (k, p + ends) that gives the axial strain at u (k,) [m] from the known strains.

    These are the strains at the axial points (p,) of a grid and at some of its `told_ends` (ends,) [m].
    """
    tables, knots, length = grid.tables, grid.knots[1:-1], float(grid.knots[-1])
    sides = _held_sides(scene)
    covered = _in_tips(scene, grid) & set(_held(scene))  # by the force of a held direction
    inside = np.unique([u for u in scene.places if 0.0 < u < length and u not in covered])
    # a place in a tip has no knot: the integral over its step has to stop there
    points, weights = gauss_points(np.sort(np.concatenate([grid.knots, inside])), *GAUSS_3)
    over = _basis(knots, points)
    mass = over.T @ (weights[:, None] * over)

    def steps(at: Floats) -> Floats:
        return np.heaviside(at[:, None] - inside, 0.5)

    given = np.hstack(
        [
            _basis(knots, tables.axial.u).T * tables.axial.w,
            _basis(knots, np.array(sides)).T,
            -over.T @ (weights[:, None] * steps(points)),
        ]
    )
    found = np.linalg.solve(mass, given)
    count = len(tables.axial.w)
    own, others = found[:, :count], found[:, count:]

    def read(at: Floats) -> tuple[Floats, Floats]:
        """Return the matrices from the strains at the points, and from the added terms, to the strain at `at`."""
        there = _basis(knots, at)
        return there @ own, there @ others + np.hstack([np.zeros((len(at), len(sides))), steps(at)])

    of_points, of_forces = read(np.array(ends))
    to_ends = np.linalg.pinv(of_forces)
    forces = np.hstack([-to_ends @ of_points, to_ends])  # which give the known strain at the ends
    free = np.linalg.qr(of_forces.T, "complete")[0][:, len(ends) :]  # changes that leave it unchanged
    begins, ends_of = np.unique(knots)[:-1], np.unique(knots)[1:]
    curved = (ends_of - begins)[:, None] ** 2 * _basis(knots, 0.5 * (begins + ends_of), 2)
    left = curved @ (np.hstack([own, np.zeros((len(own), len(ends)))]) + others @ forces)
    # the two sides of a held place may be the same up to rounding, which must not be turned into a force
    forces -= free @ np.linalg.pinv(curved @ others @ free, rcond=_SAME) @ left
    of_points, of_forces = read(u)
    strain = of_forces @ forces
    strain[:, :count] += of_points
    return strain


def at_points(scene: Scene, grid: Grid, strain: Callable[[Floats], Floats]) -> Floats:
    """Return the strain at the axial points (p,) of a grid that exerts the same forces as a `strain` along the cable.

    `strain` takes coordinates (k,) [m] and returns (k,). The result has the same forces on all control points, and is
    otherwise as near to `strain` as possible.
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
    """Return both sides of each place whose direction is held [m], an end's only one; they differ at a triple knot."""
    length = scene.cable.length
    sides = [[u] if u in (0.0, length) else [np.nextafter(u, 0.0), np.nextafter(u, length)] for u in _held(scene)]
    return [float(u) for of_one in sides for u in of_one]


def _held(scene: Scene) -> list[float]:
    """Return the places where a direction is held [m], rising, each once."""
    return sorted({g.u for g in scene.grasps if g.hold != "point"})


def _basis(knots: Floats, u: Floats, derivative: int = 0) -> Floats:
    """Return the quadratic splines on knots (n + 3,) [m], or derivatives, at u (k,) [m]; (k, n)."""
    from scipy.interpolate import BSpline  # slow to import, and needed only where the stretch is read

    n = len(knots) - DEGREE
    return np.asarray(BSpline(knots, np.eye(n), DEGREE - 1)(u, derivative))
