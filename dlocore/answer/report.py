"""Reports of a solve: the surface in world coordinates, effects and energies."""

from collections.abc import Callable
from dataclasses import replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from dlocore.answer.clearance import least_distance
from dlocore.answer.parts import ContactForce, EffectReport, MaterialMotion, StretchMotion
from dlocore.kernels.assembly import History, stored_energy
from dlocore.problem.grid import Grid
from dlocore.problem.problem import Problem
from dlocore.problem.standing import obstacle_rows
from dlocore.spline import SplineSurface

Floats = NDArray[np.float64]

_NEAR = 0.01  # of the diameter: tolerance of the gap to obstacles


def surface_of(problem: Problem, knots_u: Floats, knots_t: Floats, control: Floats) -> SplineSurface:
    """Return the surface in the world frame from control points (n_t, n_u, nc) in the solve's coordinates."""
    return SplineSurface(problem.world(control), knots_u, knots_t)


def elastic_energy(problem: Problem, grid: Grid, q: Floats, history: History) -> float:
    """Return the elastic energy stored in control points q (n_u, nc) with a `history` [J]."""
    return float(stored_energy(problem.axes, q, grid.tables, *problem.laws, history))


def planned_effects(problem: Problem) -> tuple[EffectReport, ...]:
    """Return for each effect whether it would be simulated, and why; magnitudes are known only after solving."""
    return tuple(EffectReport(name, choice.active, choice.reason) for name, choice in problem.choices.items())


def _halves(knots: Floats) -> Floats:
    """Return the ends and the middles of all spans of a spline, rising."""
    ends = np.unique(knots)
    return np.sort(np.concatenate([ends, 0.5 * (ends[1:] + ends[:-1])]))


def effect_reports(
    problem: Problem,
    material: Callable[[], MaterialMotion | None],
    stretch: Callable[[], StretchMotion],
    contacts: Callable[[], tuple[ContactForce, ...]],
    surface: SplineSurface,
) -> tuple[EffectReport, ...]:
    """Return for each effect whether it was simulated, why, and its size on the predicted motion."""
    cable, environment = problem.scene.cable, problem.scene.environment
    u = np.linspace(0.0, cable.length, 33)
    t = np.linspace(0.0, surface.horizon, 33)
    speed = np.linalg.norm(surface(u, t, dt=1)[..., :3], axis=-1)
    acceleration = np.linalg.norm(surface(u, t, dt=2)[..., :3], axis=-1)
    masses = cable.point_masses
    at_masses = surface([one.u for one in masses], t, dt=2)[..., :3] if masses else np.zeros((len(t), 0, 3))
    heavy = np.linalg.norm(at_masses, axis=-1) @ np.array([one.mass for one in masses])
    places, instants = _halves(surface.knots_u), _halves(surface.knots_t)  # peaks of bends are as narrow as spans
    curvature, tau = surface.curvature(places, instants), surface.twist_rate(places, instants)
    mu, EI = cable.linear_density, cast(float, cable.bending_stiffness)
    drag = environment.drag * speed + environment.drag_quadratic * speed**2
    weight = problem.scene.weight
    sizes: dict[str, tuple[float, str]] = {
        "inertia": (float((mu * np.trapezoid(acceleration, u, axis=1) + heavy).max()), "N"),
        "drag": (float(np.trapezoid(drag, u, axis=1).max()), "N"),
        "damping": (float(cable.bending_damping * np.abs(np.gradient(curvature, instants, axis=0)).max()), "N m"),
        "gravity": (weight, "N"),
        "stretch": (float(np.abs(stretch().strain).max()), "axial strain"),
        "bend": (float(EI * curvature.max()), "N m"),
        "table": (weight, "N"),
        "twist": (float(cast(float, cable.torsional_stiffness) * np.abs(tau).max()), "N m"),
    }
    if problem.twist is None:
        del sizes["twist"]
    if not problem.on_table:
        del sizes["table"]
    if problem.friction is not None:
        rubs = np.sum([np.linalg.norm(one.friction, axis=1) for one in contacts()], axis=0)
        sizes["friction"] = (float(np.max(rubs)), "N")
    if problem.obstacles:
        rows = obstacle_rows(problem.scene, problem.obstacles)
        gap = least_distance(surface, rows, _NEAR * cable.diameter) - 0.5 * cable.diameter
        sizes["obstacles"] = (gap, "m, the smallest gap")
    if problem.choices["plasticity"].active:
        kept = material()
        if kept is not None:
            change = np.linalg.norm(kept.memory[-1] - kept.natural, axis=1).max()
            sizes["plasticity"] = (float(change), "1/m, the bend that is kept")
    return tuple(
        replace(report, magnitude=sizes[report.name][0], unit=sizes[report.name][1]) if report.name in sizes else report
        for report in planned_effects(problem)
    )
