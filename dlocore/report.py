"""What a solve tells about itself: world coordinates, reactions, effects and energies."""

from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from dlocore.discretisation import Grid, Held
from dlocore.kernels.assembly import largest_strain, stored_energy
from dlocore.prediction import EffectReport, GraspReaction
from dlocore.problem import Problem
from dlocore.scene import NOT_MODELLED_YET
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


def effect_reports(problem: Problem, grid: Grid, surface: SplineSurface) -> tuple[EffectReport, ...]:
    """Return for each effect whether it was simulated, why, and its size on the predicted motion.

    The axial strain is that at the axial points: between them reduced integration leaves it free to oscillate.
    """
    scene, cable, environment = problem.scene, problem.scene.cable, problem.scene.environment
    u = np.linspace(0.0, cable.length, 33)
    t = np.linspace(0.0, surface.horizon, 33)
    speed = np.linalg.norm(surface(u, t, dt=1)[..., :3], axis=-1)
    acceleration = np.linalg.norm(surface(u, t, dt=2)[..., :3], axis=-1)
    curvature = surface.curvature(u, t)
    states = problem.plane.points(surface.states(t)[..., :3])
    strain = largest_strain(tuple(range(problem.plane.dimensions)), np.ascontiguousarray(states), grid.tables)
    mu, EI = cable.linear_density, cast(float, cable.bending_stiffness)
    asked = scene.effects.get

    def why(name: str, active: bool, yes: str, no: str) -> str:
        if asked(name, "auto") == "off":
            return "switched off in the scene"
        return yes if active else no

    heavy = bool(np.any(cast(Floats, environment.gravity) != 0))
    table = environment.table is not None
    drags = environment.drag > 0 or environment.drag_quadratic > 0
    reports = [
        EffectReport(
            "inertia", problem.inertia is not None, why("inertia", True, "the cable has mass and moves", ""),
            float(mu * np.trapezoid(acceleration, u, axis=1).max()), "N",
        ),
        EffectReport(
            "drag", problem.drag is not None or problem.quadratic_drag is not None,
            why("drag", drags, "the environment has drag", "no drag is given"),
            float(np.trapezoid(environment.drag * speed + environment.drag_quadratic * speed**2, u, axis=1).max()), "N",
        ),
        EffectReport(
            "damping", problem.damping is not None,
            why("damping", cable.bending_damping > 0, "the cable has bending damping", "no bending damping is given"),
            float(cable.bending_damping * np.abs(np.gradient(curvature, t, axis=0)).max()), "N m",
        ),
        EffectReport(
            "gravity", problem.gravity is not None,
            why("gravity", problem.gravity is not None, "the cable has weight",
                "the table carries the weight" if table and heavy else "there is no gravity"),
            float(mu * cable.length * np.linalg.norm(cast(Floats, environment.gravity))), "N",
        ),
        EffectReport(
            "stretch", True, "it keeps the cable's length",
            float(strain), "axial strain",
        ),
        EffectReport(
            "bend", problem.bend is not None, why("bend", True, "the cable has bending stiffness", ""),
            float(EI * curvature.max()), "N m",
        ),
    ]  # fmt: skip
    reports.append(
        EffectReport(
            "table", problem.on_table,
            why("table", table, "the cable lies on it: it carries the weight, the motion is planar", "there is none"),
            float(mu * cable.length * np.linalg.norm(cast(Floats, environment.gravity))) if problem.on_table else None,
            "N" if problem.on_table else "",
        )
    )  # fmt: skip
    absent = {
        "twist": "nothing holds an orientation at two places",
        "friction": "the table has none" if table else "no table",
    }
    for name in NOT_MODELLED_YET:
        reason = absent.get(
            name,
            "the scene has none" if name != "self_contact" else "contact of the cable with itself is not modelled yet",
        )
        reports.append(EffectReport(name, False, reason))
    return tuple(reports)
