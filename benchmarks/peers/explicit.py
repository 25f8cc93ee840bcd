"""The compiled explicit discrete elastic rod as a peer: float64, the least that a step can cost, no stored tables.

benchmarks/rod.py is the judge and takes no liberties; this one is tuned: the largest stable step, an axial stiffness
no larger than the tolerance needs, and the extrapolation (4 fine - coarse)/3 of two spacings where that pays.
"""

from collections.abc import Callable
from itertools import pairwise
from typing import cast

import numpy as np

from benchmarks.peers.cases import SAMPLES_T, Case, Floats
from benchmarks.peers.explicit_kernel import march_plane, march_space
from benchmarks.peers.search import Setting, Value
from benchmarks.rod_scene import start_of
from dlocore import Scene, Straight

ELEMENTS = (8, 10, 12, 16, 20, 24, 32, 40, 48, 64, 80, 96, 128, 160, 200, 256)
SOFTNESS = (1 / 32, 1 / 16, 1 / 8, 1 / 4, 1 / 2, 1.0)  # of the axial stiffness: the step grows as its root falls
SAFETY = 0.95  # of the stability limit: the first modes above it blow up within a hundred steps
PEEK = 1e-5  # [s]: the paths' velocities are differences over this


class ExplicitRod:
    """The tuned explicit rod, alone or extrapolated."""

    name = "explicit rod"
    budget = 8.0

    def knobs(self, case: Case) -> dict[str, tuple[Value, ...]]:
        """Return numbers of elements, axial stiffnesses and whether to extrapolate; no twist."""
        if any(grasp.hold != "point" for grasp in case.scene.grasps):
            return {}
        return {"order": ("second", "fourth"), "elements": ELEMENTS, "axial": SOFTNESS}

    def cost(self, case: Case, setting: Setting) -> float:
        """Return the updates of nodes, while the axial waves limit the step."""
        elements, axial = cast(int, setting["elements"]), cast(float, setting["axial"])
        return elements**2 * np.sqrt(axial) * (1.25 if setting["order"] == "fourth" else 1.0)

    def prepare(self, case: Case, setting: Setting) -> Callable[[], Callable[[], Floats]]:
        """Return the whole simulation: its tables are cheap and belong to it."""
        elements, axial = cast(int, setting["elements"]), cast(float, setting["axial"])
        simulate = extrapolated if setting["order"] == "fourth" else simulated

        def run() -> Callable[[], Floats]:
            nodes, positions = simulate(case.scene, elements, axial)
            return lambda: case.of_nodes(nodes, positions)

        return run


def simulated(scene: Scene, elements: int, axial: float = 1.0, count: int = SAMPLES_T) -> tuple[Floats, Floats]:
    """Return nodes (n,) [m] and their positions (count, n, 3) [m] at evenly spaced times.

    Args:
        scene: a cable that is straight at rest, starts at rest and is held by point grasps; no table.
        elements: number of elements, about.
        axial: factor on the cable's axial stiffness.
        count: number of times.
    """
    grid = _grid(scene, elements)
    return grid, _march(scene, grid, _start(scene, grid), axial, count)


def extrapolated(scene: Scene, elements: int, axial: float = 1.0, count: int = SAMPLES_T) -> tuple[Floats, Floats]:
    """Return (4 fine - coarse)/3 of `elements` and half as many, at the nodes of the coarse one."""
    grid = _grid(scene, elements // 2)
    fine = np.empty(2 * len(grid) - 1)
    fine[::2], fine[1::2] = grid, 0.5 * (grid[1:] + grid[:-1])
    start = _start(scene, fine)
    coarse = _march(scene, grid, start[::2], axial, count)
    return grid, (4.0 * _march(scene, fine, start, axial, count)[:, ::2] - coarse) / 3.0


def _grid(scene: Scene, elements: int) -> Floats:
    """Return about `elements` + 1 nodes [m], evenly spaced between the grasps, each of which is a node."""
    length = scene.cable.length
    breaks = sorted({0.0, length, *(g.u for g in scene.grasps)})
    counts = [max(1, round((b - a) * elements / length)) for a, b in pairwise(breaks)]
    parts = [a + (b - a) / n * np.arange(n) for (a, b), n in zip(pairwise(breaks), counts, strict=True)]
    return np.concatenate([*parts, [length]])


def _start(scene: Scene, grid: Floats) -> Floats:
    """Return the start at the nodes (n, 3) [m]."""
    shape = scene.shape
    if not isinstance(shape, Straight):
        return start_of(scene, grid).positions
    along = np.asarray(shape.direction)
    return np.asarray(shape.start) + grid[:, None] * (along / np.sqrt(along @ along))


def _march(scene: Scene, grid: Floats, start: Floats, factor: float, count: int) -> Floats:
    cable, horizon = scene.cable, float(scene.horizon or 0.0)
    gravity = np.asarray(scene.environment.gravity)
    held = np.array([np.argmin(np.abs(grid - g.u)) for g in scene.grasps], dtype=np.int64)
    t = np.linspace(0.0, horizon, count)
    times = np.concatenate([t, t - PEEK, t + PEEK])
    paths = np.empty((len(times), len(held), 3))
    for c, grasp in enumerate(scene.grasps):
        paths[:, c] = grasp.path.at(times, start[held[c]])
    path, before, after = paths[:count], paths[count : 2 * count], paths[2 * count :]
    slope = (after - before) / (2.0 * PEEK)
    slope[0] = slope[-1] = 0.0  # paths start and end at rest, where the difference is one-sided
    axes = _moving(start, paths, gravity)
    axial, bending = factor * cast(float, cable.axial_stiffness), cast(float, cable.bending_stiffness)
    h = np.diff(grid)
    cells = 0.5 * (np.append(h, 0.0) + np.append(0.0, h))
    short = h.min()
    fastest = np.sqrt((4.0 * axial / short**2 + 16.0 * bending / short**4) / cable.linear_density)
    steps = int(np.ceil(horizon / (count - 1) / (SAFETY * 2.0 / fastest)))
    out = np.empty((count, len(axes), len(grid)))
    (march_plane if len(axes) == 2 else march_space)(
        np.ascontiguousarray(start[:, axes].T),
        horizon / (count - 1) / steps,
        steps,
        h,
        cells,
        axial,
        bending,
        cable.linear_density,
        scene.environment.drag,
        gravity[axes],
        held,
        np.ascontiguousarray(path[..., axes]),
        np.ascontiguousarray(slope[..., axes]),
        out,
    )
    positions = np.empty((count, len(grid), 3))
    positions[:] = start[0]
    positions[..., axes] = out.transpose(0, 2, 1)
    return positions


def _moving(positions: Floats, paths: Floats, gravity: Floats) -> list[int]:
    """Return the coordinates that move: two where start (n, 3), paths (k, held, 3) and gravity leave one out."""
    for axis in (2, 1, 0):
        reached = np.append(paths[..., axis], positions[:, axis])
        if gravity[axis] == 0.0 and reached.max() - reached.min() < 1e-12:
            return [a for a in range(3) if a != axis]
    return [0, 1, 2]
