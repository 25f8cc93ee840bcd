"""The cases that every peer predicts, and the converged motions that judge them."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import product
from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from benchmarks import rod
from dlocore import (
    Cable,
    ControlPoints,
    Environment,
    Grasp,
    Move,
    Points,
    Quality,
    Scene,
    Straight,
    equilibrium,
    predict,
)
from dlocore.scene.scene import Switch

Floats = NDArray[np.float64]
BENDING = (1e-4, 1e-3, 1e-2)  # [N m^2]
GRASPS = (0.0, 0.25, 0.5, 0.8)  # [m]
SAMPLES_T, SAMPLES_U = 33, 101
FINE = ((49, 129), (65, 193))  # (n_u, n_t) of the marches that check the reference
STILL = 3e-5  # [m]: a refinement that moves the reference by less ends it; a tenth of the smallest tolerance
WEIGHTLESS = (0.0, 0.0, 0.0)
NO_CONTACT: dict[str, Switch] = {"self_contact": "off"}  # two halves of a soft cable meet when it stops; no peer minds


@dataclass(frozen=True, kw_only=True)
class Case:
    """A scene that needs no table, where its motion is sampled, and the converged motion.

    Attributes:
        name: for tables.
        family: cases of one family share a row of the table of medians.
        scene: the scene; straight at rest, grasps that hold from the start, linear drag.
        truth: (33, 101, 3) [m], the converged motion.
        uncertainty: how far the last refinement moved it [m].
        check: distance of a fine march to it [m]; with twist, where that march is the truth, to a coarser one.
        stretch: how far 100 times the axial stiffness moves the motion [m]; None where the start is under tension.
    """

    name: str
    family: str
    scene: Scene
    truth: Floats
    uncertainty: float
    check: float
    stretch: float | None

    @property
    def horizon(self) -> float:
        """Predicted time [s]."""
        return float(self.scene.horizon or 0.0)

    @property
    def times(self) -> Floats:
        """Times (33,) [s] at which motions are compared."""
        return np.linspace(0.0, self.horizon, SAMPLES_T)

    @property
    def places(self) -> Floats:
        """Material coordinates (101,) [m] at which motions are compared."""
        return np.linspace(0.0, self.scene.cable.length, SAMPLES_U)

    def of_nodes(self, nodes: Floats, positions: Floats) -> Floats:
        """Return (33, 101, 3) [m] of positions (33, n, 3) [m] at nodes (n,) [m], each grasp being a node."""
        return rod.sample(self.scene, nodes, positions, self.places)


def cable(bending: float) -> Cable:
    """Return the cable of all cases; no peer damps its stretch, and the judging rod does not."""
    return Cable(length=1.0, diameter=0.005, linear_density=0.05, bending_stiffness=bending, axial_damping=0.0)


def planar(bending: float, grasp: float) -> Scene:
    """Return the paper's case: a straight cable without weight, moved 0.5 m sideways in 1.6 s at one grasp."""
    return Scene(
        cable=cable(bending),
        shape=Straight(),
        grasps=(Grasp(u=grasp, path=Move(displacement=(0.0, 0.5, 0.0), duration=1.6)),),
        environment=Environment(gravity=WEIGHTLESS, drag=0.05),
        effects=NO_CONTACT,
    )


def hanging() -> Scene:
    """Return a cable that hangs in balance between two grippers 0.7 m apart, of which one moves in 3D for 1 s."""
    still = Grasp(u=0.0)
    moved = Grasp(u=1.0, path=Move(displacement=(-0.2, 0.2, 0.1), duration=1.0))
    return _settled((still, moved), lambda x: x * (x - 1.0))


def twisted() -> Scene:
    """Return the same cable in two level clamps, one of which moves and turns once about its own axis in 1 s."""
    still = Grasp(u=0.0, hold="clamp")
    turn = Move(displacement=(-0.1, 0.1, 0.0), rotation=(2 * np.pi, 0.0, 0.0), duration=1.0)
    return _settled((still, Grasp(u=1.0, hold="clamp", path=turn)), lambda x: np.cos(2 * np.pi * x) - 1.0)


