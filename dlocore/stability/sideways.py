"""Whether a planar motion stays in its plane: whether a disturbance out of it would grow."""

import math
from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import pairwise
from typing import cast

import numpy as np
from numpy.typing import NDArray

from dlocore.effects import laws
from dlocore.kernels.across import stiffness_across
from dlocore.kernels.assembly import NO_RATES, History, assemble
from dlocore.kernels.banded import factor
from dlocore.kernels.basis import basis_rows
from dlocore.kernels.growth import LOOKS, looked_at
from dlocore.kernels.twisted import start_frames
from dlocore.problem.buckling import BOW, GROWTH, UNSTABLE
from dlocore.problem.discretisation import grid_on, plane_curvature_of
from dlocore.problem.events import closed_grasps
from dlocore.problem.grid import Grid
from dlocore.problem.problem import Problem, pose
from dlocore.scene.scene import Grasp, Scene
from dlocore.solvers.bands import dense_of
from dlocore.solvers.march import March
from dlocore.stability.determined import bend_of

Floats = NDArray[np.float64]

_FLAT = 1e-2  # of the length: a motion this near to a plane counts as planar, up to what rounding grows to
_STRAIGHT = 1e-2  # of the length: a start no farther from a line buckles within some steps if it is pushed
_LOOKS_AT_STRAIGHT = 64  # states of its motion that are checked, at least
_NEUTRAL = 1e-4  # of what bends a cable and weighs on it: a stiffness this small may be zero for a start at rest
_ROUNDING = 1e-13  # of the largest stiffness: a smaller one is rounding
_COLUMN, _BELOW = np.array([(j, o) for j in range(4) for o in range(4 - j)]).T  # of a lower triangle (4, 4)
WITH_TWIST = "with effects.twist on or auto"  # a way to let a motion leave its plane
_FIRM = 1e6  # times the largest stiffness: the springs that keep held parts in the plane


def leaves_plane(problem: Problem, motion: March) -> bool:
    """Tell whether a disturbance out of the plane of a motion would grow tenfold during the motion.

    This includes a start that has settled on an equilibrium that a cable free to leave the plane does not have.
    """
    grid = motion.grid
    if not (_bends_in_plane(problem) or _may_lie_flat(problem)):
        return False
    if problem.scene.shape.settle and is_unstable(problem, grid, grid.start, 0.0, grid.past()):
        return True
    looks = looked_at(len(motion.times) - 1, _LOOKS_AT_STRAIGHT if bend_of(problem.start) < _STRAIGHT else LOOKS)
    density, drag = problem.scene.cable.linear_density, problem.drag_coefficient()
    slowest = GROWTH / problem.horizon  # [1/s]: rate of growth that matters
    slack = density * slowest**2 + drag * slowest
    times, states = motion.times[looks], motion.states[looks]
    leasts = _leasts(problem, grid, states, times.tolist(), motion.behind(times), slack)
    rates = sum((math.sqrt(drag**2 - 4.0 * density * min(least, 0.0)) - drag) / (2.0 * density) for least in leasts)
    # a straight cable may buckle to any side: until it has, disturbances to all sides grow alike
    both = math.log(1.0 / BOW) if problem.start.bow else 0.0
    return rates / len(looks) * problem.horizon > GROWTH + both


def _leasts(
    problem: Problem, grid: Grid, states: Floats, times: list[float], behind: History, slack: float
) -> Iterator[float]:
    """Yield the least stiffness [N/m^2] against leaving the plane, of states (k, n, nc) where it is below -slack.

    Their history, `behind`, is a `History` with arrays (1 or k, ...).
    """
    if _bends_in_plane(problem):
        leasts = _leasts_of_lying if _is_weighed_down(problem) else _leasts_of_bent
        bends = behind.memory[..., 0]
        yield from leasts(problem, grid, states, times, np.broadcast_to(bends, (len(times), bends.shape[1])), slack)
        return
    flat = _in_plane(problem, states)
    if len(flat) == 0:
        return
    states, times = states[: len(flat)], times[: len(flat)]
    if not is_looked_at(problem):
        yield from _leasts_of_turning(problem, grid, states, times, behind, slack)
        return
    bands, unit = _bands(problem, grid, states, flat)
    for t, q, band in zip(times, flat, bands, strict=True):
        held = closed_grasps(problem.scene, t, t)
        stiff, allowed = band + _held_band(grid, held, _firm(band)), _allowed(slack, band, unit)
        if factor(stiff + allowed * unit) >= 0:
            least = _least(dense_of(stiff) + _twisting(problem, grid, q, held), dense_of(unit))
            if least < -allowed:
                yield least


