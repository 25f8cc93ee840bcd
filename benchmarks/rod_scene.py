"""Convert a `Scene` to arrays of the explicit discrete elastic rod: nodes, start, plane, hinges, prescribed motion."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from dlocore.scene.scene import ControlPoints, Grasp, Points, Scene
from dlocore.spline import design_matrix, uniform_knots

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
SAFETY = 0.8  # of the stability limit of the time step


@dataclass(frozen=True)
class Start:
    """The start at the nodes: positions (n, 3) [m], velocities (n, 3) [m/s], directions r_u/|r_u| (n, 3)."""

    positions: Floats
    velocities: Floats
    directions: Floats


@dataclass(frozen=True)
class Hinges:
    """Where bending acts: pairs of joined columns, 1/l [1/m], and rest angles [rad]."""

    first: Integers
    second: Integers
    per_length: Floats
    rest: Floats


@dataclass(frozen=True)
class Hold:
    """A closed gripper: its grasp, its node, and that node's position (3,) [m] and direction (3,) when it closed."""

    grasp: Grasp
    node: int
    origin: Floats
    direction: Floats

    @property
    def turns(self) -> bool:
        """Whether the direction is held too."""
        return self.grasp.hold == "tangent"

    def path(self, t: Floats) -> Floats:
        """Return the prescribed positions at `t` (k,) [s]; (k, 3) [m]."""
        return self.grasp.path.at(t - self.grasp.start, self.origin)

    def directions(self, t: Floats) -> Floats:
        """Return the prescribed directions at `t` (k,) [s]; (k, 3)."""
        turns = self.grasp.path.rotation_at(t - self.grasp.start)
        return np.broadcast_to(self.direction, (len(t), 3)) if turns is None else turns @ self.direction


def breakpoints(scene: Scene) -> list[float]:
    """Return the increasing material coordinates [m] of the ends, the grasps and the loads."""
    return sorted({0.0, scene.cable.length, *(g.u for g in scene.grasps), *(p.u for p in scene.loads)})


def material_grid(scene: Scene, elements: int) -> Floats:
    """Return about `elements` + 1 nodes [m], evenly spaced between the grasps and loads, each of which is a node."""
    length = scene.cable.length
    breaks = np.unique(np.round(breakpoints(scene), 12))
    counts = np.maximum(1, np.round(np.diff(breaks) * elements / length)).astype(int)
    parts = [np.linspace(a, b, n, endpoint=False) for a, b, n in zip(breaks[:-1], breaks[1:], counts, strict=True)]
    return np.concatenate([*parts, [length]])


def start_of(scene: Scene, grid: Floats) -> Start:
    """Return the start as it was given, before any settling."""
    shape, length = scene.shape, scene.cable.length
    if isinstance(shape, Points):
        raise ValueError("the explicit rod takes no Points as start: give Straight or ControlPoints")
    if isinstance(shape, ControlPoints):
        control = np.asarray(shape.control_points)[:, :3]
        knots = uniform_knots(len(control), length) if shape.knots is None else np.asarray(shape.knots)
        positions, slopes = design_matrix(knots, grid) @ control, design_matrix(knots, grid, 1) @ control
    else:
        slopes = np.tile(np.asarray(shape.direction), (len(grid), 1))
        slopes /= np.linalg.norm(shape.direction)
        positions = np.asarray(shape.start) + grid[:, None] * slopes
    if shape.velocity is None:
        velocities = np.zeros_like(positions)
    elif np.ndim(shape.velocity) == 1:
        velocities = np.tile(np.asarray(shape.velocity), (len(grid), 1))
    elif isinstance(shape, ControlPoints):
        velocities = design_matrix(knots, grid) @ np.asarray(shape.velocity)[:, :3]
    else:
        rows = np.asarray(shape.velocity)
        velocities = CubicSpline(np.linspace(0.0, length, len(rows)), rows)(grid)
    return Start(positions, velocities, slopes / np.linalg.norm(slopes, axis=1)[:, None])


def plane_of(scene: Scene, start: Start) -> tuple[int, ...]:
    """Return the coordinates that move: two where everything happens in a coordinate plane, otherwise all three."""
    tolerance = 1e-12 * scene.cable.length
    for axis in (2, 1, 0):
        level = start.positions[0, axis]
        off = [np.abs(start.positions[:, axis] - level).max(), np.abs(start.velocities[:, axis]).max()]
        off += [abs(np.asarray(scene.environment.gravity)[axis])]
        off += [np.abs(np.atleast_2d(load.force)[:, axis]).max() for load in scene.loads]
        for grasp in scene.grasps:
            t = np.linspace(0.0, grasp.path.duration, 257)
            turns = grasp.path.rotation_at(t)
            off.append(np.abs(grasp.path.at(t, np.full(3, level))[:, axis] - level).max())
            off.append(0.0 if turns is None else np.abs(turns[:, axis, axis] - 1.0).max())
        if max(off) <= tolerance:
            return tuple(d for d in range(3) if d != axis)
    return (0, 1, 2)


