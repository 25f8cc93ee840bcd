"""The initial state of a recorded motion: shape and velocity of the spline from the markers of a few frames."""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import cast

import numpy as np
from numpy.typing import NDArray

from dlocore.effects import laws
from dlocore.kernels.assembly import NO_RATES, assemble, stored_energy
from dlocore.problem.discretisation import make_grid, room_for
from dlocore.problem.grid import Grid
from dlocore.problem.problem import pose
from dlocore.scene.cable import Cable
from dlocore.scene.scene import Grasp, Scene, Straight
from dlocore.solvers.bands import dense_of
from dlocore.spline import design_matrix, greville

Floats = NDArray[np.float64]

_AXES = (0, 1, 2)
# The following numbers are relative, so that a cable of another size and density has a similar start. For the
# relaxation:
_AXIAL = 100.0, 1e3  # stiffness in weights of the cable, and in EI/L^2: it keeps the length within the markers' noise
_SPRING = 100.0  # of a marker, in weights of a length; a metre of 50 g and 1e-3 N m^2 gives way by half over 0.1 m
# and for the velocity:
_EVEN = 1e-5  # of L^3: its smoothing, compared with markers a tenth of the length apart
_KEPT_LENGTH = 10.0  # lengths: weight of the stretch rate compared with a marker's velocity
_TOLERANCE = 1e-8  # of the length
_ON_EARTH = 9.81  # [m/s^2], also if there is no gravity


@dataclass(frozen=True, eq=False)
class HeldRows:
    """Held rows of the spline: C q = target, solved for the pivots.

    Attributes:
        free: (n, free) dependence of the control points on the free ones.
        offset: (n, rows) their dependence on the targets.
    """

    free: Floats
    offset: Floats

    @staticmethod
    def of(knots: Floats, held: tuple[tuple[float, int], ...]) -> "HeldRows":
        """Return the rows of (u [m], derivative 0 or 1)."""
        n = len(knots) - 4
        if not held:
            return HeldRows(np.eye(n), np.zeros((n, 0)))
        C = np.vstack([design_matrix(knots, [u], order) for u, order in held])
        left, size, right = np.linalg.svd(C)
        null = right[len(C) :].T
        return HeldRows(null, right[: len(C)].T @ ((left / size).T))