def _allowed(slack: float, stiff: Floats, unit: Floats) -> float:
    """Return the slack, or the rounding of zero stiffness if that is larger, for a matrix and a unit, or bands."""
    return max(slack, _ROUNDING * float(np.abs(stiff).max()) / float(unit.max()))


def _firm(stiff: Floats) -> float:
    """Return the stiffness of springs that are firm compared with a stiffness, given as a matrix or its bands."""
    return _FIRM * float(np.abs(stiff).max())


def may_leave_plane(problem: Problem) -> bool:
    """Tell whether `leaves_plane` can judge a motion, apart from what the cable may touch on its way."""
    return _bends_in_plane(problem) or not (problem.on_table or problem.rest_plane.dimensions == 3)


def lacks_twist(problem: Problem) -> bool:
    """Tell whether a cable that is bent when stress-free can't leave its plane because the scene switches twist off."""
    return problem.scene.effects.get("twist", "auto") == "off" and _bends_in_plane(problem)


def solved_in_space(ways: list[str]) -> str:
    """Return a message that a motion is kept in a plane that it would leave, with the ways to let it leave."""
    return f"{UNSTABLE}: {' and '.join(ways)} it is solved in space"


def _bends_in_plane(problem: Problem) -> bool:
    """Tell whether a cable that is bent when stress-free moves in a plane that it may leave, or turn over in."""
    return _may_be_bent(problem) and problem.plane.dimensions == 2 and not problem.start.twisted


def _may_lie_flat(problem: Problem) -> bool:
    """Tell whether a cable that may leave its plane has one, even if it is solved in space."""
    leaves = is_looked_at(problem) or _turns_in_plane(problem)
    return leaves and (problem.plane.dimensions == 2 or problem.rest_plane.dimensions == 2)


def _turns_in_plane(problem: Problem) -> bool:
    """Tell whether a cable that is bent when stress-free is solved in space with twist but may lie flat."""
    start = problem.start
    return _may_be_bent(problem) and problem.nc == 4 and not (start.aside or start.twisted)


def _may_be_bent(problem: Problem) -> bool:
    """Tell whether the cable may have stress-free bends: by its shape, by yielding, or from an earlier motion."""
    rest = problem.scene.cable.rest_shape
    bent = not isinstance(rest, str) or rest != "straight"
    return bent or problem.start.material is not None or problem.bending_memory is not None


def _leasts_of_bent(
    problem: Problem, grid: Grid, states: Floats, times: list[float], bends: Floats, slack: float
) -> Iterator[float]:
    """Do what `_leasts` does for a cable that is bent when stress-free: its sections turn as it leaves the plane.

    The stiffness is that of the motion in space with twist, evaluated in the planar states, against displacements out
    of the plane and turns of the sections.
    """
    elastic = {**problem.scene.effects, "twist": "on", "plasticity": "off"}
    posed = pose(replace(problem.scene, effects=elastic), problem.called_for)
    space = grid_on(posed, grid.knots)
    history, normal = space.past(), np.cross(*problem.plane.axes)
    history.memory[:] = 0.0
    for t, flat, natural in zip(times, states, bends, strict=True):
        q = np.zeros((grid.n_u, posed.nc))
        q[:, :3] = posed.plane.points(problem.plane.world(flat))
        # in a plane, the sections turn with the tangent
        across = np.cross(normal, space.at(q, 0.0, 1)[:3])
        start_frames(grid.knots, q, space.tables.curvature, across / np.linalg.norm(across), history.past)
        history.memory[:, 0] = natural
        yield from _turned(posed, space, q, t, normal, history, posed.law_table(), slack)


