"""Energies of a predicted motion, and how large the forces of each effect are in it."""

from typing import cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dlocore.discretisation import Grid, grid_on
from dlocore.effects import laws
from dlocore.kernels.assembly import NO_RATES, assemble, multiply_scalar_band, stored_energy
from dlocore.problem import Problem, pose
from dlocore.scene import Scene
from dlocore.spline import SplineSurface, design_matrix

Floats = NDArray[np.float64]

_LAWS = {"stretch": laws.STRETCH, "bend": laws.BEND, "damping": laws.DAMPING, "drag": laws.QUADRATIC_DRAG}


def energies(scene: Scene, surface: SplineSurface, times: ArrayLike) -> dict[str, Floats]:
    """Return the energies of the motion at `times` (k,) [s]; each (k,) [J].

    Keys: "kinetic", mu/2 |r_t|^2, "stretch" and "bend", docs/model.md eq. 7, and "gravity", -mu g . r relative to the
    first of the times. Each is integrated over the cable as the solver does it. What is off in the scene is zero.
    """
    problem, grid, states, rates, _ = _motion(scene, surface, times)
    active, parameters = problem.law_table()
    axes = tuple(range(problem.plane.dimensions))
    weight = grid.tables.weight[:, None] * problem.weight()
    found = {name: np.zeros(len(states)) for name in ("kinetic", "stretch", "bend", "gravity")}
    for k, (q, v) in enumerate(zip(states, rates, strict=True)):
        momentum = np.zeros_like(v)
        density = 0.0 if problem.inertia is None else problem.mass_density()
        multiply_scalar_band(grid.tables.mass, v, density, momentum)
        found["kinetic"][k] = 0.5 * np.sum(v * momentum)
        found["gravity"][k] = -np.sum(weight * (q - states[0]))
        for name in ("stretch", "bend"):
            only = parameters.copy()
            only[[row for row in range(laws.COUNT) if row != _LAWS[name]]] = 0.0
            found[name][k] = stored_energy(axes, q, grid.tables, active, only, grid.memory)
    return found


def effect_forces(scene: Scene, surface: SplineSurface, times: ArrayLike) -> dict[str, float]:
    """Return how large the generalised forces of each active effect are in the motion [N].

    It is the root mean square over `times` (k,) [s] of the norm of the forces at the control points.
    """
    problem, grid, states, rates, accelerations = _motion(scene, surface, times)
    active, parameters = problem.law_table()
    axes = tuple(range(problem.plane.dimensions))
    nothing = np.empty((1, 1))
    squares: dict[str, float] = {}

    def add(name: str, force: Floats) -> None:
        squares[name] = squares.get(name, 0.0) + float(np.sum(force * force))

    for q, v, a in zip(states, rates, accelerations, strict=True):
        for name, matrix, x in (("inertia", problem.mass_density(), a), ("drag", problem.drag_coefficient(), v)):
            if getattr(problem, name) is not None:
                force = np.zeros_like(x)
                multiply_scalar_band(grid.tables.mass, x, matrix, force)
                add(name, force)
        if problem.gravity is not None:
            add("gravity", grid.tables.weight[:, None] * problem.weight())
        for name, row in _LAWS.items():
            if active[row]:
                only = parameters.copy()
                only[[other for other in range(laws.COUNT) if other != row]] = 0.0
                force = np.empty_like(q)
                assemble(
                    axes, q, v, grid.tables, active, only, grid.memory, grid.memory, NO_RATES, (0.0, 0.0, 0.0), force,
                    nothing,
                )  # fmt: skip
                add(name, force)
    return {name: float(np.sqrt(square / len(states))) for name, square in squares.items()}


def _motion(scene: Scene, surface: SplineSurface, times: ArrayLike) -> tuple[Problem, Grid, Floats, Floats, Floats]:
    """Return problem and grid, and control points, velocities and accelerations (k, n_u, nc) at the times."""
    problem = pose(scene)
    grid = grid_on(problem, surface.knots_u)
    at = np.clip(np.atleast_1d(np.asarray(times, dtype=float)), 0.0, surface.horizon)
    control = surface.control_points[..., :3]
    moved = [
        np.ascontiguousarray(np.tensordot(design_matrix(surface.knots_t, at, order), control, axes=1))
        for order in range(3)
    ]
    plane = problem.plane
    states, rates, accelerations = plane.points(moved[0]), plane.vectors(moved[1]), plane.vectors(moved[2])
    return (
        problem,
        grid,
        *(cast(Floats, np.ascontiguousarray(x)) for x in (states, rates, accelerations)),
    )  # type: ignore[return-value]
