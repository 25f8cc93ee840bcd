"""Recordings of a simulated cable between two grippers, with bad tracking: noise, outliers, lost markers."""

from dataclasses import dataclass, replace
from typing import cast

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from dlocore import Cable, Environment, Grasp, Points, Scene, Waypoints
from dlocore.problem.problem import pose
from dlocore.recordings import Recording
from dlocore.solvers.march import march
from dlocore.solvers.monitor import Monitor
from dlocore.spline import design_matrix
from dlocore.statics.statics import start_grid

Floats = NDArray[np.float64]

RATE = 200.0  # [Hz]
STEPS = 400.0  # [1/s] of the truth
SWUNG, APART = 0.09, 0.05  # [m] how far both grippers swing together once a second, and each of them beside that
JAW = 0.05  # [m] between the two markers of a gripper, from which the cable hangs
U = np.array([0.0, JAW, *np.linspace(0.13, 0.87, 9), 1.0 - JAW, 1.0])  # [m] of the markers; two pairs are held
HELD = (0, 1, -2, -1)
STILL = 0.3  # [s] before the grippers start
CABLE = Cable(
    length=1.0,
    diameter=0.006,
    linear_density=0.05,
    bending_stiffness=3e-3,
    bending_damping=5e-4,
    axial_stiffness=600.0,
)
DRAG = Environment(drag=0.06)


@dataclass(frozen=True, kw_only=True)
class Tracking:
    """How badly markers are tracked: noise [m], share of outliers and their size [m], share of lost markers.

    `held` is the noise of the grippers' own markers [m].
    """

    noise: float = 1e-3
    held: float = 1e-3
    outliers: float = 0.05
    size: float = 0.05
    lost: float = 0.10


def true_cable(rng: np.random.Generator) -> tuple[Cable, Environment]:
    """Return a cable and drag as a trial draws them, over a factor of three each about `CABLE` and `DRAG`."""

    def about(value: float) -> float:
        return float(value * np.exp(rng.uniform(-0.55, 0.55)))

    cable = replace(
        CABLE,
        bending_stiffness=about(cast(float, CABLE.bending_stiffness)),
        bending_damping=about(CABLE.bending_damping),
    )
    return cable, Environment(drag=about(DRAG.drag))


def gripper_path(rng: np.random.Generator, times: Floats, planar: bool, far: float) -> tuple[Floats, Floats]:
    """Return displacements (k, 3) [m] and rotation vectors (k, 3) [rad] that start at rest.

    They are three swings in directions of their own, `far` [m] at 1 Hz, slower ones farther and faster ones less far.
    """
    t = np.maximum(times - STILL, 0.0)
    ramp = 1.0 - np.exp(-((t / 0.5) ** 3))
    shift, turn = np.zeros((len(t), 3)), np.zeros((len(t), 3))
    for frequency in (0.6, 1.1, 1.7):
        phase = rng.uniform(0.0, 2.0 * np.pi, 6)
        size = rng.standard_normal(3)
        size *= far / np.sqrt(frequency) / np.linalg.norm(size)
        bend = rng.normal(0.0, 0.12, 3)
        shift += ramp[:, None] * size * np.sin(2.0 * np.pi * frequency * t[:, None] + phase[:3])
        turn += ramp[:, None] * bend * np.sin(2.0 * np.pi * frequency * t[:, None] + phase[3:])
    if planar:
        shift[:, 1] = 0.0
        turn[:, [0, 2]] = 0.0
    return shift, turn


def scene_of(rng: np.random.Generator, cable: Cable, environment: Environment, seconds: float, planar: bool) -> Scene:
    """Return a cable that hangs between two grippers which leave it downwards and move about."""
    times = np.arange(round(seconds * RATE) + 1) / RATE
    x = np.linspace(0.0, 1.0, 41)
    sag = np.column_stack([0.5 * x - 0.04 * np.sin(2 * np.pi * x), 0.0 * x, -1.55 * x * (1.0 - x)])
    sag *= cable.length / np.linalg.norm(np.diff(sag, axis=0), axis=1).sum()
    swing = gripper_path(rng, times, planar, SWUNG)[0]
    grasps = []
    for u, at in ((0.0, sag[0]), (cable.length, sag[-1])):
        shift, turn = gripper_path(rng, times, planar, APART)
        turns = Rotation.from_rotvec(turn).as_quat()[:, [3, 0, 1, 2]]
        way = Waypoints(times=times, positions=at + swing + shift, orientations=turns)
        grasps.append(Grasp(u=u, hold="tangent", path=way))
    return Scene(
        cable=cable,
        shape=Points(points=sag, settle=True),
        grasps=tuple(grasps),
        environment=environment,
        horizon=float(times[-1]),
        effects={"twist": "off", "inertia": "on"},
    )


def simulated(
    seed: int,
    seconds: float = 4.0,
    *,
    cable: Cable | None = None,
    environment: Environment | None = None,
    tracking: Tracking | None = None,
    planar: bool = False,
    n_u: int = 17,
) -> Recording:
    """Return a recording of a simulated motion, marched twice as finely in time as it is replayed.

    Args:
        seed: of the motion and of the tracking.
        seconds: recorded time.
        cable, environment: the truth; None: drawn by `true_cable` from the seed.
        tracking: how badly it is tracked.
        planar: the grippers move and the cable hangs in the x-z plane, and noise is in it.
        n_u: control points of the truth.
    """
    drawn = true_cable(np.random.default_rng([seed, 1]))
    cable, environment = cable or drawn[0], environment or drawn[1]
    rng = np.random.default_rng([seed, 2])
    between = 1.0 - 2.0 * JAW  # [m] of the cable, which each gripper keeps straight between its markers
    scene = scene_of(rng, replace(cable, length=between), environment, seconds, planar)
    problem = pose(scene)
    monitor = Monitor(None, None, None)
    grid = start_grid(problem, n_u, monitor)
    steps = round(seconds * STEPS)
    motion = march(problem, grid, steps, monitor)
    assert not motion.stopped, "the truth must be a whole motion"
    states = problem.world(motion.states[:: round(STEPS / RATE)])[..., :3]
    markers = np.einsum("mi,kid->kmd", design_matrix(grid.knots, np.clip(U - JAW, 0.0, between)), states)
    for outer, tip, sign in ((0, 0.0, -1.0), (-1, between, 1.0)):
        along = (design_matrix(grid.knots, [tip], 1) @ states)[:, 0]
        markers[:, outer] += sign * JAW * along / np.linalg.norm(along, axis=1)[:, None]
    tracking = tracking or Tracking()
    spread = np.array([1.0, 0.0 if planar else 1.0, 1.0])
    size = np.full(len(U), float(tracking.noise))
    size[list(HELD)] = tracking.held
    markers = markers + size[:, None] * spread * rng.standard_normal(markers.shape)
    wild = rng.random(markers.shape[:2]) < tracking.outliers
    markers[wild] += tracking.size * spread * rng.standard_normal((int(wild.sum()), 3))
    markers[rng.random(markers.shape[:2]) < tracking.lost] = np.nan
    return Recording(
        times=np.arange(len(markers)) / RATE,
        markers=markers,
        u=U,
        held=HELD,
        length=1.0,
        diameter=cable.diameter,
        linear_density=cable.linear_density,
        name=f"simulated {seed}",
    )
