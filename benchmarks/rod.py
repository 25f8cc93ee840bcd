"""An independent check of the spline solver: a step-by-step explicit simulation of the same cable.

It is a discrete elastic rod: lumped masses at nodes, axial springs between them, bending springs on the turning angle
(benchmarks/rod_kernel.py), and position Verlet with a step below the stability limit. It is of second order in the node
spacing, so (4 fine - coarse)/3 is of fourth order (Richardson), and the change from one such pair to the next estimates
the error. It shares no code with the solver; it reads the same `Scene`.

Not covered, and refused: `Points` as start, given rest shapes, rest curvature in space, tables.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline

from benchmarks.rod_kernel import march_plane, march_space
from benchmarks.rod_scene import Hold, Rod, Start, breakpoints, material_grid, start_of
from dlocore.scene.paths import Still
from dlocore.scene.scene import Load, Scene

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]
COARSEST = 40  # elements; multiples of L/40 are nodes on every level
CHUNK = 100_000  # steps for which paths are tabulated at once


@dataclass(frozen=True)
class Converged:
    """A converged motion.

    Attributes:
        t: (k,) [s].
        u: (n,) [m].
        positions: (k, n, 3) [m].
        error_estimate: largest change of any position in the last refinement [m].
        elements: of the finest simulation.
        tolerance_met: whether the estimate is below the tolerance.
    """

    t: Floats
    u: Floats
    positions: Floats
    error_estimate: float
    elements: int
    tolerance_met: bool


def simulate(scene: Scene, *, elements: int = 200, times: ArrayLike | None = None) -> tuple[Floats, Floats, Floats]:
    """Simulate `scene` with about `elements` elements; nodes lie on every grasp and load.

    Args:
        scene: what to simulate.
        elements: number of elements.
        times: (k,) [s], rising, within the horizon; None: 33 evenly spaced ones.

    Returns:
        t (k,) [s], u (n,) [m] and positions (k, n, 3) [m].

    Raises:
        ValueError: the scene has something this rod doesn't model.
        FloatingPointError: the simulation left the finite numbers.
    """
    return _simulate(scene, material_grid(scene, elements), times)


def richardson(scene: Scene, *, elements: int = 400, times: ArrayLike | None = None) -> tuple[Floats, Floats, Floats]:
    """Return (4 fine - coarse)/3 of simulations with `elements` and half as many, at the nodes of the coarse one."""
    grid = material_grid(scene, elements // 2)
    t, u, coarse = _simulate(scene, grid, times)
    return t, u, _extrapolate(coarse, _simulate(scene, _halved(grid), times)[2])


def converged(
    scene: Scene,
    tolerance: float,
    *,
    samples_u: int = 101,
    times: ArrayLike | None = None,
    most_updates: float = 2e9,
) -> Converged:
    """Refine until a refinement moves no position by more than `tolerance` [m], or would cost too much.

    A refinement is skipped if it takes more than `most_updates` updates of a node, of 10 to 30 ns each. The step is
    proportional to h, and with bending damping to h^4. An undamped motion with jumps in its forces (gravity set free on
    a straight cable, a release under tension) is not smooth, and by nature converges slowly.

    The estimate is the change of the extrapolated motion. It bounds the error of the coarser of the last two, and
    overestimates that of the returned one.
    """
    grid = material_grid(scene, COARSEST)
    u = np.linspace(0.0, scene.cable.length, samples_u)
    t, nodes, last = _simulate(scene, grid, times)
    before: Floats | None = None
    while True:
        finer = _halved(grid)
        positions = _simulate(scene, finer, times)[2]
        now = sample(scene, nodes, _extrapolate(last, positions), u)
        change = np.inf if before is None else float(np.linalg.norm(now - before, axis=-1).max())
        if change <= tolerance or _updates(scene, _halved(finer)) > most_updates:
            return Converged(t, u, now, change, len(finer) - 1, change <= tolerance)
        before, last, grid, nodes = now, positions, finer, finer


def equilibrium(scene: Scene, *, elements: int = 200) -> tuple[Floats, Floats]:
    """Settle `scene` under its first grasps and loads by heavily damped motion.

    Returns:
        u (n,) [m] and positions (n, 3) [m].
    """
    grid = material_grid(scene, elements)
    start = start_of(scene, grid)
    rod = Rod.of(scene, grid, start)
    return grid, rod.lift(_settled(scene, rod, start).T)


def sample(scene: Scene, nodes: Floats, positions: Floats, u: Floats) -> Floats:
    """Interpolate positions (k, n, 3) at `nodes` (n,) to `u`: cubic splines between the grasps, where r''' may jump."""
    out = np.empty((len(positions), len(u), 3))
    for low, high in pairwise(breakpoints(scene)):
        inside = (nodes >= low - 1e-12) & (nodes <= high + 1e-12)
        at = (u >= low) & (u <= high)
        out[:, at] = CubicSpline(nodes[inside], positions[:, inside], axis=1)(u[at])
    return out


def _updates(scene: Scene, grid: Floats) -> float:
    return len(grid) * float(scene.horizon or 0.0) / Rod.of(scene, grid, start_of(scene, grid)).step_limit


def _extrapolate(coarse: Floats, fine: Floats) -> Floats:
    return (4.0 * fine[:, ::2] - coarse) / 3.0


def _halved(grid: Floats) -> Floats:
    finer = np.empty(2 * len(grid) - 1)
    finer[::2] = grid
    finer[1::2] = 0.5 * (grid[1:] + grid[:-1])
    return finer


def _simulate(scene: Scene, grid: Floats, times: ArrayLike | None) -> tuple[Floats, Floats, Floats]:
    horizon = float(scene.horizon or 0.0)
    wanted = np.linspace(0.0, horizon, 33) if times is None else np.asarray(times, dtype=float)
    start = start_of(scene, grid)
    rod = Rod.of(scene, grid, start)
    x = _settled(scene, rod, start) if scene.shape.settle else rod.start.copy()
    motion = _Motion(scene, rod, x, start.velocities[:, list(rod.axes)].T.copy())
    events = {g.start for g in scene.grasps} | {g.release_time for g in scene.grasps if g.release_time is not None}
    stops = np.unique([0.0, *wanted, *(e for e in events if 0.0 < e < wanted[-1])])
    at = {0.0: rod.lift(x.T)}
    holds: list[Hold] = []
    low = 0
    for high in [k for k, stop in enumerate(stops) if k > 0 and (stop in events or k == len(stops) - 1)]:
        holds = _holds(scene, rod, start, holds, motion.x, float(stops[low]))
        at.update(zip(stops[low + 1 : high + 1], rod.lift(motion.advance(stops[low : high + 1], holds)), strict=True))
        low = high
    positions = np.array([at[t] for t in wanted])
    if not np.isfinite(positions).all():
        raise FloatingPointError("the explicit rod left the finite numbers")
    return wanted, grid, positions


def _holds(scene: Scene, rod: Rod, start: Start, before: list[Hold], x: Floats, now: float) -> list[Hold]:
    """Return the grippers that are closed from `now` on; those that just closed hold the cable where it is."""
    closed = {id(hold.grasp): hold for hold in before}
    holds = []
    for grasp in scene.grasps:
        if not grasp.start <= now < (np.inf if grasp.release_time is None else grasp.release_time):
            continue
        if id(grasp) not in closed:
            node = int(np.argmin(np.abs(rod.grid - grasp.u)))
            direction = start.directions[node] if now == 0.0 else rod.direction(x, node)
            hold = Hold(grasp, node, rod.lift(x.T[node]), direction)
            jump = float(np.linalg.norm(hold.path(np.array([now]))[0] - hold.origin))
            if not jump <= 1e-6 * scene.cable.length:
                raise ValueError(f"the path of the grasp at {grasp.u:g} m begins {jump:g} m off the cable")
            closed[id(grasp)] = hold
        holds.append(closed[id(grasp)])
    return holds


@dataclass
class _Motion:
    """The state of a running simulation: positions and velocities (dims, n), the latter half a step earlier."""

    scene: Scene
    rod: Rod
    x: Floats
    v: Floats
    previous: float = 0.0

    def advance(self, stops: Floats, holds: list[Hold]) -> Floats:
        """March from `stops[0]` with the grippers `holds`; return positions at the other stops (k - 1, n, dims) [m]."""
        counts = np.maximum(1, np.ceil(np.diff(stops) / self.rod.step_limit)).astype(np.int64)
        out = np.empty((len(counts), len(self.rod.grid), len(self.rod.axes)))
        low = 0
        while low < len(counts):
            high = low + max(1, int(np.searchsorted(np.cumsum(counts[low:]), CHUNK, side="right")))
            self._march(stops[low : high + 1], counts[low:high], holds, out[low:high])
            low = high
        return out

    def _march(self, stops: Floats, counts: Integers, holds: list[Hold], out: Floats) -> None:
        rod, axes = self.rod, list(self.rod.axes)
        spans = np.diff(stops) / counts
        t = np.concatenate([[stops[0]], stops[0] + np.cumsum(np.repeat(spans, counts))])
        turning = [hold for hold in holds if hold.turns]
        hinges = rod.hinges(turning)

        def table(columns: list[Floats]) -> Floats:  # in the only memory order for which the march is compiled
            at = [c[:, axes] for c in columns]
            return np.ascontiguousarray(np.stack(at, axis=1)) if at else np.zeros((len(t), 0, len(axes)))

        march = march_plane if len(axes) == 2 else march_space
        self.previous = march(
            self.x,
            self.v,
            self.previous,
            spans,
            counts,
            rod.h,
            rod.cells,
            hinges.first,
            hinges.second,
            hinges.per_length,
            hinges.rest,
            rod.axial,
            rod.bending,
            rod.bending_damping,
            rod.density,
            rod.drag,
            rod.quadratic,
            rod.gravity,
            np.array([hold.node for hold in holds], dtype=np.int64),
            table([hold.path(t) for hold in holds]),
            table([hold.directions(t) for hold in turning]),
            np.array([np.argmin(np.abs(rod.grid - load.u)) for load in self.scene.loads], dtype=np.int64),
            table([load.at(t) for load in self.scene.loads]),
            out,
        )


def _settled(scene: Scene, rod: Rod, start: Start) -> Floats:
    """Return the static equilibrium (dims, n) [m] under the first poses of the grasps and the first loads.

    The drag is critical for the slowest motion, which is estimated from gravity and bending. The simulation lasts until
    one period of that motion moves the cable by less than 1e-10 of its length.
    """
    length = float(rod.grid[-1])
    slowest = np.sqrt(12.0 * rod.bending / (rod.density * length**4) + float(np.linalg.norm(rod.gravity)) / length)
    calm = replace(rod, drag=2.0 * rod.density * slowest, quadratic=0.0, bending_damping=0.0)
    frozen = replace(scene, loads=tuple(Load(u=p.u, force=p.at(np.zeros(1))[0]) for p in scene.loads))
    motion = _Motion(frozen, calm, rod.start.copy(), np.zeros_like(rod.start))
    closed = _holds(scene, rod, start, [], rod.start, 0.0)
    holds = [replace(hold, grasp=replace(hold.grasp, path=Still())) for hold in closed]
    window = 2.0 * np.pi / slowest
    for _ in range(200):
        before = motion.x.copy()
        motion.advance(np.array([0.0, window]), holds)
        if np.abs(motion.x - before).max() < 1e-10 * length:
            return motion.x
    raise FloatingPointError("the explicit rod did not settle")