def _leasts_of_turning(
    problem: Problem, grid: Grid, states: Floats, times: list[float], behind: History, slack: float
) -> Iterator[float]:
    """Do what `_leasts_of_bent` does for a cable solved in space with twist: its frames give the section angles.

    A small disturbance does not make anything yield. A cable that rubs on what it is pressed against does not slip off
    it.
    """
    active, parameters = problem.law_table()
    active[[laws.BENDING_MEMORY, laws.TWIST_MEMORY, laws.STRETCH_MEMORY, laws.SELF_CONTACT, laws.FRICTION]] = 0
    if problem.friction is not None:
        parameters = parameters[: laws.COUNT]
    normal = np.cross(*problem.rest_plane.axes)
    for k, (t, q) in enumerate(zip(times, states, strict=True)):
        memory, past, axial = (x[min(k, len(x) - 1)] for x in (behind.memory, behind.past, behind.axial))
        history = behind._replace(memory=memory, past=past, axial=axial)
        yield from _turned(problem, grid, q, t, normal, history, (active, parameters), slack)


def _turned(
    problem: Problem, grid: Grid, q: Floats, t: float, normal: Floats, history: History,
    law_table: tuple[NDArray[np.int64], Floats], slack: float,
) -> Iterator[float]:  # fmt: skip
    """Yield the least stiffness of a state (n, 4) against displacements along a normal (3,) and turns, if negative."""
    n, nc = grid.n_u, problem.nc
    away = np.zeros((2, nc))
    away[0, :3], away[1, 3] = normal, 1.0
    unit: Floats = np.kron(dense_of(grid.tables.inertia), np.eye(2)).astype(np.float64)
    f, K, still = np.empty((n, nc)), np.empty((n * nc, 4 * nc)), np.zeros((n, nc))
    assemble(problem.axes, q, still, grid.tables, *law_table, history, NO_RATES, (1.0, 0.0, 1.0), f, K)
    stiff = np.einsum("xa,iajb,yb->ixjy", away, dense_of(K).reshape(n, nc, n, nc), away)
    held = closed_grasps(problem.scene, t, t)
    firm, allowed = _firm(stiff), _allowed(slack, stiff, unit)
    stiff[:, 0, :, 0] += dense_of(_held_band(grid, held, firm))
    stiff[:, 1, :, 1] += dense_of(_held_band(grid, [g for g in held if g.hold == "clamp"], firm, direction=False))
    whole = stiff.reshape(2 * n, 2 * n)
    try:
        np.linalg.cholesky(whole + allowed * unit)
    except np.linalg.LinAlgError:
        yield _least(whole, unit)


def _is_weighed_down(problem: Problem) -> bool:
    """Tell whether weight holds the cable on a table, against any small displacement off it."""
    return problem.on_table and bool(cast(Floats, problem.scene.environment.gravity)[2] < 0.0)


def _leasts_of_lying(
    problem: Problem, grid: Grid, states: Floats, times: list[float], bends: Floats, slack: float
) -> Iterator[float]:
    """Do what `_leasts` does for a cable that is bent when stress-free and lies on a table: its sections may turn over.

    The energy of turns p of the sections is half the integral of EI kappa kappa_0 p^2 + GJ p'^2: the stress-free bend
    kappa_0 turns with them. As elsewhere, p counts as the displacement D/sqrt(8) p.
    """
    cable, tables = problem.scene.cable, grid.tables
    first, basis = basis_rows(grid.knots, tables.curvature.u, 1)
    scale = 8.0 / cable.diameter**2 * tables.curvature.w[:, None]
    twists = scale * cast(float, cable.torsional_stiffness) * _products(basis[:, 1])
    for t, q, natural in zip(times, states, bends, strict=True):
        turning = cast(float, cable.bending_stiffness) * plane_curvature_of(tables, q)[:, 0] * natural
        if turning.min() >= 0.0:
            continue
        stiff = np.zeros((grid.n_u, 4))
        added = twists + scale * turning[:, None] * _products(basis[:, 0])
        np.add.at(stiff, (first[:, None] + _COLUMN, _BELOW), added)
        clamps = [g for g in closed_grasps(problem.scene, t, t) if g.hold == "clamp"]
        allowed = _allowed(slack, stiff, tables.inertia)
        stiff += _held_band(grid, clamps, _firm(stiff), direction=False)
        if factor(stiff + allowed * tables.inertia) >= 0:
            yield _least(dense_of(stiff), dense_of(tables.inertia))


