"""What a solve tells about itself: world coordinates, reactions, effects and energies."""

from dataclasses import dataclass, replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from dlocore.discretisation import Grid, Held
from dlocore.kernels.assembly import largest_strain, stored_energy
from dlocore.prediction import EffectReport, GraspReaction
from dlocore.problem import Problem
from dlocore.spline import SplineSurface

Floats = NDArray[np.float64]


def surface_of(problem: Problem, grid: Grid, knots_t: Floats, control: Floats) -> SplineSurface:
    """Return the surface in the world frame of control points (n_t, n_u, nc) in the solve's coordinates."""
    world = np.zeros((*control.shape[:2], 4))
    world[..., :3] = problem.plane.world(control)
    return SplineSurface(world, grid.knots, knots_t)


def elastic_energy(problem: Problem, grid: Grid, q: Floats) -> float:
    """Return the elastic energy stored in control points q (n_u, nc) [J]."""
    active, parameters = problem.law_table()
    return float(stored_energy(tuple(range(problem.plane.dimensions)), q, grid.tables, active, parameters, grid.memory))


@dataclass(frozen=True, eq=False)
class WindowForces:
    """What holds the cable over a stretch of time.

    Attributes:
        held: the held degrees of freedom.
        times: (k,) [s].
        forces: residual of the equations at the held degrees of freedom (k, held) [N].
        states: control points (k, n_u, nc) [m] at those times.
    """

    held: Held
    times: Floats
    forces: Floats
    states: Floats


def reactions(problem: Problem, grid: Grid, windows: tuple[WindowForces, ...]) -> tuple[GraspReaction, ...]:
    """Return force [N] and moment [N m] of every grasp over time.

    The force is the multiplier of the constraint b(u_g) q = p, the moment d x (multiplier of b'(u_g) q = d).
    """
    nc = problem.plane.dimensions
    t = np.concatenate([w.times for w in windows])
    force = {g: np.zeros((len(t), 3)) for g in problem.scene.grasps}
    moment = {g: np.zeros((len(t), 3)) for g in problem.scene.grasps}
    at = 0
    for window in windows:
        part = slice(at, at + len(window.times))
        at = part.stop
        multipliers = problem.plane.world_vectors(window.held.multipliers(window.forces, nc))
        for row, (i, derivative) in enumerate(window.held.rows):
            g = window.held.grasps[i]
            if derivative == 0:
                force[g][part] = multipliers[:, row]
            else:
                tangent = problem.plane.world_vectors(grid.at(window.states, g.u, 1))
                moment[g][part] = np.cross(tangent, multipliers[:, row])
    return tuple(GraspReaction(g.u, t, force[g], moment[g]) for g in problem.scene.grasps)


def planned_effects(problem: Problem) -> tuple[EffectReport, ...]:
    """Return for each effect whether the scene calls for it, and why; magnitudes are known only after solving."""
    cable, environment = problem.scene.cable, problem.scene.environment
    table = environment.table is not None
    heavy = bool(np.any(cast(Floats, environment.gravity) != 0))
    no_gravity = "the table carries the weight" if table and heavy else "there is no gravity"
    drags = environment.drag > 0 or environment.drag_quadratic > 0
    # name, whether it is simulated, whether the scene has it, why if it has, why if not
    rows = (
        ("inertia", problem.inertia is not None, True, "the cable has mass and moves", ""),
        (
            "drag", problem.drag is not None or problem.quadratic_drag is not None, drags,
            "the environment has drag", "no drag is given",
        ),
        (
            "damping", problem.damping is not None, cable.bending_damping > 0,
            "the cable has bending damping", "no bending damping is given",
        ),
        ("gravity", problem.gravity is not None, heavy and not table, "the cable has weight", no_gravity),
        ("stretch", True, True, "it keeps the cable's length", ""),
        ("bend", problem.bend is not None, True, "the cable has bending stiffness", ""),
        (
            "table", problem.on_table, table,
            "the cable lies on it: it carries the weight, the motion is planar", "there is none",
        ),
        ("twist", False, False, "", "nothing holds an orientation at two places"),
        ("plasticity", False, False, "", "the cable is elastic: no yield strain is given"),
        ("friction", False, False, "", "the table has none" if table else "there is no table"),
        ("obstacles", False, False, "", "there are none"),
        ("self_contact", False, False, "", "contact of the cable with itself is not modelled yet"),
    )  # fmt: skip
    switched_off = {name for name, value in problem.scene.effects.items() if value == "off"}
    return tuple(
        EffectReport(name, active, "switched off in the scene" if name in switched_off else yes if present else no)
        for name, active, present, yes, no in rows
    )


def effect_reports(problem: Problem, grid: Grid, surface: SplineSurface) -> tuple[EffectReport, ...]:
    """Return for each effect whether it was simulated, why, and its size on the predicted motion.

    The axial strain is that at the axial points: between them reduced integration leaves it free to oscillate.
    """
    cable, environment = problem.scene.cable, problem.scene.environment
    u = np.linspace(0.0, cable.length, 33)
    t = np.linspace(0.0, surface.horizon, 33)
    speed = np.linalg.norm(surface(u, t, dt=1)[..., :3], axis=-1)
    acceleration = np.linalg.norm(surface(u, t, dt=2)[..., :3], axis=-1)
    curvature = surface.curvature(u, t)
    states = np.ascontiguousarray(problem.plane.points(surface.states(t)[..., :3]))
    mu, EI = cable.linear_density, cast(float, cable.bending_stiffness)
    drag = environment.drag * speed + environment.drag_quadratic * speed**2
    weight = float(mu * cable.length * np.linalg.norm(cast(Floats, environment.gravity)))
    sizes: dict[str, tuple[float, str]] = {
        "inertia": (float(mu * np.trapezoid(acceleration, u, axis=1).max()), "N"),
        "drag": (float(np.trapezoid(drag, u, axis=1).max()), "N"),
        "damping": (float(cable.bending_damping * np.abs(np.gradient(curvature, t, axis=0)).max()), "N m"),
        "gravity": (weight, "N"),
        "stretch": (float(largest_strain(tuple(range(problem.plane.dimensions)), states, grid.tables)), "axial strain"),
        "bend": (float(EI * curvature.max()), "N m"),
        "table": (weight, "N"),
    }
    if not problem.on_table:
        del sizes["table"]
    return tuple(
        replace(report, magnitude=sizes[report.name][0], unit=sizes[report.name][1]) if report.name in sizes else report
        for report in planned_effects(problem)
    )
