"""The chain of a rod while the same grippers hold it; an edge without length stands where a direction is held."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dlocore.reference.body import CLAMP, DIRECTION, GYRATION, REAL, Body, Guide, State
from dlocore.reference.rod import Memory, Rod, Snapshot, carried, unit
from dlocore.scene.paths import held_at
from dlocore.scene.scene import Grasp

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]

DIFFERENCE = 1e-5  # [s]: of the central differences for the rates of paths


@dataclass(frozen=True, eq=False)
class Grip:
    """A closed gripper: its grasp, and position, tangent and director (3,) in the rod's coordinates when it closed."""

    grasp: Grasp
    node: int
    position: Floats
    tangent: Floats
    director: Floats


@dataclass(frozen=True, eq=False)
class Chain:
    """A rod held by some grippers.

    Attributes:
        rod: the rod.
        grips: the grippers that hold it.
        begin, end: from when to when [s].
        body: the constants of the equations.
        node_of: real node of each node of the chain (n,).
        edge_of: real edge of each edge, or -1 - index of the grip (n - 1,).
    """

    rod: Rod
    grips: tuple[Grip, ...]
    begin: float
    end: float
    body: Body
    node_of: Integers
    edge_of: Integers

    def guide(self, t: Floats) -> Guide:
        """Return what grippers and loads prescribe at times t (s,) [s]."""
        held = [k for k in range(len(self.node_of)) if self._grip_at(self.node_of[k]) is not None]
        virtual = np.flatnonzero(self.body.kind != REAL)
        delta = min(DIFFERENCE, 1e-3 * (self.end - self.begin))
        near = np.clip(t, self.begin + delta, self.end - delta)[:, None] + delta * np.array([-1.0, 1.0])
        places = {}
        turns = {}
        for i, grip in enumerate(self.grips):
            moved = self._positions(grip, np.concatenate([t, near.ravel()]))
            rate = moved[len(t) :].reshape(len(t), 2, 3)
            places[grip.node] = (moved[: len(t)], (rate[:, 1] - rate[:, 0]) / (2 * delta))
            if grip.grasp.hold != "point":
                turns[i] = self._orientations(grip, np.concatenate([t, near.ravel()]))
        tangent, director, rates = (np.zeros((len(t), len(virtual), 3)) for _ in range(3))
        spin = np.zeros((len(t), len(virtual)))
        for j, e in enumerate(virtual):
            both = turns[-1 - int(self.edge_of[e])]
            now, around = both[: len(t)], both[len(t) :].reshape(len(t), 2, 2, 3)
            tangent[:, j], director[:, j] = now[:, 0], now[:, 1]
            rate = (around[:, 1] - around[:, 0]) / (2 * delta)
            rates[:, j] = rate[:, 0]
            spin[:, j] = (rate[:, 1] * np.cross(now[:, 0], now[:, 1])).sum(axis=1)
        stack = np.array([places[int(self.node_of[k])] for k in held]).reshape(len(held), 2, len(t), 3)
        position, velocity = (np.ascontiguousarray(stack[:, d].transpose(1, 0, 2)) for d in (0, 1))
        load = self.loads(t, self.end)
        return Guide(np.array(held, np.int64), position, velocity, virtual, tangent, director, rates, spin, load)

    def loads(self, t: Floats, end: float) -> Floats:
        """Return the forces of loads on the nodes (s, n, 3) [N] at times t (s,) [s], as `dlocore.Load.at` does."""
        load = np.zeros((len(t), len(self.node_of), 3))
        for given in self.rod.problem.scene.loads:
            load[:, int(np.argmax(self.node_of == self.rod.node(given.u)))] += given.at(t, end) @ self.rod.axes.T
        return load

    def _grip_at(self, node: int) -> Grip | None:
        return next((grip for grip in self.grips if grip.node == node), None)

    def _positions(self, grip: Grip, t: Floats) -> Floats:
        start = self.rod.world(grip.position)
        return self.rod.inside(held_at(grip.grasp.path, t - grip.grasp.start, start))

    def acceleration(self, grip: Grip, t: float, span: float) -> Floats:
        """Return the acceleration (3,) [m/s^2] of a gripper at t [s] by differences over `span` [s]."""
        delta = min(span, 0.25 * (self.end - self.begin))
        middle = np.clip(t, self.begin + delta, self.end - delta)
        x = self._positions(grip, middle + delta * np.array([-1.0, 0.0, 1.0]))
        return np.asarray((x[2] - 2 * x[1] + x[0]) / delta**2)

    def _orientations(self, grip: Grip, t: Floats) -> Floats:
        """Return tangents and directors (k, 2, 3) of a gripper in the rod's coordinates."""
        pair = np.array([grip.tangent, grip.director])
        turns = grip.grasp.path.rotation_at(t - grip.grasp.start)
        if turns is None:
            return np.broadcast_to(pair, (len(t), 2, 3))
        turns = self.rod.axes @ turns @ self.rod.axes.T
        return np.asarray((turns[:, None] @ pair[None, :, :, None])[..., 0])

    def state(self, now: Snapshot) -> State:
        """Return a state of the rod as a state of this chain, with what grippers prescribe in place."""
        n = len(self.node_of)
        q, v = np.zeros((n, 4)), np.zeros((n, 4))
        q[:, :3], v[:, :3] = now.x[self.node_of], now.v[self.node_of]
        t, a = np.empty((n - 1, 3)), np.empty((n - 1, 3))
        axial = np.zeros(n - 1)
        for e, real in enumerate(self.edge_of):
            if real >= 0:
                t[e], a[e], axial[e] = now.t[real], now.a[real], now.axial[real]
                v[e, 3] = now.spin[real]
            else:
                t[e], a[e] = self._orientations(self.grips[-1 - real], np.array([self.begin]))[0]
                if self.body.kind[e] == DIRECTION:  # the section has spun in the gripper since it closed
                    a[e] = self._spun(now, e, t[e])
        turn, memory = np.empty(n - 2), np.empty((n - 2, 3))
        for k in range(n - 2):
            node = self.node_of[k + 1]
            if self.edge_of[k] >= 0 and self.edge_of[k + 1] >= 0:
                turn[k], memory[k] = now.kept.turn[node].sum(), now.kept.memory[node].mean(axis=0)
            else:
                side = 0 if self.edge_of[k] >= 0 else 1
                turn[k], memory[k] = now.kept.turn[node, side], now.kept.memory[node, side]
        guide = self.guide(np.array([self.begin]))
        q[guide.nodes, :3], v[guide.nodes, :3] = guide.position[0], guide.velocity[0]
        if self.body.dims == 2:
            v[:, 2:] = 0.0
        return State(q, v, t, a, turn, memory, axial, now.anchor.copy())

    def _spun(self, now: Snapshot, e: int, t: Floats) -> Floats:
        """Return the director of a section whose direction is held, from that of the edge next to it."""
        node = self.node_of[e]
        if e + 1 < len(self.edge_of):
            real = self.edge_of[e + 1]
            return carried(now.t[real], t, now.a[real], -float(now.kept.turn[node, 1]))
        real = self.edge_of[e - 1]
        return carried(now.t[real], t, now.a[real], float(now.kept.turn[node, 0]))

    def snapshot(self, state: State) -> Snapshot:
        """Return a state of this chain as a state of the rod."""
        nodes = len(self.rod.u)
        first = np.searchsorted(self.node_of, np.arange(nodes))
        real = np.flatnonzero(self.edge_of >= 0)
        turn, memory = np.zeros((nodes, 2)), np.repeat(self.rod.start.kept.memory[:, :1], 2, axis=1)
        for k in range(len(self.node_of) - 2):
            node = self.node_of[k + 1]
            if self.edge_of[k] >= 0 and self.edge_of[k + 1] >= 0:
                turn[node], memory[node] = 0.5 * state.turn[k], state.memory[k]
            else:
                side = 0 if self.edge_of[k] >= 0 else 1
                turn[node, side], memory[node, side] = state.turn[k], state.memory[k]
        return Snapshot(
            x=state.q[first, :3].copy(),
            v=state.v[first, :3].copy(),
            t=state.t[real].copy(),
            a=state.a[real].copy(),
            spin=state.v[real, 3].copy(),
            kept=Memory(turn, memory),
            axial=state.axial[real].copy(),
            anchor=state.anchor.copy(),
        )


