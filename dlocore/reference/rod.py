"""The discrete rod of a posed scene: nodes at every grasp, load and point mass, its start, laws and surfaces."""

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import cast

import numpy as np
from numpy.typing import NDArray

from dlocore.problem.plane import leftwards
from dlocore.problem.problem import Problem
from dlocore.reference import body as places
from dlocore.reference.surface import BOX, CYLINDER, FRICTION, PLANE, ROUNDING, ROW
from dlocore.scene.obstacles import Box, Capsule, Cylinder, Obstacle, Sphere
from dlocore.shape.shape import SplineCurve, rest_curve

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

SAME = 1e-9  # of the length: places nearer than this are the same
SINKS = 0.005  # of the diameter: how far it sinks in under its weight and the bending of a tenth of the length
PASSAGE = 0.005  # of the diameter: the depth at which contact has its full stiffness
STICK = 0.02  # of the diameter: how far friction gives way before it holds
STRAIGHTENING = 30  # steps of Newton's method towards edges of unit stretch
POINTS = 8  # of contact per edge if there are obstacles, so that their distance halves as edges do; otherwise 2


@dataclass(frozen=True, eq=False)
class Memory:
    """What a real node remembers on its left and right: turn (nodes, 2) [rad], memory (nodes, 2, 3) [1/m]."""

    turn: Floats
    memory: Floats


@dataclass(frozen=True, eq=False)
class Snapshot:
    """The state of a rod, whatever holds it.

    Attributes:
        x, v: positions [m] and velocities [m/s] of the nodes (n, 3), in the rod's coordinates.
        t, a: tangents and directors of the edges (n - 1, 3).
        spin: rates at which the edges spin about themselves (n - 1,) [rad/s].
        kept: twist and strain memory at the nodes.
        axial: strain memory of the edges (n - 1,).
        anchor: displacements from the anchors of friction (p, 3) [m].
    """

    x: Floats
    v: Floats
    t: Floats
    a: Floats
    spin: Floats
    kept: Memory
    axial: Floats
    anchor: Floats


@dataclass(frozen=True, eq=False)
class Rod:
    """A discrete rod.

    Attributes:
        problem: the posed scene.
        u: material coordinates of the nodes (n,) [m].
        axes: rows of the rod's coordinates in the world (3, 3); the third is across the plane of a planar motion.
        planar: whether the motion has two coordinates.
        natural: stress-free bends and twist rate at the nodes (n, 3) [1/m, 1/m, rad/m].
        law: coefficients, see `body`.
        gravity: acceleration (3,) [m/s^2] in the rod's coordinates.
        point_edge, point_along, point_length, point_lies: where it touches (p,), see `body.Body`; real edges.
        surfaces: (m, surface.ROW).
        start: the state at t = 0.
        directors: section directors at the nodes at t = 0 (n, 3).
    """

    problem: Problem
    u: Floats
    axes: Floats
    planar: bool
    natural: Floats
    law: Floats
    gravity: Floats
    point_edge: Integers
    point_along: Floats
    point_length: Floats
    point_lies: NDArray[np.bool_]
    surfaces: Floats
    start: Snapshot
    directors: Floats

    def inside(self, r: Floats) -> Floats:
        """Return the rod's coordinates (..., 3) of points r (..., 3) [m] in the world."""
        return (r - self.problem.plane.origin) @ self.axes.T

    def world(self, x: Floats) -> Floats:
        """Return the points (..., 3) [m] in the world of the rod's coordinates x (..., 3)."""
        return self.problem.plane.origin + x @ self.axes

    def node(self, u: float) -> int:
        """Return the node at the material coordinate of a grasp, a load or a point mass [m]."""
        return nearest(self.u, u)


def nearest(nodes: Floats, u: float) -> int:
    """Return which of nodes (n,) [m] is nearest to a material coordinate [m]."""
    return int(np.argmin(np.abs(nodes - u)))


