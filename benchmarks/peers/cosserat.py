"""PyElastica's Cosserat rod, with shear and rotary inertia, by position Verlet in its own loop.

What may be chosen freely is chosen for speed: more rotary inertia of the sections, which these cables do not feel,
allows a longer step.
"""

from collections.abc import Callable
from typing import Any, cast

import numpy as np

from benchmarks.peers.cases import SAMPLES_T, Case, Floats
from benchmarks.peers.frame import even_counts, frame_of, transported
from benchmarks.peers.search import Setting, Value

COUNTS = (10, 12, 16, 20, 30, 40, 60, 80)
INERTIA = (256.0, 64.0, 16.0, 4.0, 1.0)  # times that of the round section
STEPS = (1.2, 0.9, 0.6, 0.3)  # of the estimated stability limit
GHOST = 1e-3  # of an element: a held direction is an element this long before the end
PEEK = 1e-6  # [s]: velocities of the paths are differences over this


class Cosserat:
    """The rod with held nodes, and for a clamp held sections, written into it at every half step."""

    name = "PyElastica"
    budget = 40.0

    def knobs(self, case: Case) -> dict[str, tuple[Value, ...]]:
        """Return rotary inertias, numbers of elements, and steps by the limit of stability."""
        return {"inertia": INERTIA, "elements": even_counts(case, COUNTS), "step": STEPS}

    def cost(self, case: Case, setting: Setting) -> float:
        """Return the number of steps, which cost nearly the same for all rods of this size."""
        return _steps(case, setting) * (1.0 + 0.003 * cast(int, setting["elements"]))

    def prepare(self, case: Case, setting: Setting) -> Callable[[], Callable[[], Floats]]:
        """Build and finalise the simulator, and return its time loop."""
        import elastica as ea

        elements, steps = cast(int, setting["elements"]), _steps(case, setting)
        dt = case.horizon / (SAMPLES_T - 1) / steps
        system, rod, nodes, inner = _system(ea, case, elements, dt, cast(float, setting["inertia"]))
        stepper = ea.PositionVerlet()

        def run() -> Callable[[], Floats]:
            positions = np.empty((SAMPLES_T, len(nodes), 3))
            positions[0] = rod.position_collection[:, inner].T
            time = np.float64(0.0)
            for sample in range(1, SAMPLES_T):
                for _ in range(steps):
                    time = stepper.step(system, time, dt)
                positions[sample] = rod.position_collection[:, inner].T
                if not np.abs(positions[sample]).max() < 10.0:
                    raise FloatingPointError("the rod blew up")
            return lambda: case.of_nodes(nodes, positions)

        return run


def _steps(case: Case, setting: Setting) -> int:
    """Return the steps in each of 32 intervals: 2/omega of the fastest waves, which are axial, or of turning sections.

    omega^2 <= 4 EA/(mu h^2) and 4 S/(mu h^2) + (S + 4 EI/h^2)/(s rho I) with the shear stiffness S.
    """
    cable = case.scene.cable
    h, radius = cable.length / cast(int, setting["elements"]), 0.5 * cable.diameter
    EI, EA = cast(float, cable.bending_stiffness), cast(float, cable.axial_stiffness)
    shear = 27 / 28 * cast(float, cable.torsional_stiffness) / (0.5 * radius**2)
    turning = cast(float, setting["inertia"]) * cable.linear_density * radius**2 / 4.0
    waves = [4.0 * EA / (cable.linear_density * h**2)]
    waves.append(4.0 * shear / (cable.linear_density * h**2) + (shear + 4.0 * EI / h**2) / turning)
    limit = 2.0 / np.sqrt(max(waves))
    return int(np.ceil(case.horizon / (SAMPLES_T - 1) / (cast(float, setting["step"]) * limit)))