@dataclass(frozen=True)
class Rod:
    """The parameters of a discrete rod: nodes [m], moving coordinates, edge and cell lengths [m], SI coefficients."""

    grid: Floats
    axes: tuple[int, ...]
    still: Floats
    h: Floats
    cells: Floats
    start: Floats
    axial: float
    bending: float
    bending_damping: float
    density: float
    drag: float
    quadratic: float
    gravity: Floats
    rest: str

    @staticmethod
    def of(scene: Scene, grid: Floats, start: Start) -> "Rod":
        """Return the rod of `scene`; effects that are switched off and the damping of stretch have a zero coefficient.

        Raises:
            ValueError: the scene has something that this rod does not model.
        """
        cable, around, axes = scene.cable, scene.environment, plane_of(scene, start)
        if around.table is not None:
            raise ValueError("the explicit rod has no table")
        if scene.effects.get("inertia") == "off":
            raise ValueError("the explicit rod can't leave out inertia")
        if cable.point_masses:
            raise ValueError("the explicit rod has no point masses")
        if not isinstance(cable.rest_shape, str) or (cable.rest_shape == "initial" and len(axes) == 3):
            raise ValueError("the explicit rod is straight at rest, or in the plane as it starts")

        def on(effect: str, value: float | None) -> float:
            return 0.0 if scene.effects.get(effect) == "off" or value is None else float(value)

        h = np.diff(grid)
        return Rod(
            grid=grid,
            axes=axes,
            still=start.positions[0],
            h=h,
            cells=0.5 * (np.append(h, 0.0) + np.append(0.0, h)),
            start=start.positions[:, list(axes)].T.copy(),
            axial=on("stretch", cable.axial_stiffness),
            bending=on("bend", cable.bending_stiffness),
            bending_damping=on("damping", cable.bending_damping),
            density=cable.linear_density,
            drag=on("drag", around.drag),
            quadratic=on("drag", around.drag_quadratic),
            gravity=on("gravity", 1.0) * np.asarray(around.gravity)[list(axes)],
            rest=cable.rest_shape,
        )

    @property
    def step_limit(self) -> float:
        """Longest safe time step [s]: SAFETY 2/omega (sqrt(1 + zeta^2) - zeta) of the fastest axial and bending mode.

        omega^2 = 4 EA/(mu h^2) + 16 EI/(mu h^4) and zeta = 8 eta/(mu h^4 omega) at the shortest edge, since the bending
        damping is explicit.
        """
        h = self.h.min()
        omega = np.sqrt((4.0 * self.axial / h**2 + 16.0 * self.bending / h**4) / self.density)
        zeta = 8.0 * self.bending_damping / (self.density * h**4 * omega)
        return float(SAFETY * 2.0 / omega / (np.sqrt(1.0 + zeta**2) + zeta))

    def lift(self, planar: Floats) -> Floats:
        """Return positions (..., dims) in space; (..., 3) [m]."""
        out = np.empty((*planar.shape[:-1], 3))
        out[:] = self.still
        out[..., list(self.axes)] = planar
        return out

    def hinges(self, holds: list[Hold]) -> Hinges:
        """Return the hinges: one at each inner node, or one on either side of a held direction (column edges + c)."""
        edges = len(self.h)
        clamped = {hold.node: edges + c for c, hold in enumerate(holds)}
        joints: list[tuple[int, int, float]] = []
        for node in range(edges + 1):
            if node not in clamped:
                joints += [(node - 1, node, self.cells[node])] if 0 < node < edges else []
                continue
            joints += [(node - 1, clamped[node], 0.5 * self.h[node - 1])] if node > 0 else []
            joints += [(clamped[node], node, 0.5 * self.h[node])] if node < edges else []
        a, b = (np.array([joint[i] for joint in joints], dtype=np.int64) for i in (0, 1))
        length = np.array([joint[2] for joint in joints])
        rest = np.zeros(len(a))
        if self.rest == "initial":
            held = [np.asarray(hold.directions(np.array([hold.grasp.start]))[0])[list(self.axes)] for hold in holds]
            t = np.concatenate([np.diff(self.start, axis=1), np.reshape(held, (-1, len(self.axes))).T], axis=1)
            rest = np.arctan2(t[0, a] * t[1, b] - t[1, a] * t[0, b], t[0, a] * t[0, b] + t[1, a] * t[1, b])
        return Hinges(a, b, 1.0 / length, rest)

    def direction(self, x: Floats, node: int) -> Floats:
        """Return the direction of the cable `x` (dims, n) at a node, of second order in h; (3,)."""
        near = min(max(node, 1), len(self.h) - 1)
        e = np.diff(x[:, near - 1 : near + 2], axis=1)
        t, (h0, h1) = e / np.linalg.norm(e, axis=0), self.h[near - 1 : near + 1]
        at = (self.grid[node] - self.grid[near] + 0.5 * h0) / (0.5 * (h0 + h1))
        mean = (1.0 - at) * t[:, 0] + at * t[:, 1]
        out = np.zeros(3)
        out[list(self.axes)] = mean / np.linalg.norm(mean)
        return out
