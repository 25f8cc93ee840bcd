"""MuJoCo's way of the removed cable plugin: rigid links with a spring in every joint (hinges in the plane, else balls).

A ball joint's spring resists every rotation alike, so twist has the stiffness of bending: GJ = EI, as in the cases.
"""

from collections.abc import Callable
from typing import Any, cast

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.peers.cases import SAMPLES_T, Case, Floats
from benchmarks.peers.frame import Frame, even_counts, frame_of, transported, viscosity
from benchmarks.peers.mujoco_steps import COUNTS, STEPS, Followers, advance, carriage, document, load
from benchmarks.peers.search import Setting, Value
from benchmarks.rod_scene import plane_of

STRETCHES = 100.0  # [N]: with 64 N stretching moves the planar cases by up to 0.5 mm, with 640 N by 0.03 mm
THICK = 1.0 / 8.0  # of a link's length: half the sides of its equivalent box, for a drag torque near c l^3/12


class Chain:
    """The chain of rigid links, for cables that stretch enough to notice also of links on axial springs."""

    name = "MuJoCo chain"
    budget = 20.0

    def knobs(self, case: Case) -> dict[str, tuple[Value, ...]]:
        """Return integrators, link kinds, numbers of links, and steps in each of 32 intervals."""
        stretches = cast(float, case.scene.cable.axial_stiffness) < STRETCHES
        return {
            "integrator": ("discrete", "RK4", "Euler"),
            "links": ("rigid", "springs") if stretches else ("rigid",),
            "elements": even_counts(case, COUNTS),
            "steps": STEPS,
        }

    def cost(self, case: Case, setting: Setting) -> float:
        """Return evaluations times links; long chains pay for their depth."""
        work = {"discrete": 2.5, "RK4": 4.0, "Euler": 1.0}
        return (
            work[cast(str, setting["integrator"])] * cast(int, setting["steps"]) * cast(int, setting["elements"]) ** 1.5
        )

    def prepare(self, case: Case, setting: Setting) -> Callable[[], Callable[[], Floats]]:
        """Compile the model, lay the cable out, and return its simulation."""
        frame = frame_of(case, cast(int, setting["elements"]), cast(int, setting["steps"]))
        flat = plane_of(case.scene, frame.start) == (0, 1)
        model, data = load(_document(case, frame, setting, flat))
        _lay_out(model, data, frame, flat)
        followers = Followers.of(model, frame)

        def run() -> Callable[[], Floats]:
            origins, turns = advance(model, data, frame, followers, _Recorder(model, data, frame))
            return lambda: case.of_nodes(frame.nodes, _nodes(frame, origins, turns))

        return run


class _Recorder:
    """Keeps where the links are, and how they are turned, at the samples."""

    def __init__(self, model: Any, data: Any, frame: Frame) -> None:
        self.first = 1
        self.data, self.count = data, len(frame.nodes) - 1
        self.origins = np.empty((SAMPLES_T, self.count, 3))
        self.turns = np.empty((SAMPLES_T, self.count, 3))

    def keep(self, sample: int) -> None:
        """Store the present positions of the links' first ends, and their axes."""
        links = slice(self.first, self.first + self.count)
        self.origins[sample] = self.data.xpos[links]
        self.turns[sample] = self.data.xmat[links][:, [0, 3, 6]]

    def result(self) -> tuple[Floats, Floats]:
        """Return positions and axes (33, links, 3)."""
        return self.origins, self.turns