def nodes_of(problem: Problem, elements: int, halvings: int) -> Floats:
    """Return the nodes (n,) [m]: about `elements` edges, halved a number of times, with a node at each given place."""
    length = problem.scene.cable.length
    marks = [0.0]
    for place in [*sorted(problem.scene.places), length]:
        if place - marks[-1] > SAME * length:
            marks.append(place)
    marks[-1] = length
    parts = [max(1, int(np.ceil(elements * (b - a) / length - 1e-6))) * 2**halvings for a, b in pairwise(marks)]
    pieces = [np.linspace(a, b, n + 1)[1:] for (a, b), n in zip(pairwise(marks), parts, strict=True)]
    return np.concatenate([[0.0], *pieces])


def build(problem: Problem, u: Floats, stiffening: float = 1.0, firmness: float = 1.0) -> Rod:
    """Return the rod of a posed scene on nodes u (n,) [m], with contact and friction made stiffer by ratios."""
    planar = problem.plane.dimensions == 2
    axes = np.vstack([problem.plane.axes, np.cross(problem.plane.axes[0], problem.plane.axes[1])])[:3]
    law = _laws(problem, stiffening, firmness)
    gravity = np.zeros(3) if problem.gravity is None else axes @ problem.gravity.gravity
    points = _points(problem, u)
    edges = len(u) - 1
    empty = Snapshot(
        x=np.zeros((edges + 1, 3)),
        v=np.zeros((edges + 1, 3)),
        t=np.zeros((edges, 3)),
        a=np.zeros((edges, 3)),
        spin=np.zeros(edges),
        kept=Memory(np.zeros((edges + 1, 2)), np.zeros((edges + 1, 2, 3))),
        axial=np.zeros(edges),
        anchor=np.zeros((len(points[0]), 3)),
    )
    rod = Rod(
        problem, u, axes, planar, np.zeros((len(u), 3)), law, gravity, *points, _surfaces(problem, axes, law), empty,
        np.zeros((edges + 1, 3)),
    )  # fmt: skip
    return _with_start(rod)


def _laws(problem: Problem, stiffening: float, firmness: float) -> Floats:
    scene, cable, around = problem.scene, problem.scene.cable, problem.scene.environment
    law = np.zeros(places.LAWS)

    def on(effect: str) -> bool:
        return scene.effects.get(effect, "auto") != "off"

    law[places.EA] = cast(float, cable.axial_stiffness)
    law[places.EI] = cast(float, cable.bending_stiffness) if on("bend") else 0.0
    law[places.GJ] = cast(float, cable.torsional_stiffness)
    law[places.AXIAL_DAMPING] = cast(float, cable.axial_damping)
    if on("damping"):
        law[places.BEND_DAMPING], law[places.TWIST_DAMPING] = cable.bending_damping, cable.torsional_damping
    if on("drag"):
        law[places.DRAG], law[places.DRAG_QUADRATIC] = around.drag, around.drag_quadratic
    law[places.YIELD_BEND : places.YIELD_STRETCH + 1] = np.inf
    law[places.SOFTENED] = 1.0 / (1.0 + cable.hardening)
    if cable.memory_rate is not None and on("plasticity"):
        law[places.MEMORY_RATE] = cable.memory_rate * (1.0 + cable.hardening)
        scale = 2.0 / cable.diameter
        for place, threshold, by in (
            (places.YIELD_BEND, cable.yield_strain, scale),
            (places.YIELD_TWIST, cable.yield_twist, scale),
            (places.YIELD_STRETCH, cable.yield_stretch, 1.0),
        ):
            law[place] = np.inf if threshold is None else threshold * by
    fall = float(np.linalg.norm(cast(Floats, around.gravity)))
    load = cable.linear_density * fall + cast(float, cable.bending_stiffness) / (0.1 * cable.length) ** 3
    law[places.RADIUS] = 0.5 * cable.diameter
    law[places.STIFFNESS] = stiffening * load / (SINKS * cable.diameter)
    law[places.PASSAGE] = PASSAGE * cable.diameter
    law[places.CONTACT_DAMPING] = 2.0 * np.sqrt(law[places.STIFFNESS] * cable.linear_density)
    law[places.STICK] = STICK * cable.diameter / firmness
    if problem.friction is not None:
        law[places.LYING] = problem.friction.lying
    law[places.DENSITY] = cable.linear_density
    law[places.GYRATION] = cable.diameter / np.sqrt(8.0)
    return law


