"""How hard table and obstacles press on the cable, over time."""

from collections.abc import Sequence
from dataclasses import replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from dlocore.answer.compared import Series, errors, parts_of
from dlocore.answer.parts import ContactForce
from dlocore.answer.reactions import WindowForces, Windows
from dlocore.effects.contact import normal_forces
from dlocore.effects.distance import distances
from dlocore.effects.laws import CONTACT, COUNT, TABLE
from dlocore.kernels.entry import remember_start
from dlocore.problem.grid import Grid
from dlocore.problem.problem import Problem
from dlocore.scene.scene import Scene

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

CONTACT_TIMES = 129  # at most, about, at which contact is looked at
_AT_ONCE = 1_000_000  # nodes that are looked at together, over all times
_STRIDE = 16  # of so many nodes one is looked at first
_LONGER = 1.1  # times as long as it is the cable may be strained
_SIDE = 0.01  # of the depth at which contact is as stiff as it gets: way by which a normal is found


def contact_forces(problem: Problem, grid: Grid, windows: Windows, marched: bool = True) -> tuple[ContactForce, ...]:
    """Return the forces of the table and of every obstacle that was simulated on the cable, without friction.

    They are the sums of N n ds over the nodes of contact, with N of docs/model.md eq. 21, and the speed of a node over
    the step that ends with a state. A cable that is solved in the plane of the table is carried by it, whatever moves.
    Where the states are those of a least squares, not `marched`, all nodes act.
    """
    kept = _kept([len(window.times) for window in windows])
    times = np.concatenate([window.times[at] for window, at in zip(windows, kept, strict=True)])
    found: list[ContactForce] = []
    if problem.on_table:
        carried = np.array([0.0, 0.0, _weight_on_table(problem.scene)])
        found.append(ContactForce("table", times, np.tile(carried, (len(times), 1)), np.full(len(times), carried[2])))
    if problem.contact is None:
        return tuple(found)
    nodes, weigh = grid.tables.contact, _acting if marched else _all
    weights = [weigh(problem, grid, window, at) for window, at in zip(windows, kept, strict=True)]
    met = [] if nodes.table_nodes == 0 else [("table", slice(0, nodes.table_nodes), TABLE)]
    numbered = enumerate(problem.scene.environment.obstacles)  # of which those that are simulated are some, in order
    for i, obstacle in enumerate(problem.obstacles):
        number = next(number for number, other in numbered if other is obstacle)
        met.append((f"obstacles[{number}]", slice(nodes.table_nodes, len(nodes.u)), COUNT + i))
    for name, part, row in met:
        forces, pressed = zip(
            *[
                _pressed(problem, grid, window, at[some], part, row, of_nodes[some, part])
                for window, at, of_nodes in zip(windows, kept, weights, strict=True)
                for some in np.array_split(np.arange(len(at)), -(-len(at) * (part.stop - part.start) // _AT_ONCE))
            ],
            strict=True,
        )
        found.append(ContactForce(name, times, np.concatenate(forces), np.concatenate(pressed)))
    return tuple(found)


def with_contact_errors(
    found: tuple[ContactForce, ...], windows: Windows, beside: Sequence[tuple[Problem, Grid, Windows]]
) -> tuple[ContactForce, ...]:
    """Return contact forces with their errors, from those of the same motion marched on other grids.

    Args:
        found: of the `windows`.
        windows: between events.
        beside: problem, grid and windows of each other march.
    """

    def series(force: ContactForce, of: Windows) -> Series:
        return Series(force.times, parts_of([len(at) for at in _kept([len(w.times) for w in of])]), force.force)

    others = [(contact_forces(*other), other[2]) for other in beside]
    return tuple(
        replace(
            own,
            force_error=errors(
                series(own, windows),
                [series(force, of) for forces, of in others for force in forces if force.name == own.name],
            ),
        )
        for own in found
    )


def contacts_taken_on(found: tuple[ContactForce, ...], judged: tuple[ContactForce, ...]) -> tuple[ContactForce, ...]:
    """Return contact forces with the errors of those of a motion like it, as far as it has them."""
    known = {like.name: like for like in judged if like.force_error is not None}
    return tuple(
        replace(own, force_error=np.interp(own.times, known[own.name].times, cast(Floats, known[own.name].force_error)))
        if own.name in known
        else own
        for own in found
    )


def _kept(lengths: Sequence[int]) -> list[Indices]:
    """Return which of the times of windows of these lengths are looked at: their ends, and evenly many between."""
    share = min(1.0, CONTACT_TIMES / sum(lengths))
    return [np.unique(np.linspace(0, n - 1, max(2, round(share * n))).round().astype(int)) for n in lengths]


def _weight_on_table(scene: Scene) -> float:
    """Return the weight [N] with which a cable lies on the table."""
    return scene.cable.mass * abs(float(cast(Floats, scene.environment.gravity)[2]))


def _all(problem: Problem, grid: Grid, window: WindowForces, at: Indices) -> Floats:
    """Return the weights (k, nodes) [m] of nodes that all act, as they do where no march is."""
    w = grid.tables.contact.w
    return np.broadcast_to(w, (len(at), len(w)))


def _acting(problem: Problem, grid: Grid, window: WindowForces, at: Indices) -> Floats:
    """Return the weights (k, nodes) [m] that nodes have in the steps that end with some states of a march.

    One of a cell may stand for all of it, as the cable lay at the beginning of the step.
    """
    nodes = grid.tables.contact
    if nodes.cell == 1:
        return _all(problem, grid, window, at)
    history, weights = grid.past(), np.empty((len(at), len(nodes.w)))
    for k, before in enumerate(np.maximum(at - 1, 0)):
        remember_start(problem.axes, window.states[before], grid.tables, *problem.laws, history)
        weights[k] = history.pressing
    return weights


def _pressed(
    problem: Problem, grid: Grid, window: WindowForces, at: Indices, part: slice, row: int, weights: Floats
) -> tuple[Floats, Floats]:
    """Return the force (k, 3) [N] of one thing on some nodes, in the world, and the sum of its sizes (k,) [N].

    Args:
        problem: that was solved.
        grid: of its nodes.
        window: states between two events.
        at: (k,) of them.
        part: the nodes that may meet it.
        row: of the parameters of the laws that are its.
        weights: (k, of the part) [m] of the nodes.
    """
    nodes, parameters, d = grid.tables.contact, problem.laws[1], min(3, problem.nc)
    radius, stiffness, width, damping = parameters[CONTACT, :4]
    u, basis = nodes.u[part], np.zeros((part.stop - part.start, grid.n_u))
    np.put_along_axis(basis, nodes.first[part, None] + np.arange(4), nodes.b0[part], axis=1)

    def places(states: Floats) -> Floats:
        x = np.zeros((len(states), len(u), 3))
        x[..., :d] = basis @ states[..., :d]
        return x

    def gaps(x: Floats) -> Floats:
        if row == TABLE:
            return np.asarray(x[:, 2] - parameters[TABLE, 0])
        return np.asarray(distances(parameters[row : row + 1], np.ascontiguousarray(x)))[:, 0] - radius

    now, step = places(window.states[at]), np.maximum(at, 1)  # the first step is that of both its ends
    speed = places(window.states[step] - window.states[step - 1]) / np.diff(window.times)[step - 1, None, None]
    of = np.arange(len(u)) // _STRIDE
    some = np.minimum(_STRIDE * np.unique(of) + _STRIDE // 2, len(u) - 1)
    nearest = gaps(now[:, some].reshape(-1, 3)).reshape(len(at), -1)
    # a gap grows at most as fast as one goes along the cable
    k, n = np.nonzero(nearest[:, of] < _LONGER * np.abs(u - u[some][of]))
    depth = -gaps(now[k, n])
    k, n, depth = k[depth > 0.0], n[depth > 0.0], depth[depth > 0.0]
    normal = np.stack([gaps(now[k, n] + way) + depth for way in _SIDE * width * np.eye(3)], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    leaving = np.einsum("nd,nd->n", speed[k, n], normal)
    pressure = normal_forces(stiffness, width, damping, depth, leaving) * weights[k, n]
    force, pressed = np.zeros((len(at), 3)), np.zeros(len(at))
    np.add.at(force, k, pressure[:, None] * normal)
    np.add.at(pressed, k, pressure)
    return problem.plane.world_vectors(force[:, :d]), pressed