def grip(rod: Rod, grasp: Grasp, now: Snapshot) -> Grip:
    """Close a gripper on the rod."""
    node = rod.node(grasp.u)
    last = len(rod.u) - 1
    if grasp.start == 0.0:
        tangent = rod.problem.start(grasp.u, 1)[0] @ rod.axes.T
        director = rod.directors[node]
        position = rod.inside(rod.problem.start(grasp.u)[0])
        if rod.planar:
            tangent[2] = position[2] = 0.0
    else:
        position = now.x[node]
        if node in (0, last):  # half an edge beyond the middle of the last one
            here, other = (0, 1) if node == 0 else (last - 1, last - 2)
            tangent = 1.5 * now.t[here] - 0.5 * now.t[other]
            twist = 0.5 * float(now.kept.turn[1 if node == 0 else last - 1].sum()) * (-1.0 if node == 0 else 1.0)
            director = carried(now.t[here], unit(tangent), now.a[here], twist)
        else:
            h = np.diff(rod.u)
            left, right = h[node], h[node - 1]  # the nearer edge has more weight
            tangent = (left * now.t[node - 1] + right * now.t[node]) / (left + right)
            share = float(now.kept.turn[node].sum()) * h[node - 1] / (left + right)
            director = carried(now.t[node - 1], unit(tangent), now.a[node - 1], share)
    tangent = unit(tangent)
    return Grip(grasp, node, position, tangent, carried(tangent, tangent, director))


