"""A grid for a problem: knots, basis tables, held degrees of freedom and the start on them."""

from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from dlocore.errors import SceneError
from dlocore.kernels.banded import Elimination
from dlocore.kernels.basis import GAUSS_2, GAUSS_3, GAUSS_4, Tables, basis_rows, build_tables, graded_knots
from dlocore.kernels.relax import relax
from dlocore.paths import Waypoints
from dlocore.problem import Problem
from dlocore.scene import Grasp, Points
from dlocore.shape import fit_to_knots, start_curve, velocity_to_knots

Floats = NDArray[np.float64]

# Grading of the knots towards a feature: exponent and width. An interior point force makes r''' jump and bends sharply
# beside it; at an end or at a held direction a weaker grading serves better (docs/model.md).
_INTERIOR = (0.6, 0.02)
_END = (0.3, 0.04)
_SAME = 1e-9  # of the length: features this close are one


@dataclass(frozen=True, eq=False)
class Grid:
    """Space discretisation of a problem.

    Attributes:
        knots: (n_u + 4,) [m].
        tables: basis functions at the quadrature points.
        memory: curvature of the stress-free shape at the curvature points (points, 1 or 3) [1/m].
        start: control points at t = 0 (n_u, nc) [m].
        velocity: their given velocities, before grasps close (n_u, nc) [m/s].
    """

    knots: Floats
    tables: Tables
    memory: Floats
    start: Floats
    velocity: Floats

    @property
    def n_u(self) -> int:
        """Number of control points."""
        return len(self.knots) - 4

    def rows(self, u: float, derivative: int = 0) -> tuple[int, Floats]:
        """Return the first control point and the four basis functions, or derivatives, at `u` [m]."""
        first, table = basis_rows(self.knots, np.array([u]), derivative)
        return int(first[0]), table[0, derivative]

    def at(self, q: Floats, u: float, derivative: int = 0) -> Floats:
        """Return the value or derivative at `u` [m] of control points q (..., n_u, nc)."""
        first, b = self.rows(u, derivative)
        return b @ q[..., first : first + 4, :]


def smallest_n_u(problem: Problem) -> int:
    """Return the least number of control points that has a knot at every feature."""
    features, multiplicity, _, _ = _features(problem)
    inside = [m for u, m in zip(features, multiplicity, strict=True) if 0 < u < problem.scene.cable.length]
    return max(5, 4 + sum(inside))


def make_grid(problem: Problem, n_u: int) -> Grid:
    """Return the grid of `n_u` control points for a problem, with the start shape on it.

    Raises:
        SceneError: n_u is too small for the knots that the grasps and loads need.
    """
    cable = problem.scene.cable
    features, multiplicity, power, width = _features(problem)
    knots = graded_knots(n_u, cable.length, features, multiplicity, power, width)
    if len(knots) == 0:
        reason = f"{len(features)} grasps and loads need a knot each"
        raise SceneError("quality.n_u", n_u, f"at least {smallest_n_u(problem)} in this scene", reason)
    return grid_on(problem, knots)


def grid_on(problem: Problem, knots: Floats) -> Grid:
    """Return the grid of a problem on given knots (n_u + 4,) [m], with the start shape on it."""
    free_start, free_end = _free_ends(problem)
    tables = build_tables(knots, free_start, free_end, *GAUSS_2, *GAUSS_3, *GAUSS_4)
    nc = problem.plane.dimensions
    memory = np.zeros((len(tables.curvature_w), 1 if nc == 2 else 3))
    start = np.ascontiguousarray(problem.plane.points(fit_to_knots(problem.start, knots)))
    given = velocity_to_knots(problem.start, knots)
    velocity = np.zeros_like(start) if given is None else np.ascontiguousarray(problem.plane.vectors(given))
    grid = Grid(knots, tables, memory, start, velocity)
    waypoints = any(g.start == 0.0 and isinstance(g.path, Waypoints) for g in problem.scene.grasps)
    if waypoints or len(problem.start.control_points) > 4:
        start = consistent_start(problem, grid)
        grid = Grid(knots, tables, memory, start, velocity)
    return Grid(knots, tables, _memory(problem, grid), start, velocity)


