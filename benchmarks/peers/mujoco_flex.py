"""MuJoCo's one-dimensional flex: point masses on slides, its discrete elastic rod for bending, and stiff edges."""

from collections.abc import Callable
from typing import Any, cast

import numpy as np

from benchmarks.peers.cases import SAMPLES_T, Case, Floats
from benchmarks.peers.frame import Frame, even_counts, frame_of, viscosity
from benchmarks.peers.mujoco_steps import COUNTS, STEPS, Followers, advance, carriage, document, load
from benchmarks.peers.search import Setting, Value
from benchmarks.rod_scene import plane_of

REACH = 0.25  # of the length that a vertex stands for: the radius of its drag


class Flex:
    """The flex, with edges kept by constraints (any integrator) or by springs (explicit ones only)."""

    name = "MuJoCo flex"
    budget = 20.0

    def knobs(self, case: Case) -> dict[str, tuple[Value, ...]]:
        """Return integrators with the kind of edge, numbers of edges, and steps in each of 32 intervals."""
        if any(g.hold != "point" for g in case.scene.grasps):
            return {}
        return {
            "integrator": ("discrete, constraints", "RK4, springs", "Euler, springs", "Euler, constraints"),
            "elements": even_counts(case, COUNTS),
            "steps": STEPS,
        }

    def cost(self, case: Case, setting: Setting) -> float:
        """Return evaluations times vertices; an implicit step is dearer than an explicit one."""
        work = {"discrete, constraints": 5.0, "RK4, springs": 4.0, "Euler, springs": 1.0, "Euler, constraints": 2.5}
        return work[cast(str, setting["integrator"])] * cast(int, setting["steps"]) * cast(int, setting["elements"])

    def prepare(self, case: Case, setting: Setting) -> Callable[[], Callable[[], Floats]]:
        """Compile the model, lay the cable out, and return its simulation."""
        frame = frame_of(case, cast(int, setting["elements"]), cast(int, setting["steps"]))
        axes = "xy" if plane_of(case.scene, frame.start) == (0, 1) else "xyz"
        model, data = load(_document(case, frame, cast(str, setting["integrator"]), axes))
        away = frame.start.positions - frame.start.positions[frame.root]
        away[:, 0] -= frame.nodes - frame.nodes[frame.root]
        for node in range(len(frame.nodes)):
            if node != frame.root:
                where = model.jnt_qposadr[model.body_jntadr[model.body(_name(frame, node)).id]]
                data.qpos[where : where + len(axes)] = away[node, : len(axes)]
        followers = Followers.of(model, frame)
        if followers is not None:
            followers.q[:] -= [frame.nodes[-1] - frame.nodes[frame.root], 0.0, 0.0]

        def run() -> Callable[[], Floats]:
            positions = advance(model, data, frame, followers, _Recorder(model, data, frame))
            return lambda: case.of_nodes(frame.nodes, positions + frame.origin[:, None])

        return run


class _Recorder:
    """Keeps where the vertices are at the samples; the root's stays at the origin."""

    def __init__(self, model: Any, data: Any, frame: Frame) -> None:
        self.data = data
        self.moving = [k for k in range(len(frame.nodes)) if k != frame.root]
        self.bodies = [model.body(_name(frame, k)).id for k in self.moving]
        self.positions = np.zeros((SAMPLES_T, len(frame.nodes), 3))

    def keep(self, sample: int) -> None:
        """Store the present positions."""
        self.positions[sample, self.moving] = self.data.xpos[self.bodies]

    def result(self) -> Floats:
        """Return positions (33, n, 3) [m] in the root's frame."""
        return self.positions


def _name(frame: Frame, node: int) -> str:
    if node == frame.root:
        return "world"
    return "carriage" if any(node == at for _, at in frame.followed) else f"vertex{node}"


def _document(case: Case, frame: Frame, integrator: str, axes: str) -> str:
    cable = case.scene.cable
    EI, EA = cast(float, cable.bending_stiffness), cast(float, cable.axial_stiffness)
    radius = 0.5 * cable.diameter
    section = np.pi * radius**4 / 4.0
    last = len(frame.nodes) - 1
    h = cable.length / last
    units = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1"}
    slides = "".join(f'<joint type="slide" axis="{units[axis]}"/>' for axis in axes)
    bodies = ""
    for node in range(last + 1):
        name, place = _name(frame, node), frame.nodes[node] - frame.nodes[frame.root]
        if name == "carriage":
            bodies += carriage(frame.followed[0][0]).replace("<body ", f'<body pos="{place:.12g} 0 0" ')
        elif name != "world":
            cell = h if 0 < node < last else 0.5 * h
            mass = cable.linear_density * cell
            inertia = f"{mass * (REACH * cell) ** 2 / 1.5:.12g}"
            bodies += (
                f'<body name="{name}" pos="{place:.12g} 0 0">{slides}<inertial pos="0 0 0" mass="{mass:.12g}" '
                f'diaginertia="{inertia} {inertia} {inertia}"/></body>'
            )
    stepping, edges = integrator.split(", ")
    spring = f'<edge stiffness="{EA / h:.12g}"/>' if edges == "springs" else ""
    names = " ".join(_name(frame, k) for k in range(last + 1))
    elements = " ".join(f"{k} {k + 1}" for k in range(last))
    flex = (
        f'<deformable><flex name="rod" dim="1" radius="{radius:.12g}" body="{names}" '
        f'vertex="{" ".join(["0 0 0"] * (last + 1))}" element="{elements}">{spring}'
        f'<contact selfcollide="none"/><elasticity young="{EI / section:.12g}"/></flex></deformable>'
    )
    stiff = (
        f'<equality><flex flex="rod" solref="{2.0 * frame.dt:.12g} 1" solimp="0.9999 0.9999 0.001"/></equality>'
        if edges == "constraints"
        else ""
    )
    return document(
        frame,
        integrator=stepping,
        viscosity=viscosity(case.scene.environment.drag, REACH),
        bodies=bodies,
        rest=flex + stiff,
    )