def _system(ea: Any, case: Case, elements: int, dt: float, inertia: float) -> tuple[Any, Any, Floats, slice]:
    """Return the simulator, its rod, the cable's nodes (n,) [m] and where they are among those of the rod."""
    scene, cable = case.scene, case.scene.cable
    frame = frame_of(case, elements, 1)
    clamped = [g.hold == "clamp" for g in scene.grasps]
    ghosts = any(clamped)
    h = cable.length / elements
    nodes, turns = frame.nodes, transported(frame)
    places, start = nodes, frame.start.positions
    if ghosts:
        short = GHOST * h
        places = np.concatenate([[-short], nodes, [cable.length + short]])
        first, last = frame.start.directions[[0, -1]]
        start = np.vstack([start[0] - short * first, start, start[-1] + short * last])
    else:
        turns = turns[1:-1]
    count = len(places) - 1
    section = np.pi * (0.5 * cable.diameter) ** 4 / 4.0
    straight = np.zeros((3, count + 1))
    straight[0] = places
    rod = ea.CosseratRod.straight_rod(
        count,
        straight[:, 0].copy(),
        np.array([1.0, 0.0, 0.0]),
        np.array([0.0, 0.0, 1.0]),
        float(places[-1] - places[0]),
        0.5 * cable.diameter,
        cable.linear_density / (np.pi * (0.5 * cable.diameter) ** 2),
        youngs_modulus=cast(float, cable.bending_stiffness) / section,
        shear_modulus=cast(float, cable.torsional_stiffness) / (2.0 * section),
        position=straight,
    )
    rod.position_collection[:] = start.T
    for k, turn in enumerate(turns):  # the rows are the directors; the last is the tangent
        x, y, z = turn.as_matrix().T
        rod.director_collection[..., k] = [z, -y, x]
    rod.mass_second_moment_of_inertia *= inertia
    rod.inv_mass_second_moment_of_inertia /= inertia
    simulator = type("Simulator", (ea.BaseSystemCollection, ea.Constraints, ea.Forcing, ea.Damping), {})()
    simulator.append(rod)
    held = _held(ea)
    for number, grasp in enumerate(scene.grasps):
        node = int(np.argmin(np.abs(places - grasp.u)))
        at, sections = [node], []
        if clamped[number]:
            ghost = 0 if node == 1 else count
            at, sections = [node, ghost], [0 if node == 1 else count - 1]
        tables = _tables(case, number, start[at], rod.director_collection[..., sections].copy(), dt)
        simulator.constrain(rod).using(
            held,
            constrained_position_idx=tuple(at),
            constrained_director_idx=tuple(sections),
            tables=tables,
            half=0.5 * dt,
        )
    rate = scene.environment.drag / cable.linear_density
    simulator.dampen(rod).using(ea.AnalyticalLinearDamper, uniform_damping_constant=rate, time_step=dt)
    gravity = np.array(scene.environment.gravity, dtype=float)
    if gravity.any():
        simulator.add_forcing_to(rod).using(ea.GravityForces, acc_gravity=gravity)
    simulator.finalize()
    return simulator, rod, nodes, slice(1, -1) if ghosts else slice(None)


def _tables(case: Case, number: int, start: Floats, directors: Floats, dt: float) -> tuple[Floats, Floats, Floats]:
    """Return a grasp's positions, velocities (half steps, 3, nodes) and directors (half steps, 3, 3, sections)."""
    grasp = case.scene.grasps[number]
    t = np.arange(2 * round(case.horizon / dt) + 3) * 0.5 * dt

    def at(shift: float) -> Floats:
        path = grasp.path.at(t + shift, start[0])
        turns = grasp.path.rotation_at(t + shift)
        arms = start - start[0]
        moved = np.broadcast_to(arms, (len(t), *arms.shape)) if turns is None else np.einsum("tij,nj->tni", turns, arms)
        return (path[:, None] + moved).transpose(0, 2, 1)

    turns = grasp.path.rotation_at(t)
    turned = np.broadcast_to(directors, (len(t), *directors.shape))
    if turns is not None:
        turned = np.einsum("ajs,tij->tais", directors, turns)
    return at(0.0), (at(PEEK) - at(-PEEK)) / (2.0 * PEEK), turned


def _held(ea: Any) -> type:
    """Return the constraint that writes a grasp's tables into the rod; made here, since PyElastica is optional."""

    class Held(ea.ConstraintBase):  # type: ignore[misc, name-defined]
        def __init__(self, *fixed: Any, tables: tuple[Floats, Floats, Floats], half: float, **given: Any) -> None:
            super().__init__(**given)
            self.positions, self.velocities, self.directors = tables
            self.half = half

        def constrain_values(self, system: Any, time: Any) -> None:
            k = round(time / self.half)
            for i, node in enumerate(self.constrained_position_idx):
                system.position_collection[:, node] = self.positions[k, :, i]
            for i, section in enumerate(self.constrained_director_idx):
                system.director_collection[:, :, section] = self.directors[k, :, :, i]

        def constrain_rates(self, system: Any, time: Any) -> None:
            k = round(time / self.half)
            for i, node in enumerate(self.constrained_position_idx):
                system.velocity_collection[:, node] = self.velocities[k, :, i]
            for section in self.constrained_director_idx:
                system.omega_collection[:, section] = 0.0

    return Held