def _features(problem: Problem) -> tuple[Floats, NDArray[np.int64], Floats, Floats]:
    """Return sorted coordinates of grasps and loads, knot multiplicities, grading exponents and widths."""
    length = problem.scene.cable.length
    found: dict[float, tuple[int, float, float]] = {}
    places = [(g.u, 2 if g.hold == "tangent" else 1) for g in problem.scene.grasps]
    places += [(load.u, 1) for load in problem.scene.loads]
    for place, multiplicity in places:
        u = next((v for v in found if abs(v - place) <= _SAME * length), place)
        at_end = min(u, length - u) <= _SAME * length
        power, width = _END if at_end or multiplicity == 2 else _INTERIOR
        before = found.get(u, (0, 0.0, 1.0))
        found[u] = (max(before[0], multiplicity), max(before[1], power), min(before[2], width))
    order = sorted(found)
    columns = np.array([found[u] for u in order]).reshape(-1, 3)
    return np.array(order, float), columns[:, 0].astype(np.int64), columns[:, 1].copy(), columns[:, 2].copy()


def _free_ends(problem: Problem) -> tuple[bool, bool]:
    """Return whether the direction of the cable is free, at least for a time, at its two ends."""
    length = problem.scene.cable.length

    def free(end: float) -> bool:
        for g in problem.scene.grasps:
            if abs(g.u - end) <= _SAME * length and g.hold == "tangent":
                return g.start > 0 or g.release_time is not None
        return True

    return free(0.0), free(length)


