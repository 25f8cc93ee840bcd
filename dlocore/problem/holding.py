"""Constraints of grasps: rows solved for pivot control points (docs/model.md eq. 11, 12), and the turn of clamps."""

from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from dlocore.kernels.banded import Elimination
from dlocore.kernels.holding import ROW, hold_rows, place, spun
from dlocore.problem.grid import Grid
from dlocore.problem.plane import unit_across
from dlocore.problem.problem import Problem
from dlocore.scene.paths import STAYS, held_at
from dlocore.scene.scene import Grasp

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Held:
    """Held degrees of freedom over a stretch of time.

    Attributes:
        grasps: those that hold, in the scene's order.
        elimination: for the compiled kernels.
        offsets: (k, held) [m] prescribed part of the held degrees of freedom at the k times.
        rows: constraint rows for every coordinate of the centreline: (grasp, derivative) in the order of `inverse`, and
            `SMOOTH` for each triple knot, where the slope must not jump.
        inverse: (rows, rows) inverse of the constraint rows' pivot block.
        turned: the grasps that hold the angle of their section, in the order of `turned_inverse`.
        turned_inverse: the inverse for the rows that hold theta.
    """

    grasps: tuple[Grasp, ...]
    elimination: Elimination
    offsets: Floats
    rows: tuple[tuple[int, int], ...]
    inverse: Floats
    turned: tuple[int, ...]
    turned_inverse: Floats

    def multipliers(self, reactions: Floats, dimensions: int) -> Floats:
        """Return the multipliers (k, rows, dimensions) of the constraint rows for forces (k, held) at the pivots."""
        count = len(self.rows) * dimensions
        return self.inverse.T @ reactions[:, :count].reshape(len(reactions), -1, dimensions)

    def torques(self, reactions: Floats, dimensions: int) -> Floats:
        """Return the multipliers (k, turned) of the rows that hold the fourth coordinate [N]."""
        return reactions[:, len(self.rows) * dimensions :] @ self.turned_inverse


SMOOTH = (-1, 1)  # a row that belongs to no grasp
Starts = dict[Grasp, Floats]  # point and unit tangent (2, 3) in the world, where the path of a grasp begins


def close_grasps(problem: Problem, grid: Grid, grasps: list[Grasp], starts: Starts, q: Floats | None) -> None:
    """Enter in `starts` where the paths of newly closed `grasps` begin: on the start curve at t = 0, else on q.

    `q` are the control points (n_u, nc) as the grasps close; None at t = 0.
    """
    plane = problem.plane
    for g in grasps:
        if g in starts:
            continue
        if q is None or g.start == 0.0:
            starts[g] = problem.start.place(g.u)
        else:
            position, tangent = place(grid.knots, q, g.u, plane.dimensions)
            starts[g] = np.array([plane.world(position), plane.world_vectors(tangent)])


def hold(problem: Problem, grid: Grid, grasps: list[Grasp], t: Floats, starts: Starts, q: Floats) -> Held:
    """Eliminate the degrees of freedom that `grasps` hold at the times t (k,) [s].

    The rows b(u_g) q = p(t), and b'(u_g) q = d(t) if the direction is held (with unit length), are solved for one pivot
    control point each (docs/model.md eq. 12). If a clamp holds the angle of its section, b(u_g) theta = theta(t) is
    treated likewise. theta(t) is the angle in q (n_u, nc), the state at t[0], plus the turn of the gripper about the
    cable since then, measured against the frames that are carried from each of the times to the next.
    """
    rows, table, sampled = constraint_rows(grasps, t, starts)
    turned = tuple(i for i, g in enumerate(grasps) if g.hold == "clamp") if problem.twist is not None else ()
    clamps, spins = np.empty((len(turned), 2), np.int64), list[Floats]()
    for r, i in enumerate(turned):
        g = grasps[i]
        clamps[r] = rows.index((i, 1)), -1
        if g.path.turn is None:
            clamps[r, 1] = len(spins)
            spins.append(spin_of(g, t, starts[g][1]))
    elimination, offsets, inverse, turned_inverse = hold_rows(
        grid.knots, problem.nc, t, table, sampled, problem.plane.origin, problem.plane.axes, clamps,
        np.array(spins).reshape(-1, len(t)), q, 1.0 if problem.twist is None else problem.twist.radius,
    )  # fmt: skip
    rows += (SMOOTH,) * (len(inverse) - len(rows))
    return Held(tuple(grasps), elimination, offsets, rows, inverse, turned, turned_inverse)


def constraint_rows(
    grasps: list[Grasp], t: Floats, starts: Starts
) -> tuple[tuple[tuple[int, int], ...], Floats, Floats]:
    """Return the constraint rows of `grasps` on the centreline.

    Returns:
        (grasp, derivative) of each row, and the arguments `rows` and `sampled` of `kernels.holding.hold_rows`.
    """
    rows: list[tuple[int, int]] = []
    table: list[tuple[float, ...]] = []
    sampled: list[Floats] = []
    for i, g in enumerate(grasps):
        begun, directed = starts[g].tolist(), g.hold != "point"
        line, number = g.path.line, -1
        if line is None:
            line, number = STAYS, len(sampled)
            sampled.append(held_at(g.path, t - g.start, starts[g][0]))
        rows.append((i, 0))
        table.append((g.u, 0, directed, number, g.start, *line, *begun[0]))
        if directed:
            turn, number = g.path.turn, -1
            if turn is None:
                turn, number = STAYS, len(sampled)
                sampled.append(cast(Floats, g.path.rotation_at(t - g.start)) @ starts[g][1])
            rows.append((i, 1))
            table.append((g.u, 1, directed, number, g.start, *turn, *begun[1]))
    return tuple(rows), np.array(table).reshape(-1, ROW), np.array(sampled).reshape(-1, len(t), 3)


def spin_of(grasp: Grasp, t: Floats, direction: Floats) -> Floats:
    """Return the angle by which a gripper has turned about the cable since t[0], at the times t (k,) [s]; (k,) [rad].

    It is measured against a frame that the smallest rotations carry from each tangent to the next, and counts full
    turns. `direction` (3,) is the tangent where the path begins.
    """
    turns = cast(Floats, grasp.path.rotation_at(t - grasp.start))
    across = turns[0].T @ unit_across(turns[0] @ direction)  # a director, fixed in the gripper
    tangents = turns @ direction
    return np.asarray(spun(tangents, turns @ across, grasp.path.spin(t - grasp.start, tangents)))
