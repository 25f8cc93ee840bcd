"""The law of strands that touch: its forces and tangents, which pairs it looks at, and how far strands may go."""

from dataclasses import replace
from typing import Any, cast

import numpy as np
import pytest
from numba import njit
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from dlocore.effects import laws
from dlocore.effects.selfcontact import APART
from dlocore.kernels.banded import Elimination, elimination, factor, reduce_matrix, solve
from dlocore.kernels.nearby import clear, nothing_known
from dlocore.kernels.selfcontact import factor_wide, press, solve_wide, widen
from dlocore.kernels.strands import clear_way, meeting_pairs, near_pairs
from dlocore.problem.discretisation import make_grid
from dlocore.problem.events import closed_grasps
from dlocore.problem.grid import Grid
from dlocore.problem.holding import Starts, close_grasps, hold
from dlocore.problem.problem import Problem, pose
from dlocore.problem.strands import nearest_strands
from dlocore.spline import design_matrix, uniform_knots
from tests.effects.test_self_contact import DIAMETER, fold_scene, knot_scene, lengths

Floats = NDArray[np.float64]
DIMENSIONS = pytest.mark.parametrize("nc", [2, 3, 4], ids=["plane", "space", "twist"])
FEW, MANY = 33, 240  # control points: less than one a segment, and more than four
POINTS = pytest.mark.parametrize("n_u", [FEW, MANY])


# --- the law


@njit  # type: ignore[untyped-decorator]  # numba has no types
def pressed(states: Any, v: Any, tables: Any, p: Any, x: Any, f: Any) -> Any:
    """Press at states (k, n, nc) in turn; return the pairs of the last, their number, and that of looks for pairs."""
    near = nothing_known(states.shape[1], states.shape[2])
    count, looks = 0, 0
    seen = np.full_like(states[0], np.nan)
    for k in range(len(states)):
        count, _ = press(states[k], v, tables.strands, p, x, near, f[k])
        looks += not np.array_equal(seen, near.seen)
        seen[:] = near.seen
    return near.met[0], count, looks


@njit  # type: ignore[untyped-decorator]
def ways(q: Any, others: Any, v: Any, tables: Any, p: Any, x: Any, y: Any) -> Any:
    """Return how far the cable may go from q to each of the others (k, n, nc).

    Returns:
        (k, 2), with nothing known of pairs and with what is known after pressing at q; whether that left alone what
        touches.
    """
    shares = np.empty((len(others), 2))
    kept = True
    for k in range(len(others)):
        near = nothing_known(*q.shape)
        shares[k, 0] = clear(q, others[k], tables.strands, p, x, y, near)
        count, _ = press(q, v, tables.strands, p, x, near, np.zeros_like(q))
        met = near.met[0][:count].copy()
        shares[k, 1] = clear(q, others[k], tables.strands, p, x, y, near)
        kept = kept and np.array_equal(near.met[0][:count], met)
    return shares, kept