def plane_curvature_of(tables: Tables, q: Floats) -> Floats:
    """Return the signed curvature (points, 1) [1/m] of planar control points q (n_u, 2) at the curvature points."""
    index = tables.curvature_first[:, None] + np.arange(4)
    a = np.einsum("pi,pid->pd", tables.curvature_b1, q[index])
    b = np.einsum("pi,pid->pd", tables.curvature_b2, q[index])
    return ((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / (a * a).sum(axis=1))[:, None]


def _memory(problem: Problem, grid: Grid) -> Floats:
    rest = problem.scene.cable.rest_shape
    if (isinstance(rest, str) and rest == "straight") or problem.plane.dimensions == 3:
        return grid.memory
    if isinstance(rest, str):
        return plane_curvature_of(grid.tables, grid.start)
    curve = start_curve(Points(points=rest), problem.scene.cable.length)
    return plane_curvature_of(grid.tables, problem.plane.points(fit_to_knots(curve, grid.knots)))


def consistent_start(problem: Problem, grid: Grid) -> Floats:
    """Return start control points (n_u, nc) of unit speed that pass exactly through the held points of the curve."""
    grasps = [g for g in problem.scene.grasps if g.start == 0.0]
    starts: Starts = {}
    close_grasps(problem, grid, grasps, starts, None)
    held = hold(problem, grid, grasps, np.zeros(1), starts)
    active, parameters = problem.law_table()
    active[:] = 0
    active[0] = 1
    strength = 1e-3 * parameters[0, 0] * (grid.n_u / problem.scene.cable.length) ** 2
    q = grid.start.copy()
    relax(
        tuple(range(problem.plane.dimensions)), q, grid.start.copy(), strength, np.zeros_like(q), grid.tables, active,
        parameters, grid.memory, held.elimination, held.offsets[0], 1e-10 * problem.scene.cable.length, 50,
    )  # fmt: skip
    return q


@dataclass(frozen=True, eq=False)
class Held:
    """Held degrees of freedom over a stretch of time.

    Attributes:
        grasps: those that hold, in the scene's order.
        elimination: for the compiled kernels.
        offsets: (k, held) [m] prescribed part of the held degrees of freedom at the k times.
        rows: constraint rows per coordinate: (grasp, derivative) in the order of `inverse`.
        inverse: (rows, rows) inverse of the constraint rows' pivot block.
    """

    grasps: tuple[Grasp, ...]
    elimination: Elimination
    offsets: Floats
    rows: tuple[tuple[int, int], ...]
    inverse: Floats

    def multipliers(self, reactions: Floats, nc: int) -> Floats:
        """Return the multipliers (k, rows, nc) of the constraint rows for forces (k, held) at the held ones [N]."""
        return self.inverse.T @ reactions.reshape(len(reactions), -1, nc)


Starts = dict[Grasp, tuple[Floats, Floats]]  # position and unit tangent (nc,) where the path of a grasp begins


def close_grasps(problem: Problem, grid: Grid, grasps: list[Grasp], starts: Starts, q: Floats | None) -> None:
    """Note where the paths of newly closed `grasps` begin: on the start curve at t = 0, else on q (n_u, nc)."""
    for g in grasps:
        if g in starts:
            continue
        if q is None or g.start == 0.0:
            position = problem.plane.points(problem.start(g.u)[0])
            tangent = problem.plane.vectors(problem.start(g.u, 1)[0])
        else:
            position, tangent = grid.at(q, g.u), grid.at(q, g.u, 1)
        starts[g] = (position, tangent / np.linalg.norm(tangent))


def hold(problem: Problem, grid: Grid, grasps: list[Grasp], t: Floats, starts: Starts) -> Held:
    """Eliminate what `grasps` hold at the times t (k,) [s].

    The rows b(u_g) q = p(t), and b'(u_g) q = d(t) where the direction is held (unit stretch there), are solved for one
    pivot control point each (docs/model.md eq. 12).
    """
    nc = problem.plane.dimensions
    size = sum(2 if g.hold == "tangent" else 1 for g in grasps)
    A = np.zeros((size, grid.n_u))
    target = np.empty((len(t), size, nc))
    rows: list[tuple[int, int]] = []
    for i, g in enumerate(grasps):
        position, direction = starts[g]
        for derivative in range(2 if g.hold == "tangent" else 1):
            first, b = grid.rows(g.u, derivative)
            r = len(rows)
            A[r, first : first + 4] = b
            path = problem.position if derivative == 0 else problem.direction
            target[:, r] = path(g, t, position if derivative == 0 else direction)
            rows.append((i, derivative))
    pivots = _pivots(A, [r for r, (i, _) in enumerate(rows) if grasps[i].hold == "tangent"])
    inverse = np.asarray(np.linalg.inv(A[:, pivots]), dtype=np.float64)
    follow = -inverse @ A
    follow[:, pivots] = 0.0
    offsets: Floats = (inverse @ target).reshape(len(t), -1)
    return Held(tuple(grasps), _elimination(grid.n_u, nc, pivots, follow), offsets, tuple(rows), inverse)


def _pivots(A: Floats, first: list[int]) -> list[int]:
    """Choose a pivot column for each row of A (rows, n_u): Gauss elimination, the rows `first` before the others.

    A held direction has just two control points to choose from, so it chooses before its neighbours do.
    """
    if len(A) == 1:
        return [int(np.argmax(np.abs(A[0])))]
    work = A.copy()
    pivots = [-1] * len(A)
    for r in sorted(range(len(A)), key=lambda row: row not in first):
        for s, p in enumerate(pivots):
            if p >= 0:
                work[r] -= work[r, p] / work[s, p] * work[s]
        pivots[r] = int(np.argmax(np.abs(work[r])))
    return pivots


def _elimination(n_u: int, nc: int, pivots: list[int], follow: Floats) -> Elimination:
    held = np.array([k * nc + d for k in pivots for d in range(nc)], dtype=np.int64)
    index = np.zeros(n_u * nc, np.int64)
    index[held] = -1 - np.arange(len(held))
    free = np.flatnonzero(index == 0)
    index[free] = np.arange(len(free))
    start = [0]
    dof: list[int] = []
    coefficient: list[float] = []
    for row in follow:
        columns = np.flatnonzero(np.abs(row) > 1e-14)
        for d in range(nc):
            dof += [int(c) * nc + d for c in columns]
            coefficient += [float(row[c]) for c in columns]
            start.append(len(dof))
    return Elimination(index, held, np.array(start, np.int64), np.array(dof, np.int64), np.array(coefficient, float))


def applied_forces(problem: Problem, grid: Grid, t: Floats) -> Floats:
    """Return the applied forces (1 or k, n_u, nc) [N]: weight, and loads at times t (k,) where there are any."""
    steady = cast(Floats, grid.tables.weight)[:, None] * problem.weight()
    if not problem.scene.loads:
        return steady[None]
    applied = np.tile(steady, (len(t), 1, 1))
    for load in problem.scene.loads:
        first, b = grid.rows(load.u)
        force = problem.plane.vectors(load.at(t))
        applied[:, first : first + 4] += b[:, None] * force[:, None, :]
    return applied