@dataclass(frozen=True, eq=False)
class StartFit:
    """Fits the start of recordings of one cable on one grid.

    The shape is where the cable would rest under its weight with springs to the markers. So a stiff cable bends no more
    than it can between two noisy markers, and there may be more control points than markers. The velocity is smooth,
    keeps the length, and comes as near to that of the markers as possible.

    Args:
        grid: whose knots and tables are used.
        held: (u [m], 0 for a position or 1 for a direction) of what is held.
    """

    grid: Grid
    held: tuple[tuple[float, int], ...]

    @cached_property
    def rows(self) -> HeldRows:
        """The held rows, solved."""
        return HeldRows.of(self.grid.knots, self.held)

    def shape(
        self, cable: Cable, gravity: Floats, u: Floats, markers: Floats, targets: Floats, guess: Floats | None = None
    ) -> Floats:
        """Return control points (n, 3) [m].

        Args:
            cable: with its EI and density.
            gravity: (3,) [m/s^2].
            u: markers' coordinates (m,) [m].
            markers: (m, 3) [m], all seen.
            targets: positions [m] and unit directions (held, 3).
            guess: control points near it; None: along the markers.
        """
        knots, tables = self.grid.knots, self.grid.tables
        n = len(knots) - 4
        rows = self.rows
        active = np.zeros(laws.COUNT, np.int64)
        active[[laws.STRETCH, laws.BEND]] = 1
        p = np.zeros((laws.COUNT, laws.PARAMETERS))
        density, bending = cable.linear_density, cast(float, cable.bending_stiffness)
        length, stiffness = float(knots[-1]), _SPRING * _ON_EARTH * density
        p[laws.STRETCH, 0] = max(_AXIAL[0] * _ON_EARTH * density * length, _AXIAL[1] * bending / length**2)
        p[laws.BEND, 0] = bending
        # even for a planar motion, the start shape is found in space
        history = self.grid.past()._replace(room=np.zeros(room_for(len(_AXES), len(tables.curvature.w))))
        B = design_matrix(knots, u)
        load = np.asarray(tables.weight)[:, None] * (density * gravity)
        springs = stiffness * np.kron(rows.free.T @ (B.T @ B) @ rows.free, np.eye(3))
        Z = np.kron(rows.free, np.eye(3))
        if guess is None:
            guess = _along(greville(knots), u, markers)
        C = np.vstack([design_matrix(knots, [at], order) for at, order in self.held]) if self.held else np.zeros((0, n))
        q = guess + rows.offset @ (targets - C @ guess)

        def energy(q: Floats) -> float:
            away = B @ q - markers
            stored = float(stored_energy(_AXES, q, tables, active, p, history))
            return stored - float((load * q).sum()) + 0.5 * stiffness * float((away * away).sum())

        K, f, still = np.empty((3 * n, 12)), np.empty((n, 3)), np.zeros((n, 3))
        before, rounding = energy(q), 1e-15 * stiffness * length**2
        for _ in range(60):
            scales = (1.0, 0.0, 0.0)  # the positive part: the full one may not be positive along noisy markers
            assemble(_AXES, q, still, tables, active, p, history, NO_RATES, scales, f, K)
            force = (Z.T @ (f - load + stiffness * B.T @ (B @ q - markers)).ravel()).astype(float)
            step = -np.linalg.solve(Z.T @ dense_of(K) @ Z + springs, force)
            slope, share = float(force @ step), 1.0
            change = (Z @ step).reshape(n, 3)
            after = energy(q + change)
            while not after <= before + 1e-4 * share * slope + rounding and share > 1e-4:
                share *= 0.5
                after = energy(q + share * change)
            q, before = q + share * change, after
            if np.abs(change).max() < _TOLERANCE * length:
                break
        return np.ascontiguousarray(q)

    def velocity(self, q: Floats, u: Floats, speeds: Floats, targets: Floats) -> Floats:
        """Return control points (n, 3) [m/s] of the velocity of the shape q.

        Args:
            q: control points (n, 3) [m].
            u: markers' coordinates (m,) [m].
            speeds: their velocities (m, 3) [m/s].
            targets: velocities of what is held (held, 3).
        """
        tables, n, length = self.grid.tables, len(q), float(self.grid.knots[-1])
        rows = self.rows
        B = design_matrix(self.grid.knots, u)
        first = _matrix(tables.axial.first, tables.axial.b1, n)
        tangent = first @ q
        tangent /= np.linalg.norm(tangent, axis=1)[:, None]
        second = _matrix(tables.curvature.first, tables.curvature.b2, n)
        second *= np.sqrt(_EVEN * length**3 * np.asarray(tables.curvature.w))[:, None]
        stretch = (_KEPT_LENGTH * length * first[:, :, None] * tangent[:, None, :]).reshape(len(first), -1)
        J = np.vstack([np.kron(B, np.eye(3)), stretch, np.kron(second, np.eye(3))])
        known = rows.offset @ targets
        y = np.concatenate([speeds.ravel(), np.zeros(len(J) - speeds.size)]) - J @ known.ravel()
        Z = np.kron(rows.free, np.eye(3))
        free = np.linalg.lstsq(J @ Z, y, rcond=None)[0]
        return np.ascontiguousarray(known + (Z @ free).reshape(n, 3))


@lru_cache(maxsize=16)
def start_fit(length: float, n_u: int, held: tuple[tuple[float, int], ...]) -> StartFit:
    """Return the fit on the grid of `n_u` control points of a scene whose grasps hold the cable in this way.

    Args:
        length: of the cable [m].
        n_u: number of control points.
        held: (u [m], 0 for a position or 1 for a direction) of what is held.
    """
    directions = {u for u, order in held if order == 1}
    grasps = tuple(Grasp(u=u, hold="tangent" if u in directions else "point") for u, order in held if order == 0)
    # knots and tables depend only on where it is held, not on its material
    cable = Cable(length=length, diameter=0.01 * length, linear_density=1.0, bending_stiffness=1.0)
    straight = Scene(cable=cable, shape=Straight(), grasps=grasps, horizon=1.0, effects={"twist": "off"})
    return StartFit(make_grid(pose(straight), n_u), held)


def _along(at: Floats, u: Floats, markers: Floats) -> Floats:
    """Return points (n, 3) [m] at coordinates on the polygon of markers, which continues straight beyond its ends."""
    out = np.column_stack([np.interp(at, u, markers[:, d]) for d in range(3)])
    for end, inner, beyond in ((0, 1, u[0] - at), (-1, -2, at - u[-1])):
        chord = markers[end] - markers[inner]
        out += np.maximum(beyond, 0.0)[:, None] * chord / max(float(np.linalg.norm(chord)), _TOLERANCE * u[-1])
    return out


def _matrix(first: NDArray[np.int64], values: Floats, n: int) -> Floats:
    out = np.zeros((len(first), n))
    out[np.arange(len(first))[:, None], np.asarray(first)[:, None] + np.arange(4)] = values
    return out