class Tangle:
    """A cable whose strands lie on each other in random ways, with the compiled law's parameters."""

    def __init__(self, nc: int, seed: int, n_u: int = 33) -> None:
        random = np.random.default_rng(seed)
        scene = knot_scene("on", "on" if nc == 4 else "off") if nc > 2 else fold_scene("on", True, 1.0)
        self.problem: Problem = pose(scene)
        assert self.problem.nc == nc
        if n_u > FEW:
            # segments of 25 mm, so long that control points lie between those of their ends
            self.problem = replace(self.problem, scene=replace(scene, cable=replace(scene.cable, diameter=0.05)))
        self.grid: Grid = make_grid(self.problem, n_u)
        first = self.grid.tables.strands.first
        assert (np.diff(first).max() > 4) == (n_u > FEW)
        self.parameters = self.problem.law_table()[1]
        self.parameters[laws.SELF_CONTACT, 0] = 0.02 if nc > 2 else 0.085  # [m]: so thick that many pairs touch
        self.parameters[laws.SELF_CONTACT, 4] = 0.1  # [m], least distance along the cable
        self.q = self.grid.start + random.normal(0.0, 1e-3, self.grid.start.shape)
        self.still = np.zeros_like(self.q)

    def press(self, q: Floats, v: Floats | None = None) -> tuple[Floats, Floats, NDArray[np.int64], int]:
        """Return the forces, the nodes, the pairs and their number."""
        f = np.zeros((1, *q.shape))
        x = np.empty((len(self.grid.tables.strands.u), min(q.shape[1], 3)))
        v = self.still if v is None else v
        found, count, _ = pressed(q[None], v, self.grid.tables, self.parameters, x, f)
        return f[0], x, found, count

    def elimination(self) -> Elimination:
        """Return the elimination of what the scene's grasps hold."""
        grasps, starts = closed_grasps(self.problem.scene, 0.0, 0.1), Starts()
        close_grasps(self.problem, self.grid, grasps, starts, None)
        return hold(self.problem, self.grid, grasps, np.zeros(1), starts, self.grid.start).elimination

    def tangent(
        self, e: Elimination, band: Floats, scales: tuple[float, float, float] = (1.0, 0.0, 1.0)
    ) -> tuple[Floats, NDArray[np.int64]]:
        """Return the widened tangent above its diagonal and the ends of its rows."""
        _, x, found, count = self.press(self.q)
        assert count > 10
        S, end = np.zeros((len(band), len(band))), np.zeros(len(band), np.int64)
        widen(
            self.q.shape[1],
            self.still,
            self.grid.tables.strands,
            self.parameters,
            x,
            found,
            count,
            scales,
            e,
            band,
            end,
            S,
        )
        return S, end


def nothing_held(q: Floats) -> Elimination:
    """Return the elimination where nothing holds the control points q (n, nc)."""
    none = np.zeros(0, np.int64)
    follow = np.zeros((0, len(q)))
    return cast(Elimination, elimination(len(q), q.shape[1], min(q.shape[1], 3), none, follow, none, follow))


@POINTS
@DIMENSIONS
def test_forces_balance_and_turn_nothing(nc: int, n_u: int) -> None:
    tangle = Tangle(nc, 1, n_u)
    f, _, _, count = tangle.press(tangle.q, np.random.default_rng(2).normal(0.0, 0.1, tangle.q.shape))
    assert count > 10
    # sums over the control points of forces: rounding
    assert np.abs(f.sum(axis=0)).max() <= 1e-12 * np.abs(f).max() * len(f)
    d = min(nc, 3)
    q, g = np.zeros((len(f), 3)), np.zeros((len(f), 3))
    q[:, :d], g[:, :d] = tangle.q[:, :d], f[:, :d]
    torque = np.cross(q, g).sum(axis=0)
    assert np.abs(torque).max() <= 1e-12 * np.abs(f).max() * len(f)


@POINTS
@DIMENSIONS
def test_the_tangent_is_the_derivative_of_the_forces(nc: int, n_u: int) -> None:
    tangle = Tangle(nc, 3, n_u)
    size = tangle.q.size
    e = nothing_held(tangle.q)
    S, _ = tangle.tangent(e, np.zeros((size, 4 * nc)))
    K = np.triu(S) + np.triu(S, 1).T
    random = np.random.default_rng(4)
    for _ in range(4):
        way = random.normal(0.0, 1.0, tangle.q.shape)
        step = 1e-8  # [m]: the passage of the law, 25 micrometres wide, is thousands of steps
        slope = (tangle.press(tangle.q + step * way)[0] - tangle.press(tangle.q - step * way)[0]) / (2 * step)
        # differences of forces of 1 by steps of 1e-8: rounding 1e-7; a pair that enters in between adds to it
        assert np.abs(K @ way.ravel() - slope.ravel()).max() <= 1e-5 * np.abs(slope).max()