def _products(rows: Floats) -> Floats:
    """Return the products (k, 10) of the four values of each row (k, 4), in the order of a lower band."""
    return np.asarray(rows[:, _COLUMN] * rows[:, _COLUMN + _BELOW])


def is_unstable(problem: Problem, grid: Grid, q: Floats, t: float, history: History) -> bool:
    """Tell whether control points q (n, nc) at rest at a time t [s] would leave their plane, as in `leaves_plane`."""
    slack = _NEUTRAL * problem.stiffness_aside()
    return any(True for _ in _leasts(problem, grid, q[None], [t], of_one_time(history), slack))


def of_one_time(history: History) -> History:
    """Return a history with the arrays (1, ...) of one time."""
    return history._replace(memory=history.memory[None], past=history.past[None], axial=history.axial[None])


def is_looked_at(problem: Problem) -> bool:
    """Tell whether the stiffness across the plane is that of a cable straight when stress-free that may leave it."""
    start = problem.start
    return not (problem.on_table or _may_be_bent(problem) or start.aside or start.twisted)


def _in_plane(problem: Problem, states: Floats) -> Floats:
    """Return the coordinates (m, n, 2) of states (k, n, nc) in their plane, until they leave it: m = 0 to k.

    m is 0 if there is no plane or they can't leave it, as on a table.
    """
    if not _may_lie_flat(problem):
        return states[:0]
    if problem.plane.dimensions == 2:
        return states
    plane, r = problem.rest_plane, problem.plane.world(states[..., :3])
    flat = plane.points(r)
    away = np.abs(r - plane.world(flat)).max(axis=(1, 2)) > _FLAT * problem.scene.cable.length
    return flat[: int(np.argmax(away)) if away.any() else len(flat)]


def pose_as_shown(scene: Scene, called_for: Mapping[str, str], control_points: Floats) -> Problem:
    """Return the problem of a motion with control points (n_t, n_u, 4) [m, rad].

    Its start is bowed out of its plane if they begin so, and it may leave a table if its sections turn.
    """
    problem = pose(scene, called_for)
    if problem.on_table:
        shown = bool(control_points[..., 3].any())
    else:
        plane = problem.rest_plane  # in space, nothing is off it
        off = 0.1 * BOW**2 * scene.cable.length + 2.0 * plane.distance(problem.start.control_points)
        shown = plane.dimensions == 2 and plane.distance(control_points[0, :, :3]) > off
    return pose(scene, {**called_for, "side": UNSTABLE}) if shown else problem


def _bands(problem: Problem, grid: Grid, states: Floats, flat: Floats) -> tuple[Floats, Floats]:
    """Return the stiffness of states (k, n, nc) against leaving their plane, and the unit matrix, as lower bands.

    `flat` (k, n, 2) are their coordinates in the plane.
    """
    return _elastic(problem, grid, flat) + slipping_across(problem, grid, states), grid.tables.inertia


