"""What the MuJoCo peers share: a gripper's frame, its paths, and the drag law in MuJoCo's terms.

One grasp is the root of the model and stays where it is: the simulation runs in its frame, which does not turn, under
gravity less its acceleration and with a wind against its velocity. That prescribes it exactly, at no cost. The others
are followed in this frame.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from benchmarks.peers.cases import SAMPLES_T, Case
from benchmarks.rod_scene import Start, start_of
from dlocore import Grasp

Floats = NDArray[np.float64]
PEEK = 1e-4  # [s]: velocities and accelerations of the paths are differences over this


@dataclass(frozen=True, kw_only=True)
class Frame:
    """The motion of the root grasp and of the others against it at every step.

    Attributes:
        steps: of each of the 32 intervals between samples.
        dt: time step [s].
        nodes: (n,) [m].
        start: the cable at the nodes.
        root: node of the root grasp.
        origin: (33, 3) [m], its positions at the samples.
        gravity: (steps, 3) [m/s^2], felt in its frame in the middle of each step.
        wind: (steps, 3) [m/s].
        followed: the other grasps and their nodes.
    """

    steps: int
    dt: float
    nodes: Floats
    start: Start
    root: int
    origin: Floats
    gravity: Floats
    wind: Floats
    followed: tuple[tuple[Grasp, int], ...]


def frame_of(case: Case, elements: int, steps: int) -> Frame:
    """Return the frame of the first grasp on `elements` even elements and `steps` steps an interval."""
    scene = case.scene
    nodes = np.linspace(0.0, scene.cable.length, elements + 1)
    start = start_of(scene, nodes)
    at = [int(np.argmin(np.abs(nodes - g.u))) for g in scene.grasps]
    count = steps * (SAMPLES_T - 1)
    dt = case.horizon / count
    grasp, root = scene.grasps[0], at[0]
    origin = start.positions[root]
    middle = (np.arange(count) + 0.5) * dt
    before, now, after = (grasp.path.at(middle + s, origin) for s in (-PEEK, 0.0, PEEK))
    return Frame(
        steps=steps,
        dt=dt,
        nodes=nodes,
        start=start,
        root=root,
        origin=grasp.path.at(case.times, origin),
        gravity=np.asarray(scene.environment.gravity) - (after - 2.0 * now + before) / PEEK**2,
        wind=-(after - before) / (2.0 * PEEK),
        followed=tuple(zip(scene.grasps[1:], at[1:], strict=True)),
    )


def transported(frame: Frame) -> list[Rotation]:
    """Return frames without twist, x along the cable: at its first end, on every edge, and at its last end."""
    axes = np.diff(frame.start.positions, axis=0)
    axes /= np.linalg.norm(axes, axis=1)[:, None]
    frames = [_least(np.array([1.0, 0.0, 0.0]), frame.start.directions[0])]
    for axis in [*axes, frame.start.directions[-1]]:
        frames.append(_least(frames[-1].as_matrix()[:, 0], axis) * frames[-1])
    return frames


def _least(a: Floats, b: Floats) -> Rotation:
    """Return the least rotation from the unit vector a to b, which are not opposite."""
    cross = np.cross(a, b)
    sine = np.linalg.norm(cross)
    if sine < 1e-14:
        return Rotation.identity()
    return Rotation.from_rotvec(cross / sine * np.arctan2(sine, a @ b))


def even_counts(case: Case, counts: tuple[int, ...]) -> tuple[int, ...]:
    """Return those numbers of even elements that have a node at every grasp."""
    length = case.scene.cable.length
    shares = [g.u / length for g in case.scene.grasps]
    return tuple(n for n in counts if all(abs(s * n - round(s * n)) < 1e-9 for s in shares))


def viscosity(drag: float, reach: float) -> float:
    """Return MuJoCo's viscosity that drags a body of equivalent radius `reach` l by drag l: 6 pi beta r = c l."""
    return drag / (6.0 * np.pi * reach)