def _points(problem: Problem, u: Floats) -> tuple[Integers, Floats, Floats, NDArray[np.bool_]]:
    """Return edge, place along it, length and kind of the points that touch."""
    edge: list[int] = []
    along: list[float] = []
    length: list[float] = []
    lies: list[bool] = []
    h = np.diff(u)
    heavy = [(nearest(u, place), alike) for place, alike in problem.masses]
    if problem.friction is not None and problem.friction.lying > 0.0:
        cells = 0.5 * (np.append(h, 0.0) + np.append(0.0, h))
        for node, alike in heavy:
            cells[node] += alike
        edge += [min(k, len(h) - 1) for k in range(len(u))]
        along += [0.0] * len(h) + [1.0]
        length += [float(c) for c in cells]
        lies += [True] * len(u)
    if problem.table is not None or problem.obstacles:
        for k, size in enumerate(h):
            parts = POINTS if problem.obstacles else 2
            for p in range(parts):
                edge.append(k)
                along.append((p + 0.5) / parts)
                length.append(float(size) / parts)
                lies.append(False)
        for node, alike in heavy:  # as much contact as for the length of cable with the same mass
            edge.append(min(node, len(h) - 1))
            along.append(float(node == len(h)))
            length.append(float(alike))
            lies.append(False)
    return np.array(edge, np.int64), np.array(along, float), np.array(length, float), np.array(lies, np.bool_)


def _surfaces(problem: Problem, axes: Floats, law: Floats) -> Floats:
    rubs = problem.friction is not None
    rows = []
    if problem.table is not None:
        table = problem.scene.environment.table
        assert table is not None
        bears = -float(problem.weight()[2])

        stiffness, width = law[places.STIFFNESS], law[places.PASSAGE]
        soft = 0.5 * stiffness * width
        depth = 0.0
        if bears > 0.0:  # the depth at which contact bears the weight, so that a cable at the table's height is at rest
            depth = np.sqrt(bears / soft) * width if bears < soft else bears / stiffness + 0.5 * width
        row = np.zeros(ROW)
        row[0], row[3] = PLANE, table.height - law[places.RADIUS] + depth
        row[4:13] = np.eye(3).ravel()
        row[FRICTION] = table.friction if rubs else 0.0
        rows.append(row)
    rows += [solid(obstacle, rubs) for obstacle in problem.obstacles]
    for row in rows:
        row[1:4] = axes @ (row[1:4] - problem.plane.origin)
        row[4:13] = (row[4:13].reshape(3, 3) @ axes.T).ravel()
    return np.array(rows).reshape(-1, ROW)


def solid(obstacle: Obstacle, rubs: bool) -> Floats:
    """Return the row (ROW,) of an obstacle: a box or a cylinder, rounded by a radius, about its centre."""
    row = np.zeros(ROW)
    row[FRICTION] = obstacle.friction if rubs else 0.0
    frame = np.eye(3)
    if isinstance(obstacle, Box):
        row[0], row[1:4] = BOX, obstacle.center
        row[13:16] = 0.5 * cast(Floats, obstacle.size)
        if obstacle.orientation is not None:
            w, x, y, z = cast(Floats, obstacle.orientation) / np.linalg.norm(cast(Floats, obstacle.orientation))
            frame = np.array(
                [
                    [1 - 2 * (y * y + z * z), 2 * (x * y + w * z), 2 * (x * z - w * y)],
                    [2 * (x * y - w * z), 1 - 2 * (x * x + z * z), 2 * (y * z + w * x)],
                    [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)],
                ]
            )
    elif isinstance(obstacle, Cylinder):
        row[0], row[1:4] = CYLINDER, obstacle.center
        row[13], row[15] = obstacle.radius, 0.5 * obstacle.height
        frame = _frame(cast(Floats, obstacle.axis))
    elif isinstance(obstacle, Capsule):
        start, end = cast(Floats, obstacle.start), cast(Floats, obstacle.end)
        row[0], row[1:4] = BOX, 0.5 * (start + end)
        row[15], row[ROUNDING] = 0.5 * float(np.linalg.norm(end - start)), obstacle.radius
        frame = _frame(end - start)
    else:
        assert isinstance(obstacle, Sphere)
        row[0], row[1:4], row[ROUNDING] = BOX, obstacle.center, obstacle.radius
    row[4:13] = frame.ravel()
    return row