def _elastic(problem: Problem, grid: Grid, flat: Floats) -> Floats:
    """Return the stiffness of bends and tension (k, n, 4) of states (k, n, 2) against leaving their plane."""
    cable, tables = problem.scene.cable, grid.tables
    moduli = cast(float, cable.bending_stiffness), cast(float, cable.axial_stiffness)
    if not problem.start.bow:
        return np.asarray(stiffness_across(np.ascontiguousarray(flat), tables, *moduli))
    # sections that turn with the bend kappa take its stress-free bend along: the moment is then EI |kappa - natural|
    natural = np.linalg.norm(grid.history.memory[:, grid.history.memory.shape[1] // 2 :], axis=1)
    bands = []
    for q in flat:
        kappa = np.abs(plane_curvature_of(tables, q)[:, 0])
        share = 1.0 - np.minimum(natural / np.maximum(kappa, 1e-300), 1.0)
        weighed = tables._replace(curvature=tables.curvature._replace(w=share * tables.curvature.w))
        bands.append(stiffness_across(q[None].copy(), weighed, *moduli))
    return np.concatenate(bands)


def slipping_across(problem: Problem, grid: Grid, states: Floats) -> Floats:
    """Return what obstacles add to the stiffness of states (k, n, nc): lower bands (k, n, 4), negative on round ones.

    A cable pressed with force N against a surface that is round across the plane, where the distance has curvature H,
    slips off to the side: the stiffness is -N H. If it rubs, it is held.
    """
    bands = np.zeros((*states.shape[:2], 4))
    if problem.plane.dimensions == 2 or not problem.obstacles or problem.friction is not None:
        return bands
    normal = np.cross(*problem.rest_plane.axes)
    active, parameters = problem.law_table()
    active[[row for row in range(laws.COUNT) if row != laws.CONTACT]] = 0
    parameters[[laws.STRETCH, laws.TWIST], 0] = 0.0
    nc = problem.nc
    f, K = np.empty(states.shape[1:]), np.empty((states.shape[1] * nc, 4 * nc))
    for q, band in zip(states, bands, strict=True):
        still = np.zeros_like(q)
        assemble(problem.axes, q, still, grid.tables, active, parameters, grid.history, NO_RATES, (1.0, 0.0, 1.0), f, K)
        for m in range(4):  # the block of control points k + m and k, a row of K for each column
            for a in range(3):
                for b in range(3):
                    i, j = (a, b) if m > 0 or a >= b else (b, a)
                    band[:, m] += normal[a] * normal[b] * K[j::nc, nc * m + i - j]
    return bands


def _held_band(grid: Grid, held: list[Grasp], stiffness: float, direction: bool = True) -> Floats:
    """Return springs that keep grasps, and held directions, in the plane: a lower band (n, 4)."""
    band = np.zeros((grid.n_u, 4))
    for grasp in held:
        first, table = basis_rows(grid.knots, np.array([grasp.u]), 1)
        for b in table[0, : 1 if grasp.hold == "point" or not direction else 2]:
            band[first[0] + _COLUMN, _BELOW] += stiffness / (b @ b) * b[_COLUMN] * b[_COLUMN + _BELOW]
    return band


def _twisting(problem: Problem, grid: Grid, q: Floats, held: list[Grasp]) -> Floats:
    """Return the stiffness (n, n) that clamps add because they keep the sections between them from turning.

    A displacement w out of the plane twists a cable of curvature kappa by kappa w' per length. Spread evenly over the
    length l between two clamps, this takes the energy GJ/(2 l) (integral of kappa w')^2.
    """
    tables, added = grid.tables, np.zeros((len(q), len(q)))
    clamps = sorted(g.u for g in held if g.hold == "clamp")
    if len(clamps) < 2:
        return added
    at = tables.curvature.first[:, None] + np.arange(4)
    turns = tables.curvature.w[:, None] * plane_curvature_of(tables, q) * tables.curvature.b1
    for begin, end in pairwise(clamps):
        between = (tables.curvature.u > begin) & (tables.curvature.u < end)
        g = np.zeros(len(q))
        np.add.at(g, at[between], turns[between])
        added += cast(float, problem.scene.cable.torsional_stiffness) / (end - begin) * np.outer(g, g)
    return added


def _least(stiff: Floats, unit: Floats) -> float:
    """Return the least eigenvalue k [N/m^2] of K w = k U w, of a stiffness and U, both (n, n)."""
    root = np.linalg.cholesky(unit)
    inner = np.linalg.solve(root, np.linalg.solve(root, stiff).T)
    return float(np.linalg.eigvalsh(inner)[0])