def _document(case: Case, frame: Frame, setting: Setting, flat: bool) -> str:
    """Return the model: links named by their edge, those after the root first, then those before it."""
    cable = case.scene.cable
    EI, EA = cast(float, cable.bending_stiffness), cast(float, cable.axial_stiffness)
    edges = len(frame.nodes) - 1
    h = cable.length / edges
    mass = cable.linear_density * h
    # a box h sqrt(1/4 - THICK^2) long has the link's inertia m h^2/12 across
    inertia = f"{2 / 3 * mass * (THICK * h) ** 2:.12g} {mass * h * h / 12:.12g} {mass * h * h / 12:.12g}"
    reach = (np.sqrt(0.25 - THICK**2) + 2.0 * THICK) / 3.0
    turn = '<joint type="hinge" axis="0 0 1" ' if flat else '<joint type="ball" '

    def link(edge: int, side: int, place: float, stiffness: float) -> str:
        # what stretches is the step to a link's far neighbour: the two at the root have none
        springs = setting["links"] == "springs" and place != 0.0
        slide = f'<joint type="slide" axis="{side} 0 0" stiffness="{EA / h:.12g}"/>' if springs else ""
        return (
            f'<body name="link{edge}" pos="{place:.12g} 0 0">{slide}{turn}stiffness="{stiffness:.12g}"/>'
            f'<inertial pos="{0.5 * side * h:.12g} 0 0" mass="{mass:.12g}" diaginertia="{inertia}"/>'
        )

    grasps = case.scene.grasps
    clamped = grasps[0].hold == "clamp"
    first = link(frame.root, 1, 0.0, 2.0 * EI / h if clamped else 0.0)
    right = "".join(link(k, 1, h, EI / h) for k in range(frame.root + 1, edges))
    tip = ""
    if frame.followed:
        grasp, node = frame.followed[0]
        if node != edges:
            raise ValueError("the chain follows a second gripper at its end only")
        tip = f'<site name="end" pos="{h:.12g} 0 0"/>'
        if grasp.hold == "clamp":
            small = 1e-3
            stub = f'mass="{small * mass:.6g}" diaginertia="{" ".join([f"{small * mass * h * h:.6g}"] * 3)}"'
            tip = (
                f'<body pos="{h:.12g} 0 0">{turn}stiffness="{2.0 * EI / h:.12g}"/><inertial pos="0 0 0" {stub}/>'
                '<site name="end"/></body>'
            )
    closed = "</body>" * (edges - frame.root - 1)
    left = "".join(link(k, -1, -h if k < frame.root - 1 else 0.0, EI / h) for k in range(frame.root - 1, -1, -1))
    bodies = f"{first}{right}{tip}{closed}{left}{'</body>' * frame.root}</body>"
    return document(
        frame,
        integrator=cast(str, setting["integrator"]),
        viscosity=viscosity(case.scene.environment.drag, reach),
        bodies=bodies + "".join(carriage(g) for g, _ in frame.followed),
        rest="".join(
            f'<equality><{"weld" if g.hold == "clamp" else "connect"} site1="end" site2="carriage" '
            f'solref="{2.0 * frame.dt:.12g} 1" solimp="0.9999 0.9999 0.001"/></equality>'
            for g, _ in frame.followed
        ),
    )


def _lay_out(model: Any, data: Any, frame: Frame, flat: bool) -> None:
    """Set the balls so that the links lie on the start, without twist; hinges start straight along x as they are."""
    if flat:
        return
    frames = transported(frame)
    edges = len(frames) - 2
    bodies = [(k, model.body(f"link{k}").id) for k in range(edges)]
    if frame.followed and frame.followed[0][0].hold == "clamp":
        bodies.append((edges, model.site("end").bodyid[0]))
    for k, body in bodies:
        where = model.jnt_qposadr[model.body_jntadr[body] + model.body_jntnum[body] - 1]
        parent = Rotation.identity() if k == frame.root else frames[k if k > frame.root else k + 2]
        data.qpos[where : where + 4] = (parent.inv() * frames[k + 1]).as_quat()[[3, 0, 1, 2]]
        if k == frame.root:
            model.qpos_spring[where : where + 4] = frames[k].as_quat()[[3, 0, 1, 2]]  # of the gripper, if it clamps


def _nodes(frame: Frame, origins: Floats, axes: Floats) -> Floats:
    """Return the nodes (33, n, 3) [m] in the world from the links in the order of their bodies."""
    h = frame.nodes[1] - frame.nodes[0]
    edges, root = len(frame.nodes) - 1, frame.root
    nodes = np.empty((SAMPLES_T, edges + 1, 3))
    right = edges - root
    nodes[:, root:edges] = origins[:, :right]
    nodes[:, edges] = origins[:, right - 1] + h * axes[:, right - 1]
    for j in range(root):  # bodies after the right branch: edges root - 1, root - 2 ... 0
        nodes[:, root - 1 - j] = origins[:, right + j] - h * axes[:, right + j]
    return nodes + frame.origin[:, None]