def _settled(grasps: tuple[Grasp, Grasp], sag: Callable[[Floats], Floats]) -> Scene:
    """Return a cable between grippers 0.7 m apart that starts in its equilibrium, found from the form `sag` (x)."""
    x = np.linspace(0.0, 1.0, 101)

    def points(depth: float) -> Floats:
        return np.column_stack([0.7 * x, 0.0 * x, depth * sag(x)])

    def excess(depth: float) -> float:
        return float(np.linalg.norm(np.diff(points(depth), axis=0), axis=1).sum()) - 1.0

    scene = Scene(
        cable=cable(1e-3),
        shape=Points(points=points(brentq(excess, 0.01, 4.0))),
        grasps=grasps,
        environment=Environment(drag=0.1),
        effects=NO_CONTACT,
    )
    found = equilibrium(scene, n_u=65)
    if found.status != "converged":
        raise RuntimeError(f"the start did not settle: {found.message}")
    own = np.zeros(len(found.control_points))  # strain: they are in material coordinates
    return replace(scene, shape=ControlPoints(control_points=found.control_points, knots=found.knots_u, strain=own))


def make(name: str, family: str, scene: Scene) -> Case:
    """Return the case of a scene with its converged motion: the judging rod's, with twist a fine march's.

    Raises:
        RuntimeError: the motion did not converge to `STILL`.
    """
    u = np.linspace(0.0, scene.cable.length, SAMPLES_U)
    t = np.linspace(0.0, float(scene.horizon or 0.0), SAMPLES_T)
    motions = []
    for n_u, n_t in FINE:
        found = predict(replace(scene, quality=fine(n_u, n_t)), keep_grid=True)
        if found.status != "converged":
            raise RuntimeError(f"the fine march of {name} did not converge: {found.message}")
        motions.append(found.surface.positions(u, t))
    apart = float(np.linalg.norm(motions[1] - motions[0], axis=-1).max())
    if any(g.hold == "clamp" for g in scene.grasps):
        truth, uncertainty, check = motions[1], apart, apart
    else:
        judge = rod.converged(scene, STILL, samples_u=SAMPLES_U, times=t)
        truth, uncertainty = judge.positions, judge.error_estimate
        check = float(np.linalg.norm(motions[1] - truth, axis=-1).max())
    if not uncertainty <= 2.0 * STILL:
        raise RuntimeError(f"the reference of {name} still moved by {1e3 * uncertainty:.2g} mm")
    stretch = None
    if isinstance(scene.shape, Straight):
        stiff = replace(scene.cable, axial_stiffness=100.0 * cast(float, scene.cable.axial_stiffness))
        rigid = predict(replace(scene, cable=stiff, quality=fine(*FINE[0]))).surface.positions(u, t)
        stretch = float(np.linalg.norm(rigid - motions[0], axis=-1).max())
    return Case(
        name=name,
        family=family,
        scene=scene,
        truth=truth,
        uncertainty=uncertainty,
        check=check,
        stretch=stretch,
    )


def fine(n_u: int, n_t: int) -> Quality:
    """Return the quality of a march on a given grid."""
    return Quality(n_u=n_u, n_t=n_t, method="march", estimate=False)


def all_cases(wanted: str = "") -> Iterator[Case]:
    """Yield the cases whose name contains `wanted`, one after the other: each takes seconds to judge."""
    for name, scene in (("hanging, two grippers", hanging), ("hanging, one turn of twist", twisted)):
        if wanted in name:
            yield make(name, name, scene())
    for grasp, bending in product(GRASPS, BENDING):
        name = f"EI {bending:g}, grasp {grasp:g} m"
        if wanted in name:
            yield make(name, f"plane, EI {bending:g}", planar(bending, grasp))
