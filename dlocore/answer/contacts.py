"""Normal and friction forces of table and obstacles on the cable over time, with error estimates."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Literal, NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from dlocore.answer.compared import Series, errors, parts_of
from dlocore.answer.parts import ContactForce
from dlocore.answer.reactions import WindowForces, Windows
from dlocore.effects.contact import normal_forces
from dlocore.effects.distance import distances
from dlocore.effects.friction import friction_forces
from dlocore.effects.laws import CONTACT, COUNT, FRICTION, TABLE
from dlocore.kernels.contact import follow
from dlocore.problem.grid import Grid
from dlocore.problem.problem import Problem
from dlocore.scene.scene import Scene

Floats = NDArray[np.float64]
Indices = NDArray[np.int64]

CONTACT_TIMES = 129  # about the most times at which contact is evaluated
_NEAR = 0.05  # of the length: obstacles of two scenes that lie closer are the same one, moved
_AT_ONCE = 1_000_000  # nodes evaluated together, over all times
_STRIDE = 16  # one in so many nodes is evaluated first
_LONGER = 1.1  # largest stretched length of the cable, over its length
_SWINGS = 2.0  # in which a cable that was not pressed against what it lies on comes to rest there
_SIDE = 0.01  # of the depth at which contact reaches its full stiffness: step for finding normals


def contact_forces(problem: Problem, grid: Grid, windows: Windows, marched: bool = True) -> tuple[ContactForce, ...]:
    """Return the forces of the table and of every obstacle that was simulated on the cable.

    They are the sums of N n ds and of f ds over the nodes of contact, with N of docs/model.md eq. 21, f of eq. 22, and
    the velocity of a node over the step that ends with a state. The table always carries a cable that is solved in the
    plane of the table. For the states of a least squares (`marched` False) all nodes act, and friction depends on their
    speed.

    Args:
        problem: as it was marched, see `Level.marched`.
        grid: grid with the contact nodes.
        windows: stretches between events.
        marched: whether the states are those of a march.
    """
    kept = _kept([len(window.times) for window in windows])
    times = np.concatenate([window.times[at] for window, at in zip(windows, kept, strict=True)])
    found: list[ContactForce] = []
    if not (problem.on_table or problem.contact):
        return ()
    behind = _behind(problem, grid, windows, kept) if marched else _nothing_behind(grid, kept)
    if problem.on_table:
        carried = np.tile([0.0, 0.0, _weight_on_table(problem.scene)], (len(times), 1))
        rubs = [_lying(problem, grid, *one, marched) for one in zip(windows, kept, behind, strict=True)]
        found.append(ContactForce("table", times, carried, np.concatenate(rubs), carried[:, 2]))
    if problem.contact is None:
        return tuple(found)
    nodes = grid.tables.contact
    met = [] if nodes.table_nodes == 0 else [("table", slice(0, nodes.table_nodes), TABLE)]
    numbered = enumerate(problem.scene.environment.obstacles)  # those simulated are some of these, in the same order
    for i, obstacle in enumerate(problem.obstacles):
        number = next(number for number, other in numbered if other is obstacle)
        met.append((f"obstacles[{number}]", slice(nodes.table_nodes, len(nodes.u)), COUNT + i))
    for name, part, row in met:
        parts = [
            _pressed(problem, grid, window, at[some], part, row, past.of(some), marched)
            for window, at, past in zip(windows, kept, behind, strict=True)
            for some in np.array_split(np.arange(len(at)), -(-len(at) * (part.stop - part.start) // _AT_ONCE))
        ]
        found.append(ContactForce(name, times, *(np.concatenate(values) for values in zip(*parts, strict=True))))
    return tuple(found)


def with_contact_errors(
    found: tuple[ContactForce, ...], problem: Problem, windows: Windows, beside: Sequence[tuple[Problem, Grid, Windows]]
) -> tuple[ContactForce, ...]:
    """Return contact forces with error estimates, from those of the same motion marched on other grids.

    Args:
        found: the contact forces in the `windows`.
        problem: as it was marched.
        windows: stretches between events.
        beside: problem, grid and windows of each other march.
    """
    others = [(force, w) for problem, grid, w in beside for force in contact_forces(problem, grid, w)]

    def error(own: ContactForce, kind: Literal["force", "friction"]) -> Floats | None:
        def series(of: ContactForce, windows: Windows) -> Series:
            return Series(
                of.times, parts_of([len(at) for at in _kept([len(w.times) for w in windows])]), getattr(of, kind)
            )

        known = errors(series(own, windows), [series(*other) for other in others if other[0].name == own.name])
        return None if known is None else _until_it_rests(problem, own.times, getattr(own, kind), known)

    return tuple(replace(own, force_error=error(own, "force"), friction_error=error(own, "friction")) for own in found)


def _until_it_rests(problem: Problem, times: Floats, values: Floats, known: Floats) -> Floats:
    """Return the errors (k,) of forces (k, 3) at `times` [s]: those `known` from grids, raised until the cable rests.

    A cable that lies on an obstacle when the motion begins is not yet pressed against it, on any grid. It swings on the
    contact as on a spring, until the force is what it should have been from the beginning. Until then the error of a
    force is its largest distance to the later ones, where the error of the last one is added to the distance to it.
    """
    if problem.contact is None:
        return known
    swing = 2.0 * np.pi * np.sqrt(problem.contact.linear_density / problem.contact.stiffness)
    last = min(max(1, int(np.searchsorted(times, times[0] + _SWINGS * swing))), len(times) - 1)
    apart = np.linalg.norm(values[:last, None] - values[: last + 1], axis=2)
    swung = np.maximum(np.triu(apart).max(axis=1), apart[:, -1] + known[last])
    return np.concatenate([np.maximum(known[:last], swung), known[last:]])


def contacts_taken_on(
    found: tuple[ContactForce, ...], scene: Scene, judged: tuple[ContactForce, ...], like: Scene
) -> tuple[ContactForce, ...]:
    """Return contact forces of a scene with the error estimates of a similar scene, `like`, as far as it has them.

    An obstacle gets those of an obstacle of the same kind whose place and size differ by less than _NEAR of the
    length, whatever its number.
    """
    near, here, there = _NEAR * scene.cable.length, _rows(scene), _rows(like)
    errs = {force.name: force for force in judged}

    def judged_as(own: ContactForce) -> ContactForce | None:
        if own.name not in here:
            return errs.get(own.name)
        row = here[own.name]
        alike = (name for name, other in there.items() if other[0] == row[0] and np.abs(other - row).max() <= near)
        return next((errs[name] for name in alike if name in errs), None)

    def error(own: ContactForce, of: ContactForce, values: Floats | None) -> Floats | None:
        return None if values is None else np.interp(own.times, of.times, values)

    return tuple(
        own
        if (of := judged_as(own)) is None
        else replace(
            own,
            force_error=error(own, of, of.force_error),
            friction_error=error(own, of, of.friction_error),
        )
        for own in found
    )


def _rows(scene: Scene) -> dict[str, Floats]:
    """Return the rows of the obstacles of a scene, by the names of their contact forces."""
    return {f"obstacles[{i}]": obstacle.row() for i, obstacle in enumerate(scene.environment.obstacles)}


def _kept(lengths: Sequence[int]) -> list[Indices]:
    """Return the indices of the times to evaluate in windows of these lengths: their ends, and evenly many between."""
    share = min(1.0, CONTACT_TIMES / sum(lengths))
    return [np.unique(np.linspace(0, n - 1, max(2, round(share * n))).round().astype(int)) for n in lengths]


def _weight_on_table(scene: Scene) -> float:
    """Return the weight [N] with which a cable lies on the table."""
    return scene.cable.mass * abs(float(cast(Floats, scene.environment.gravity)[2]))


class _Behind(NamedTuple):
    """History of some states, at the beginning of the steps that end with them.

    Attributes:
        weights: (k, contact nodes) [m], of the nodes in that step: one node of a cell may stand for all of it.
        stick: (k, contact nodes, 3) anchors of friction [m]; (k, 0, 3) without friction.
        slide: (k, lying points, 2) anchors of a cable that lies on the table [m]; (k, 0, 2) without.
    """

    weights: Floats
    stick: Floats
    slide: Floats

    def of(self, some: Indices) -> "_Behind":
        """Return the history of some of the states."""
        return _Behind(*(values[some] for values in self))


def _nothing_behind(grid: Grid, kept: Sequence[Indices]) -> list[_Behind]:
    """Return the history of states in each window if no march led to them: all nodes act."""
    w = grid.tables.contact.w
    return [
        _Behind(np.broadcast_to(w, (len(at), len(w))), np.empty((len(at), 0, 3)), np.empty((len(at), 0, 2)))
        for at in kept
    ]


def _behind(problem: Problem, grid: Grid, windows: Windows, kept: Sequence[Indices]) -> list[_Behind]:
    """Return the history of the states `kept` of each window of a march.

    Which nodes act depends only on where the cable was when a step began. The anchors of friction depend on its whole
    motion in the window.
    """
    if problem.friction is None and grid.tables.contact.cell == 1:
        return _nothing_behind(grid, kept)
    history, found = grid.past(), []
    for window, at in zip(windows, kept, strict=True):
        if window.anchors is not None:
            history.stick[:], history.slide[:] = window.anchors
        states, before = window.states, np.maximum(at - 1, 0)
        if problem.friction is None:
            states, before = states[before], np.arange(len(at))
        past = _Behind(*(np.empty((len(at), *x.shape)) for x in (history.pressing, history.stick, history.slide)))
        follow(problem.nc, np.ascontiguousarray(states), before, grid.tables, *problem.laws, history, *past)
        found.append(past)
    return found


def _basis(n_u: int, first: Indices, b0: Floats) -> Floats:
    """Return the basis functions (k, n_u), of which four, b0 (k, 4) from `first` (k,) on, are not zero."""
    basis = np.zeros((len(first), n_u))
    np.put_along_axis(basis, first[:, None] + np.arange(4), b0, axis=1)
    return basis


def _sums(k: Indices, vectors: Floats, count: int) -> Floats:
    """Return the sums (count, 3) of vectors (n, 3), grouped by the indices k (n,)."""
    return np.column_stack([np.bincount(k, component, count) for component in vectors.T])


def _speeds(window: WindowForces, at: Indices) -> Floats:
    """Return the velocities of control points (k, n_u, nc) [m/s] over the steps that end with the states `at`."""
    step = np.maximum(at, 1)  # the first state has that of the first step, too
    return np.asarray((window.states[step] - window.states[step - 1]) / np.diff(window.times)[step - 1, None, None])


def _lying(problem: Problem, grid: Grid, window: WindowForces, at: Indices, behind: _Behind, marched: bool) -> Floats:
    """Return the friction (k, 3) [N] of the table on a cable that moves in its plane, in world coordinates."""
    points, parameters = grid.tables.lying, problem.laws[1]
    if problem.friction is None or problem.friction.lying == 0.0:
        return np.zeros((len(at), 3))
    over = _basis(grid.n_u, points.first, points.b0)
    slip, speed = np.zeros((2, len(at), len(over), 3))
    speed[..., :2] = over @ _speeds(window, at)
    if marched:
        slip[..., :2] = over @ window.states[at] - behind.slide
    slip, speed, rough = slip.reshape(-1, 3), speed.reshape(-1, 3), parameters[FRICTION]
    limit, up = np.full(len(slip), problem.friction.lying), np.broadcast_to([0.0, 0.0, 1.0], slip.shape)
    rub = friction_forces(limit, up, slip, speed, rough[0], rough[1], marched)
    force = np.einsum("p,kpd->kd", points.w, rub.reshape(len(at), -1, 3))
    return problem.plane.world_vectors(force[:, :2])


def _pressed(
    problem: Problem,
    grid: Grid,
    window: WindowForces,
    at: Indices,
    part: slice,
    row: int,
    behind: _Behind,
    marched: bool,
) -> tuple[Floats, Floats, Floats]:
    """Return normal force and friction (k, 3) [N] of the table or one obstacle, and the sum of magnitudes (k,) [N].

    The forces are in world coordinates; the magnitudes are those of the normal forces.

    Args:
        problem: the problem as it was marched.
        grid: grid with the contact nodes.
        window: states between two events.
        at: indices of some of them (k,).
        part: the nodes that may touch the object.
        row: row of the object in the parameters of the laws.
        behind: history of the states.
        marched: whether friction depends on the displacement from anchors; otherwise on the speed.
    """
    nodes, (active, parameters), d = grid.tables.contact, problem.laws, min(3, problem.nc)
    radius, stiffness, width, damping = parameters[CONTACT, :4]
    u, basis = nodes.u[part], _basis(grid.n_u, nodes.first[part], nodes.b0[part])

    def places(states: Floats) -> Floats:
        x = np.zeros((len(states), len(u), 3))
        x[..., :d] = basis @ states[..., :d]
        return x

    def gaps(x: Floats) -> Floats:
        if row == TABLE:
            return np.asarray(x[:, 2] - parameters[TABLE, 0])
        return np.asarray(distances(parameters[row : row + 1], np.ascontiguousarray(x)))[:, 0] - radius

    now, speed = places(window.states[at]), places(_speeds(window, at))
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
    weights = behind.weights[:, part][k, n]
    pressure = normal_forces(stiffness, width, damping, depth, leaving)
    force, rubs = _sums(k, (weights * pressure)[:, None] * normal, len(at)), np.zeros((len(at), 3))
    pressed = np.asarray(np.bincount(k, weights * pressure, len(at)), dtype=float)
    if active[FRICTION]:
        limit = parameters[row, 1 if row == TABLE else 16] * pressure
        slip = now[k, n] - behind.stick[:, part][k, n] if marched else np.zeros_like(normal)
        rough = parameters[FRICTION]
        rub = friction_forces(limit, normal, slip, speed[k, n], rough[0], rough[1], marched)
        rubs = _sums(k, weights[:, None] * rub, len(at))
    return problem.plane.world_vectors(force[:, :d]), problem.plane.world_vectors(rubs[:, :d]), pressed