@DIMENSIONS
def test_the_tangent_by_velocity_is_the_derivative_of_the_damping(nc: int) -> None:
    tangle = Tangle(nc, 5)
    size = tangle.q.size
    S, _ = tangle.tangent(nothing_held(tangle.q), np.zeros((size, 4 * nc)), (0.0, 1.0, 0.0))
    C = np.triu(S) + np.triu(S, 1).T
    v = 1e-6 * np.random.default_rng(6).normal(0.0, 1.0, tangle.q.shape)  # so slow that no pair lets go
    change = tangle.press(tangle.q, v)[0] - tangle.press(tangle.q)[0]
    # linear in so small a velocity: what is left is the rounding of the whole forces
    forces = np.abs(tangle.press(tangle.q)[0]).max()
    assert np.abs(change).max() > 1e-9 * forces
    assert np.abs(C @ v.ravel() - change.ravel()).max() <= 1e-14 * forces


@DIMENSIONS
def test_the_wide_solve_is_the_dense_one(nc: int) -> None:
    tangle = Tangle(nc, 7)
    random = np.random.default_rng(8)
    e = tangle.elimination()
    n, width = tangle.q.size, 4 * nc
    band = np.zeros((n, width))
    for o in range(width):
        band[: n - o, o] = random.normal(0.0, 1.0, n - o)
    band[:, 0] += 2.0 * width  # diagonally dominant
    band *= 1e3
    reduced = np.empty((n - len(e.held), e.width))
    reduce_matrix(e, band, reduced)
    S, end = tangle.tangent(e, reduced, (1.0, 0.0, 0.0))
    # the reduced matrix densely, Z' (B + K) Z
    Z = np.zeros((n, len(reduced)))
    for i in range(n):
        if e.index[i] >= 0:
            Z[i, e.index[i]] = 1.0
        else:
            for s in range(e.start[-1 - e.index[i]], e.start[-e.index[i]]):
                Z[i, e.index[e.dof[s]]] += e.coefficient[s]
    full, _ = tangle.tangent(nothing_held(tangle.q), band, (1.0, 0.0, 0.0))
    dense = Z.T @ (np.triu(full) + np.triu(full, 1).T) @ Z
    scale = np.abs(dense).max()
    # sums of some hundred products: rounding
    assert np.abs(np.triu(dense) - np.triu(S)).max() <= 1e-13 * scale
    b = random.normal(0.0, 1.0, len(reduced))
    x = b.copy()
    filled, columns = np.empty_like(end), np.empty(S.shape, np.int32)
    assert factor_wide(S, end, filled, columns) == -1
    solve_wide(S, filled, columns, x)
    # the matrix is well conditioned but for contact 1e4 times stiffer than the band
    assert np.abs(dense @ x - b).max() <= 1e-10
    assert np.abs(x - np.linalg.solve(dense, b)).max() <= 1e-8 * np.abs(x).max()


def test_a_tangent_without_pairs_is_the_band() -> None:
    random = np.random.default_rng(9)
    tangle = Tangle(3, 9)
    e = tangle.elimination()
    band = random.normal(0.0, 1.0, (tangle.q.size - len(e.held), 12))
    band[:, 0] += 24.0
    for o in range(12):
        band[len(band) - o :, o] = 0.0
    _, x, found, _ = tangle.press(tangle.q)
    S, end = np.zeros((len(band), len(band))), np.zeros(len(band), np.int64)
    tables, scales = tangle.grid.tables, (1.0, 0.0, 1.0)
    widen(3, tangle.still, tables.strands, tangle.parameters, x, found, 0, scales, e, band, end, S)
    a, b = np.ones(len(band)), np.ones(len(band))
    filled, columns = np.empty_like(end), np.empty(S.shape, np.int32)
    assert factor_wide(S, end, filled, columns) == -1
    solve_wide(S, filled, columns, a)
    factor(band)
    solve(band, b)
    assert np.abs(a - b).max() <= 1e-13, "two orders of the same sums"