def _frame(axis: Floats) -> Floats:
    third = axis / np.linalg.norm(axis)
    first = np.cross(third, np.eye(3)[int(np.argmin(np.abs(third)))])
    first /= np.linalg.norm(first)
    return np.array([first, np.cross(third, first), third])


def carried(before: Floats, after: Floats, x: Floats, angle: float = 0.0) -> Floats:
    """Return the director x (3,) carried from one tangent to another by the smallest rotation, and spun by an angle."""
    y = x - (x @ after) / (1.0 + before @ after) * (before + after)
    y -= (y @ after) * after
    y /= np.linalg.norm(y)
    return np.asarray(np.cos(angle) * y + np.sin(angle) * np.cross(after, y))


def unit(x: Floats) -> Floats:
    """Return the vectors (..., 3) with length one."""
    return np.asarray(x / np.linalg.norm(x, axis=-1, keepdims=True))


def _along(tangents: Floats, between: Floats, first: Floats, angle: Floats) -> tuple[Floats, Floats]:
    """Carry a director along a cable: from the tangent at a node to that of the edge after it, and to the next node.

    Args:
        tangents: at the nodes (n, 3).
        between: of the edges (n - 1, 3).
        first: director at the first node (3,).
        angle: theta at nodes and middles of edges, in order (2 n - 1,) [rad].

    Returns:
        directors of the edges (n - 1, 3) and at the nodes (n, 3).
    """
    at_nodes, at_edges = np.empty_like(tangents), np.empty_like(between)
    at_nodes[0] = first
    for k, t in enumerate(between):
        at_edges[k] = carried(tangents[k], t, at_nodes[k], angle[2 * k + 1] - angle[2 * k])
        at_nodes[k + 1] = carried(t, tangents[k + 1], at_edges[k], angle[2 * k + 2] - angle[2 * k + 1])
    return at_edges, at_nodes


def _with_start(rod: Rod) -> Rod:
    problem, u = rod.problem, rod.u
    start, cable = problem.start, problem.scene.cable
    x = _flat(rod, rod.inside(start(u)))
    fixed = {}
    for g in problem.scene.grasps:
        if g.start == 0.0:
            fixed[rod.node(g.u)] = _flat(rod, rod.inside(start(g.u)))[0]
    strain = start.strain_at(0.5 * (u[1:] + u[:-1]))
    if not start.bow:  # whose length is stress-free
        x = _of_length(x, np.diff(u) * (1.0 + strain), fixed)
    tangents = unit(_flat(rod, start(u, 1) @ rod.axes.T))
    between = unit(np.diff(x, axis=0))
    material = start.material
    director = np.cross([0.0, 0.0, 1.0], tangents[0]) if rod.planar else leftwards(tangents[0])
    if material is not None and not rod.planar:
        director = cast(Floats, material.director) - tangents[0] * (tangents[0] @ cast(Floats, material.director))
    director = carried(tangents[0], tangents[0], unit(director), start.lean)
    halves = np.sort(np.concatenate([u, 0.5 * (u[1:] + u[:-1])]))
    twisted = start.theta is not None and not rod.planar
    angle = start.theta(halves)[:, 0] if twisted and start.theta is not None else np.zeros(len(halves))
    if twisted:
        director = carried(tangents[0], tangents[0], director, float(angle[0]))
    a, at_nodes = _along(tangents, between, director, angle)
    natural = np.zeros((len(u), 3))
    if material is None and not isinstance(problem.rest_shape, str):
        natural = _bends(rod, rest_curve(problem.rest_shape, cable.length))
    elif material is None and problem.rest_shape == "initial":
        natural = _bends(rod, start, between)
    remembered = natural
    axial = np.zeros(len(u) - 1)
    soft = rod.law[places.SOFTENED]
    if start.bow:
        axial = (np.linalg.norm(np.diff(x, axis=0), axis=1) / np.diff(u) - 1.0 - strain) / soft
    if material is not None:
        place = cast(Floats, material.u)
        memory = _sections(rod, material.director, cast(Floats, material.memory), place, start(0.0, 1)[0])
        if material.natural is not None:
            natural = _sections(rod, material.director, cast(Floats, material.natural), place, start(0.0, 1)[0])
        remembered = natural + (memory - natural) / soft
        if material.stretch is not None:
            axial = np.interp(halves[1::2], place, cast(Floats, material.stretch)) / soft
    turn = np.zeros((len(u), 2))
    turn[1:, 0], turn[:-1, 1] = np.diff(angle)[1::2], np.diff(angle)[::2]
    v = np.zeros_like(x)
    if start.velocity is not None:
        v = _flat(rod, start.velocity(u) @ rod.axes.T)
    spin = np.zeros(len(u) - 1) if rod.planar else start.spin_at(halves)[1::2]
    snapshot = replace(
        rod.start,
        x=x,
        v=v,
        t=between,
        a=a,
        spin=spin,
        kept=Memory(turn, np.repeat(remembered[:, None], 2, axis=1)),
        axial=axial,
    )
    return replace(rod, natural=natural, start=snapshot, directors=at_nodes)