def chain(rod: Rod, grips: tuple[Grip, ...], begin: float, end: float) -> Chain:
    """Return the chain of a rod that `grips` hold from `begin` to `end` [s]."""
    problem, cable = rod.problem, rod.problem.scene.cable
    directed = {g.node: i for i, g in enumerate(grips) if g.grasp.hold != "point"}
    last = len(rod.u) - 1
    node_of: list[int] = []
    edge_of: list[int] = []
    for node in range(last + 1):
        node_of.append(node)
        if node in directed:
            edge_of.append(-1 - directed[node])
            node_of.append(node)
        if node < last:
            edge_of.append(node)
    n = len(node_of)
    h = np.diff(rod.u)
    rest = np.array([h[e] if e >= 0 else 0.0 for e in edge_of])
    clamps = not rod.planar and problem.scene.effects.get("twist", "auto") != "off"
    kind = np.full(n - 1, REAL)
    for e, of in enumerate(edge_of):
        if of < 0:
            kind[e] = CLAMP if clamps and grips[-1 - of].grasp.hold == "clamp" else DIRECTION
    held = np.isin(node_of, [g.node for g in grips])
    fixed = np.zeros((n, 4), np.bool_)
    fixed[held, :3] = True
    fixed[-1, 3] = True
    fixed[:-1, 3] = kind == CLAMP
    if rod.planar:
        fixed[:, 2:] = True
    cell = 0.5 * (np.append(rest, 0.0) + np.append(0.0, rest))
    mass = np.zeros((n, 4))
    mass[:, :3] = cable.linear_density * cell[:, None]
    for one in cable.point_masses:
        mass[node_of.index(rod.node(one.u)), :3] += one.mass
    mass[:-1, 3] = cable.linear_density * rod.law[GYRATION] ** 2 * rest
    places = np.array([int(np.flatnonzero(np.array(edge_of) == e)[0]) for e in range(last)], np.int64)
    body = Body(
        dims=2 if rod.planar else 4,
        rest=rest,
        kind=kind.astype(np.int64),
        fixed=fixed,
        mass=mass,
        cell=cell,
        weight=mass[:, :1] * rod.gravity,
        width=0.5 * (rest[1:] + rest[:-1]),
        natural=rod.natural[np.array(node_of)[1:-1]],
        law=rod.law,
        point_edge=places[rod.point_edge] if len(rod.point_edge) else rod.point_edge,
        point_along=rod.point_along,
        point_length=rod.point_length,
        point_lies=rod.point_lies,
        surfaces=rod.surfaces,
    )
    return Chain(rod, grips, begin, end, body, np.array(node_of), np.array(edge_of))
