"""What grasps hold: their rows solved for pivot control points (docs/model.md eq. 11, 12), and the turn of clamps."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dlocore.grid import Grid
from dlocore.kernels.banded import Elimination, elimination
from dlocore.problem import Problem
from dlocore.scene import Grasp
from dlocore.transport import transported

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Held:
    """Held degrees of freedom over a stretch of time.

    Attributes:
        grasps: those that hold, in the scene's order.
        elimination: for the compiled kernels.
        offsets: (k, held) [m] prescribed part of the held degrees of freedom at the k times.
        rows: constraint rows for every coordinate of the centreline: (grasp, derivative) in the order of `inverse`.
        inverse: (rows, rows) inverse of the constraint rows' pivot block.
        turned: the grasps that hold the angle of their section, in the order of `turned_inverse`.
        turned_inverse: the same for the rows that hold theta.
    """

    grasps: tuple[Grasp, ...]
    elimination: Elimination
    offsets: Floats
    rows: tuple[tuple[int, int], ...]
    inverse: Floats
    turned: tuple[int, ...]
    turned_inverse: Floats

    def multipliers(self, reactions: Floats, dimensions: int) -> Floats:
        """Return the multipliers (k, rows, dimensions) of the constraint rows for forces (k, held) at the held ones."""
        count = len(self.rows) * dimensions
        return self.inverse.T @ reactions[:, :count].reshape(len(reactions), -1, dimensions)

    def torques(self, reactions: Floats, dimensions: int) -> Floats:
        """Return the multipliers (k, turned) of the rows that hold the fourth coordinate [N]."""
        return reactions[:, len(self.rows) * dimensions :] @ self.turned_inverse


Starts = dict[Grasp, tuple[Floats, Floats]]  # position and unit tangent (2 or 3,) where the path of a grasp begins


def close_grasps(problem: Problem, grid: Grid, grasps: list[Grasp], starts: Starts, q: Floats | None) -> None:
    """Note where the paths of newly closed `grasps` begin: on the start curve at t = 0, else on q (n_u, nc)."""
    dimensions = problem.plane.dimensions
    for g in grasps:
        if g in starts:
            continue
        if q is None or g.start == 0.0:
            position = problem.plane.points(problem.start(g.u)[0])
            tangent = problem.plane.vectors(problem.start(g.u, 1)[0])
        else:
            position, tangent = grid.at(q, g.u)[:dimensions], grid.at(q, g.u, 1)[:dimensions]
        starts[g] = (position, tangent / np.linalg.norm(tangent))


def hold(problem: Problem, grid: Grid, grasps: list[Grasp], t: Floats, starts: Starts, q: Floats) -> Held:
    """Eliminate what `grasps` hold at the times t (k,) [s].

    The rows b(u_g) q = p(t), and b'(u_g) q = d(t) where the direction is held (unit stretch there), are solved for one
    pivot control point each (docs/model.md eq. 12). Where a clamp holds the angle of its section, b(u_g) theta =
    theta(t) is held likewise: the angle it has in q (n_u, nc), the state at t[0], and how much the gripper has turned
    about the cable since, against the frames that are carried from each of the times to the next.
    """
    dimensions = problem.plane.dimensions
    size = sum(1 if g.hold == "point" else 2 for g in grasps)
    A = np.zeros((size, grid.n_u))
    target = np.empty((len(t), size, dimensions))
    rows: list[tuple[int, int]] = []
    for i, g in enumerate(grasps):
        position, direction = starts[g]
        for derivative in range(1 if g.hold == "point" else 2):
            first, b = grid.rows(g.u, derivative)
            r = len(rows)
            A[r, first : first + 4] = b
            path = problem.position if derivative == 0 else problem.direction
            target[:, r] = path(g, t, position if derivative == 0 else direction)
            rows.append((i, derivative))
    pivots = _pivots(A, [r for r, (i, _) in enumerate(rows) if grasps[i].hold != "point"])
    inverse, follow = _solved_for(A, pivots)
    offsets: Floats = (inverse @ target).reshape(len(t), -1)
    turned = tuple(i for i, g in enumerate(grasps) if g.hold == "clamp") if problem.twist is not None else ()
    turned_pivots: list[int] = []
    turned_inverse = np.zeros((0, 0))
    turned_follow = np.zeros((0, grid.n_u))
    if turned:
        assert problem.twist is not None
        B = np.zeros((len(turned), grid.n_u))
        angles = np.empty((len(t), len(turned)))
        for r, i in enumerate(turned):
            g = grasps[i]
            first, b = grid.rows(g.u)
            B[r, first : first + 4] = b
            tangents = problem.direction(g, t, starts[g][1])
            angles[:, r] = grid.at(q, g.u)[3] + problem.twist.radius * spin_of(g, t, tangents)
        turned_pivots = _pivots(B, [])
        turned_inverse, turned_follow = _solved_for(B, turned_pivots)
        offsets = np.concatenate([offsets, angles @ turned_inverse.T], axis=1)
    held = elimination(
        grid.n_u, problem.nc, dimensions, np.array(pivots, np.int64), follow, np.array(turned_pivots, np.int64),
        turned_follow,
    )  # fmt: skip
    return Held(tuple(grasps), held, offsets, tuple(rows), inverse, turned, turned_inverse)


def _solved_for(A: Floats, pivots: list[int]) -> tuple[Floats, Floats]:
    """Return the inverse of the pivot block of the rows A, and how the pivots follow the other control points."""
    block = A[:, pivots]
    inverse = 1.0 / block if len(pivots) == 1 else np.asarray(np.linalg.inv(block), dtype=np.float64)
    follow = -inverse @ A
    follow[:, pivots] = 0.0
    return inverse, follow


def spin_of(grasp: Grasp, t: Floats, tangents: Floats) -> Floats:
    """Return how much a gripper has turned about the cable since t[0], at the times t (k,) [s]; (k,) [rad].

    It is measured against a frame that the smallest rotations carry from each of the `tangents` (k, 3) to the next,
    and counts full turns.
    """
    turns = grasp.path.rotation_at(t - grasp.start)
    if turns is None:
        return np.zeros(len(t))
    before, after = tangents[:-1], tangents[1:]
    across = np.linalg.svd(tangents[:1])[2][1:2]  # a director at t[0], fixed in the gripper from then on
    directors = (turns @ (turns[0].T @ across[0])[:, None])[..., 0]
    x, y = directors[:-1], directors[1:]
    carried = transported(before, after, x)
    angle = np.arctan2((np.cross(carried, y) * after).sum(axis=1), (carried * y).sum(axis=1))
    expected = grasp.path.spin(t - grasp.start, tangents)
    angle += 2.0 * np.pi * np.round((expected - angle) / (2.0 * np.pi))
    return np.concatenate([[0.0], np.cumsum(angle)])


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