def _flat(rod: Rod, x: Floats) -> Floats:
    """Return vectors (..., 3) without their component across the plane of a planar motion."""
    out = np.array(x)
    if rod.planar:
        out[..., 2] = 0.0
    return out


def _sections(rod: Rod, director: object, memory: Floats, place: Floats, tangent: Floats) -> Floats:
    """Return remembered strains (k, 3) at `place` (k,) [m] at the nodes (n, 3); in the plane its signed bends."""
    at = np.column_stack([np.interp(rod.u, place, memory[:, d]) for d in range(3)])
    if not rod.planar:
        return at
    normal = rod.axes[2]
    first = np.cross(normal, unit(tangent))
    given = cast(Floats, director)
    out = np.zeros_like(at)
    out[:, 0] = (given @ first) * at[:, 0] - (given @ normal) * at[:, 1]
    return out


def _bends(rod: Rod, curve: SplineCurve, between: Floats | None = None) -> Floats:
    """Return the bends (n, 3) [1/m] of a curve at the nodes, in a frame without twist; its twist rate is zero."""
    tangents = unit(_flat(rod, curve(rod.u, 1) @ rod.axes.T))
    if between is None:
        between = unit(np.diff(_flat(rod, rod.inside(curve(rod.u))), axis=0))
    first = np.cross([0.0, 0.0, 1.0], tangents[0]) if rod.planar else leftwards(tangents[0])
    a, _ = _along(tangents, between, unit(first), np.zeros(2 * len(rod.u) - 1))
    b = np.cross(between, a)
    h = np.diff(rod.u)
    out = np.zeros((len(rod.u), 3))
    chi = 1.0 + (between[1:] * between[:-1]).sum(axis=1)
    for column, director in enumerate((a, b)):
        turned = (between[1:] * director[:-1]).sum(axis=1) - (between[:-1] * director[1:]).sum(axis=1)
        out[1:-1, column] = turned / chi / (0.5 * (h[1:] + h[:-1]))
    if len(out) > 3:
        out[0], out[-1] = 1.5 * out[1] - 0.5 * out[2], 1.5 * out[-2] - 0.5 * out[-3]  # in the middle of the half cells
    return out


def _of_length(x: Floats, h: Floats, fixed: dict[int, Floats]) -> Floats:
    """Return positions (n, 3) near x with edges of the lengths h (n - 1,) [m] and the `fixed` nodes in place.

    It is Newton's method on the lengths with the smallest displacement; held nodes that are too far apart leave some
    strain.
    """
    x = x.copy()
    loose = np.ones(len(x))
    for node, position in fixed.items():
        x[node], loose[node] = position, 0.0
    for _ in range(STRAIGHTENING):
        d = np.diff(x, axis=0)
        length = np.linalg.norm(d, axis=1)
        miss = length - h
        if np.abs(miss).max() <= 1e-13 * h.sum():
            break
        t = d / length[:, None]
        system = np.diag(loose[1:] + loose[:-1] + 1e-9)
        off = -loose[1:-1] * (t[1:] * t[:-1]).sum(axis=1)
        system += np.diag(off, 1) + np.diag(off, -1)
        pull = np.linalg.solve(system, miss)[:, None] * t
        move = np.zeros_like(x)
        move[:-1] += pull
        move[1:] -= pull
        x += loose[:, None] * move
    return x
