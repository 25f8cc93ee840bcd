"""Energies of a predicted motion, and how large the forces of each effect are in it."""

from typing import cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dlocore.answer.frames import directors
from dlocore.answer.parts import MaterialMotion, StretchMotion
from dlocore.compiling.interrupts import interruptible
from dlocore.effects import laws
from dlocore.errors import SceneError, instance
from dlocore.kernels.assembly import NO_RATES, History, assemble, multiply_scalar_band, stored_energy, times_scalar_band
from dlocore.kernels.twisted import start_frames
from dlocore.problem.discretisation import grid_on, write_material
from dlocore.problem.features import SAME
from dlocore.problem.grid import Grid
from dlocore.problem.problem import Problem
from dlocore.scene.scene import Scene
from dlocore.spline import SplineSurface, in_range
from dlocore.stability.sideways import pose_as_shown

Floats = NDArray[np.float64]

_LAWS = {
    "stretch": laws.STRETCH,
    "bend": laws.BEND,
    "twist": laws.TWIST,
    "damping": laws.DAMPING,
    "drag": laws.QUADRATIC_DRAG,
}


@interruptible
def energies(
    scene: Scene,
    surface: SplineSurface,
    times: ArrayLike,
    material: MaterialMotion | None = None,
    stretch: StretchMotion | None = None,
) -> dict[str, Floats]:
    """Return the energies of a motion at `times` (k,) [s]; each (k,) [J]. A prediction has `Prediction.energies`.

    Keys: "kinetic", mu/2 (|r_t|^2 + D^2/8 theta_t^2); "stretch", "bend" and "twist", docs/model.md eq. 7; and
    "gravity", -mu g . r relative to the first of the times. Point masses add m/2 |r_t|^2 and -m g . r. Each is
    integrated over the cable as in the solver. Effects that are off in the scene have zero energy. For a cable that
    yields, `material` is what its sections remember (`Prediction.material`).

    The energy of stretch belongs to `stretch`, the strain that balances the forces (`Prediction.stretch`). Without
    `stretch` the surface's own strain is used. That is no measure of the energy in a cable that hardly stretches: the
    error of the time spline may be a strain of 1e-4, which counts with the whole axial stiffness.

    Raises:
        SceneError: a time is outside the predicted time, or the surface is of a cable of another length.
    """
    problem, grid, states, rates, _, histories = _motion(scene, surface, times, material)
    active, parameters = problem.law_table()
    axes = problem.axes
    weight = grid.tables.weight[:, None] * problem.weight()
    found = {name: np.zeros(len(states)) for name in ("kinetic", "stretch", "bend", "twist", "gravity")}
    for k, (q, v) in enumerate(zip(states, rates, strict=True)):
        momentum = np.zeros_like(v)
        density = 0.0 if problem.inertia is None else problem.mass_density()
        multiply_scalar_band(grid.tables.inertia, v, density, momentum)
        found["kinetic"][k] = 0.5 * np.sum(v * momentum)
        found["gravity"][k] = -np.sum(weight * (q - states[0]))
        for name in ("stretch", "bend", "twist"):
            only = parameters.copy()
            only[[row for row in range(laws.COUNT) if row != _LAWS[name]], 0] = 0.0
            found[name][k] = stored_energy(axes, q, grid.tables, active, only, histories[k])
    if stretch is not None:
        axial = grid.tables.axial
        strain = stretch.along(axial.u, times) - np.array([history.axial[:, 0] for history in histories])
        found["stretch"] = 0.5 * cast(float, scene.cable.axial_stiffness) * strain**2 @ axial.w
    return found


@interruptible
def effect_forces(
    scene: Scene, surface: SplineSurface, times: ArrayLike, material: MaterialMotion | None = None
) -> dict[str, float]:
    """Return the size of the generalised forces of each active effect in the motion [N].

    The size is the root mean square over `times` (k,) [s] of the norm of the forces at the control points. For stretch
    they are those of the surface's own strain, see `energies`.

    Raises:
        SceneError: as `energies`.
    """
    problem, grid, states, rates, accelerations, histories = _motion(scene, surface, times, material)
    active, parameters = problem.law_table()
    axes = problem.axes
    nothing = np.empty((1, 1))
    squares: dict[str, float] = {}

    def add(name: str, force: Floats) -> None:
        squares[name] = squares.get(name, 0.0) + float(np.sum(force * force))

    for q, v, a, history in zip(states, rates, accelerations, histories, strict=True):
        if problem.inertia is not None:
            add("inertia", problem.mass_density() * times_scalar_band(grid.tables.inertia, a))
        if problem.drag is not None:
            add("drag", problem.drag_coefficient() * times_scalar_band(grid.tables.unit, v))
        if problem.gravity is not None:
            add("gravity", grid.tables.weight[:, None] * problem.weight())
        for name, row in _LAWS.items():
            if active[row]:
                only = parameters.copy()
                only[[other for other in range(laws.COUNT) if other != row], 0] = 0.0
                force = np.empty_like(q)
                assemble(
                    axes, q, v, grid.tables, active, only, history, NO_RATES, (0.0, 0.0, 0.0), force, nothing,
                )  # fmt: skip
                add(name, force)
    return {name: float(np.sqrt(square / len(states))) for name, square in squares.items()}


def _motion(
    scene: Scene, surface: SplineSurface, times: ArrayLike, material: MaterialMotion | None
) -> tuple[Problem, Grid, Floats, Floats, Floats, list[History]]:
    """Return problem and grid, control points, velocities and accelerations (k, n_u, nc), and histories, at the times.

    A surface does not say what had yielded by then, `material` does; without it the stress-free shape is the start's.
    """
    instance("scene", scene, Scene, "a Scene")
    instance("surface", surface, SplineSurface, "a SplineSurface, as Prediction.surface")
    cable = scene.cable
    called = material is not None and cable.yields and scene.effects.get("plasticity", "auto") != "off"
    shown = {"plasticity": "it shows in the motion"} if called else {}
    problem = pose_as_shown(scene, shown, surface.control_points)
    grid = grid_on(problem, surface.knots_u.copy())  # kernels are compiled for arrays that may be written
    if abs(surface.length - cable.length) > SAME * cable.length:
        raise SceneError(
            "surface", f"that of a cable of {surface.length:g} m", f"one of the scene's, {cable.length:g} m"
        )
    at = np.clip(in_range("times", times, surface.horizon, "s"), 0.0, surface.horizon)
    moved = [surface.states(at, order) for order in range(3)]
    states = problem.coordinates(moved[0][..., :3], moved[0][..., 3])
    rates, accelerations = (problem.rates(x[..., :3], x[..., 3]) for x in moved[1:])
    histories = [grid.past() for _ in at]
    if problem.twist is not None:
        for history, q, director in zip(histories, states, directors(problem, surface, at, material), strict=True):
            start_frames(grid.knots, q, grid.tables.curvature, director, history.past)
    if material is not None:
        for q, history, t in zip(states, histories, at, strict=True):
            write_material(problem, grid, q, history, material.at(float(t)))
    return problem, grid, states, rates, accelerations, histories