@DIMENSIONS
def test_forces_turn_with_the_cable(nc: int) -> None:
    tangle = Tangle(nc, 10)
    d = min(nc, 3)
    turn = Rotation.from_rotvec([0.0, 0.0, 1.1] if nc == 2 else [0.4, -0.7, 1.1]).as_matrix()[:d, :d]
    turn = turn @ np.diag([-1.0, *np.ones(d - 1)])  # and a reflection
    moved = tangle.q.copy()
    moved[:, :d] = tangle.q[:, :d] @ turn.T + 0.3
    f, g = tangle.press(tangle.q)[0], tangle.press(moved)[0]
    # positions are rounded to 1e-16 m, and forces change by 1e-10 of themselves over it at a stiffness of 1e6 N/m
    assert np.abs(f[:, :d] @ turn.T - g[:, :d]).max() <= 1e-9 * np.abs(f).max()


@POINTS
@DIMENSIONS
def test_a_tangent_is_written_over_the_last_one(nc: int, n_u: int) -> None:
    random = np.random.default_rng(13)
    tangle = Tangle(nc, 13, n_u)
    e = tangle.elimination()
    band = random.normal(0.0, 1.0, (tangle.q.size - len(e.held), 4 * nc))
    band[:, 0] += 1e6
    S, end = tangle.tangent(e, band)
    assert factor_wide(S, end, np.empty_like(end), np.empty(S.shape, np.int32)) == -1
    # the next tangent is of fewer pairs
    _, x, found, count = tangle.press(tangle.q)
    p, tables, scales = tangle.parameters, tangle.grid.tables, (1.0, 0.0, 1.0)
    widen(nc, tangle.still, tables.strands, p, x, found, count // 3, scales, e, band, end, S)
    fresh, its_end = np.zeros_like(S), np.zeros_like(end)
    widen(nc, tangle.still, tables.strands, p, x, found, count // 3, scales, e, band, its_end, fresh)
    assert np.array_equal(end, its_end)
    assert np.array_equal(S, fresh)


# --- what is known of pairs


@POINTS
@DIMENSIONS
def test_what_is_known_of_pairs_changes_no_force(nc: int, n_u: int) -> None:
    random = np.random.default_rng(14)
    tangle = Tangle(nc, 14, n_u)
    D = tangle.parameters[laws.SELF_CONTACT, 0]
    # carried as a whole, which brings nothing nearer to anything, and crumpled by diameters
    sizes = np.array([0.0, 0.2, 0.5, 0.7])[:, None, None] * D
    states = tangle.q + 50.0 * D + sizes * random.uniform(-0.5, 0.5, (4, *tangle.q.shape))
    x, f = tangle.press(tangle.q)[1], np.zeros_like(states)
    found, count, looks = pressed(states, tangle.still, tangle.grid.tables, tangle.parameters, x, f)
    assert looks == 1
    anew = [tangle.press(state) for state in states]
    assert np.array_equal(f, [one[0] for one in anew])
    assert np.array_equal(found[:count], anew[-1][2][: anew[-1][3]])
    assert len({one[3] for one in anew}) > 1, "pairs come and go"


@DIMENSIONS
def test_pairs_are_looked_for_anew_where_parts_of_the_cable_have_moved_against_each_other(nc: int) -> None:
    tangle = Tangle(nc, 16)
    D = tangle.parameters[laws.SELF_CONTACT, 0]
    half = np.arange(len(tangle.q))[:, None] < len(tangle.q) // 2
    for way, expected in ((1.9, 1), (2.1, 2)):
        states = np.array([tangle.q, tangle.q + half * way * D * np.eye(nc)[1]])
        x, f = tangle.press(tangle.q)[1], np.zeros_like(states)
        *_, looks = pressed(states, tangle.still, tangle.grid.tables, tangle.parameters, x, f)
        assert looks == expected
        assert np.array_equal(f[1], tangle.press(states[1])[0])


@DIMENSIONS
def test_what_is_known_of_pairs_changes_no_way(nc: int) -> None:
    random = np.random.default_rng(15)
    tangle = Tangle(nc, 15)
    tables, p = tangle.grid.tables, tangle.parameters
    D = p[laws.SELF_CONTACT, 0]
    others = tangle.q + D * random.uniform(-0.55, 0.55, (20, *tangle.q.shape))
    x = tangle.press(tangle.q)[1]
    shares, kept = ways(tangle.q, others, tangle.still, tables, p, x, np.empty_like(x))
    assert np.array_equal(shares[:, 0], shares[:, 1])
    assert shares.min() < 1.0
    assert shares.max() > 0.0
    assert kept, "the pairs that touch are still those that touch"


# --- strands on their way


@pytest.mark.parametrize("nd", [2, 3])
def test_strands_on_their_way_stop_before_they_pass(nd: int) -> None:
    random = np.random.default_rng(11)
    u = np.linspace(0.0, 0.4, 81)
    separation = 4.0 * DIAMETER
    for _ in range(50):
        # two straight strands, the second far along the cable, thrown through the first
        across = random.uniform(0.3, 2.8)
        first = np.column_stack([np.linspace(-0.1, 0.1, 40), np.zeros(40), np.zeros(40)])
        second = np.column_stack([np.cos(across) * first[:, 0], np.sin(across) * first[:, 0], np.full(40, 0.01)])
        if nd == 2:
            second = first[::-1] + np.array([0.0, 0.02, 0.0])
        far = np.array([[0.5, 0.5, 0.5]])
        before = np.ascontiguousarray(np.concatenate([first, far, second])[:, :nd])
        move = np.array([random.uniform(-0.02, 0.02), -0.05, 0.0] if nd == 2 else [0.0, 0.0, -0.05])
        after = before.copy()
        after[41:] += move[:nd]
        # the first segment of the cable that leads from one strand to the other is far away
        _, share = clear_way(before, after, u, DIAMETER, separation, np.empty((1, 2), np.int64))
        assert 0.0 < share < 1.0
        gap = 0.02 if nd == 2 else 0.01
        left = gap - 0.05 * share
        # it stops within a tenth of where the gap is half a diameter
        assert 0.4 * DIAMETER <= left <= 0.51 * DIAMETER


@pytest.mark.parametrize("nd", [2, 3])
def test_no_pair_of_segments_that_meets_on_the_way_is_skipped(nd: int) -> None:
    random = np.random.default_rng(21)
    count, separation = 120, 4.0 * DIAMETER
    u = DIAMETER * np.arange(count)
    z = np.linspace(0.0, 1.0, 9)[:, None, None]
    i, j = np.triu_indices(count - 1, 1)
    strands = u[j] - u[i + 1] >= separation
    i, j = i[strands], j[strands]
    found = 0
    for _ in range(5):
        # a crumpled cable, and one that it becomes: each segment a diameter long
        turned = random.normal(0.0, 1.0, (count, nd))
        ends = [turned, turned + random.normal(0.0, 0.2, (count, nd))]
        before, after = (DIAMETER * np.cumsum(t / np.linalg.norm(t, axis=1, keepdims=True), axis=0) for t in ends)
        room = np.empty((1, 2), np.int64)
        pairs, many = meeting_pairs(before, after, u, 0.5 * DIAMETER, separation, room)
        still, few = near_pairs(before, u, DIAMETER, separation, room)
        listed, near = np.zeros((2, count, count), bool)
        listed[pairs[:many, 0], pairs[:many, 1]] = True
        near[still[:few, 0], still[:few, 1]] = True
        way = before + z * (after - before)
        # ends and middles of the segments alone: no nearer than the segments are
        own = [way[:, i], way[:, i + 1], 0.5 * (way[:, i] + way[:, i + 1])]
        other = [way[:, j], way[:, j + 1], 0.5 * (way[:, j] + way[:, j + 1])]
        gaps = np.min([np.linalg.norm(a - b, axis=2) for a in own for b in other], axis=0)
        met = gaps.min(axis=0) <= 0.5 * DIAMETER
        assert np.all(listed[i, j] | ~met)
        assert np.all(near[i, j] | (gaps[0] > DIAMETER))
        found += int(met.sum())
        assert many < len(i) // 2  # most are left out
    assert found > 0


def test_the_smallest_distance_of_strands_is_found() -> None:
    random = np.random.default_rng(12)
    knots = np.concatenate([[0.0] * 3, np.linspace(0.0, 1.0, 18), [1.0] * 3])
    greville = (knots[1:-3] + knots[2:-2] + knots[3:-1]) / 3
    from scipy.interpolate import BSpline

    u = np.linspace(0.0, 1.0, 2001)
    for _ in range(20):
        wild = np.cumsum(random.normal(0.0, 1.0, (len(greville), 3)), axis=0)
        wild *= 1.0 / lengths(BSpline(knots, wild, 3)(u))[-1]
        x = BSpline(knots, wild, 3)(u)
        strands = np.abs(u[:, None] - u[None]) > 0.2
        true = np.sqrt(((x[:, None] - x[None]) ** 2).sum(axis=-1)[strands].min())
        found = nearest_strands(knots, wild[None], 3, 0.05, 0.19)
        if true > 0.19:
            assert found == np.inf or found > 0.18
        else:
            # the cable is uneven here, so that nodes 0.05 of its coordinate apart miss some of it
            assert found == pytest.approx(true, abs=0.02)


def test_strands_are_found_where_a_long_cable_winds_and_moves() -> None:
    # most states, and most strands of the others, are not looked at: they can't be near, as the cable turns too little
    random = np.random.default_rng(5)
    u, n = np.linspace(0.0, 1.0, 801), 40
    within, separation = 1.2 * DIAMETER, APART * DIAMETER
    near = 0
    for _ in range(12):
        turns = random.normal(0.0, 1.0, (4, 2)) * random.uniform(0.5, 3.0)
        states = []
        for share in np.linspace(0.2, 1.6, 15):
            angle = share * sum(a * np.sin((k + 1) * np.pi * u) + b * u ** (k + 1) for k, (a, b) in enumerate(turns))
            climb = 0.1 * np.sin(3.0 * angle)
            tangents = np.column_stack([np.cos(angle) * np.cos(climb), np.sin(angle) * np.cos(climb), np.sin(climb)])
            line = np.concatenate([np.zeros((1, 3)), np.cumsum(0.5 * (tangents[1:] + tangents[:-1]), axis=0) / 800])
            states.append(fit_line(u, line, n))
        knots, states_ = uniform_knots(n, 1.0), np.stack(states)
        x = np.stack([design_matrix(knots, u) @ q for q in states_])
        apart = np.linalg.norm(x[:, :, None] - x[:, None], axis=3)[:, np.abs(u[:, None] - u[None]) >= separation].min()
        found = nearest_strands(knots, states_, 3, DIAMETER, within)
        near += bool(np.isfinite(found))
        assert np.isfinite(found) if apart < 0.9 * within else (found == np.inf or apart < 1.1 * within)
        assert found == np.inf or found == pytest.approx(apart, abs=0.3 * DIAMETER)
    assert 2 < near < 10


def fit_line(u: Floats, line: Floats, n: int) -> Floats:
    """Return the control points (n, 3) of the least-squares spline through points (k, 3) at u (k,)."""
    return np.linalg.lstsq(design_matrix(uniform_knots(n, 1.0), u), line)[0]
