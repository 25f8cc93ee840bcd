"""A grid for a problem: knots, basis tables, the start and its history, and applied forces."""

from dataclasses import replace
from functools import partial
from typing import cast

import numpy as np
from numpy.typing import NDArray

from dlocore.effects import laws
from dlocore.errors import SceneError
from dlocore.kernels import space, twisted_rows
from dlocore.kernels.assembly import MEMORY_IN_PLANE, MEMORY_IN_SPACE, PAST_IN_PLANE, PAST_IN_SPACE, History
from dlocore.kernels.basis import GAUSS_2, GAUSS_3, GAUSS_4, Tables, build_tables, graded_knots
from dlocore.kernels.entry import remember_start
from dlocore.kernels.relax import relax
from dlocore.kernels.tension import COLUMNS
from dlocore.kernels.twisted import start_frames
from dlocore.kernels.twisted_rows import DIRECTOR, PAST
from dlocore.problem.features import LASTING, OPENING, find_features, free_ends
from dlocore.problem.grid import Grid
from dlocore.problem.holding import Starts, close_grasps, hold
from dlocore.problem.plane import leftwards, turned_about
from dlocore.problem.problem import Problem
from dlocore.problem.squeezed import in_long_waves, is_squeezed
from dlocore.problem.tension import at_points
from dlocore.scene.paths import Waypoints
from dlocore.scene.scene import Material
from dlocore.shape.shape import SplineCurve, fit_to_knots, rest_curve, spin_to_knots, velocity_to_knots
from dlocore.spline import DEGREE, spline_at

Floats = NDArray[np.float64]

# Knots are graded towards a sharp bend of the start, because the corner would be a different one on every grid. A bend
# is sharp if the start turns by SHARP [rad] within BEND of the length to either side, many times as much as elsewhere.
SHARP = 0.8
BEND = 0.02
_ELSEWHERE = 4.0  # times the median curvature
_WIDE = 2.2  # times BEND: a wider one is a wide bend, not a corner widened by the window
_PLACES = 501  # along the start at which bends are looked for
_REACH = round(BEND * (_PLACES - 1))  # places of the window to either side
_MOST_CORNERS = 4
_ROUNDING = 1e-9  # of the memory: a smaller change is not yielding
_THREE = ((0, 1, 2), (1, 2, 0), (2, 0, 1))
_LYING = 2.0  # times the depth at which contact bears the weight: a lying cable is deeper beside a part that is lifted
_APART = 0.25 * BEND  # of the length: features nearer to a sharp bend share its knot


def smallest_n_u(problem: Problem) -> int:
    """Return the least number of control points with which there is a knot at every grasp, load and point mass."""
    return problem.features.least


def too_few(problem: Problem, n_u: int) -> SceneError:
    """Return the error for fewer control points than `smallest_n_u`."""
    features = problem.features
    knots = features.multiplicity[(features.u > 0.0) & (features.u < problem.scene.cable.length)].sum()
    reason = (
        f"Grasps, loads and point masses need {knots} knots inside the cable (two for a grasp that holds a direction)"
    )
    return SceneError("quality.n_u", n_u, f"at least {smallest_n_u(problem)} in this scene", reason)


def make_grid(problem: Problem, n_u: int) -> Grid:
    """Return the grid of `n_u` control points for a problem, with the start shape on it.

    Raises:
        SceneError: n_u is too small for the knots that the grasps and loads need.
    """
    scene, length = problem.scene, problem.scene.cable.length
    bends, apart = corners(problem.start, length), _APART * length
    grading = OPENING if problem.twist is None or problem.rests_straight else LASTING
    # if there is no room for all: without sharp bends, else without kinks of the angle, else without both
    for kinks in (True, False) if problem.twist is not None else (False,):
        for sharp in (bends, []) if bends else ([],):
            features = find_features(scene, sharp, grading, apart, kinks) if sharp or kinks else problem.features
            if n_u >= features.least:
                return grid_on(problem, graded_knots(n_u, length, *features[:4]))
    raise too_few(problem, n_u)


def grid_on(problem: Problem, knots: Floats) -> Grid:
    """Return the grid of a problem on given knots (n_u + 4,) [m], with the start shape on it."""
    curve = problem.start
    theta = None if curve.theta is None else fit_to_knots(curve.theta, knots)[:, 0]
    start = np.ascontiguousarray(problem.coordinates(fit_to_knots(curve, knots), theta))
    given = velocity_to_knots(curve, knots)
    spin = None if problem.twist is None else spin_to_knots(curve, knots)
    velocity = np.zeros(start.shape) if given is None else np.ascontiguousarray(problem.rates(given, spin))
    grid = Grid(knots, start, velocity, partial(_tables_of, problem), partial(_history_of, problem))
    waypoints = any(g.start == 0.0 and isinstance(g.path, Waypoints) for g in problem.scene.grasps)
    if waypoints or len(curve.control_points) > 4 or not curve.even:
        start, tables = consistent_start(problem, grid), grid.tables
        grid = replace(grid, start=start, find_tables=lambda knots: tables)
    return grid


def _tables_of(problem: Problem, knots: Floats) -> Tables:
    rules = (*GAUSS_2, *GAUSS_3, *GAUSS_4)
    nodes = problem.table_spacing(len(knots) - DEGREE - 1), problem.contact_spacing(), problem.contact_cell()
    return cast(
        Tables, build_tables(knots, *free_ends(problem.scene), *rules, *nodes, problem.strand_spacing(), problem.masses)
    )


def room_for(nc: int, points: int) -> int:
    """Return the size of the work array of an assembly with so many coordinates and curvature points."""
    if nc == 2:
        return 0
    of = space if nc == 3 else twisted_rows
    return of.ROOM + of.ROOM_OF_POINT * points


def _no_history(problem: Problem, tables: Tables) -> History:
    points, nc = len(tables.curvature.w), problem.nc
    kept = points if problem.keeps_curvature else 0
    columns = {2: PAST_IN_PLANE, 3: PAST_IN_SPACE, 4: PAST}[nc]
    rubs = problem.friction is not None
    lies = rubs and problem.on_table
    return History(
        memory=np.zeros((points, MEMORY_IN_PLANE if nc == 2 else MEMORY_IN_SPACE)),
        past=np.zeros((kept, columns)),
        axial=np.zeros((len(tables.axial.w), 3)),
        stick=np.zeros((len(tables.contact.w) if rubs else 0, 3)),
        slide=np.zeros((len(tables.lying.w) if lies else 0, 2)),
        pressing=tables.contact.w.copy(),
        tension=np.zeros((0, COLUMNS)),
        room=np.zeros(room_for(nc, points)),
    )


def _history_of(problem: Problem, grid: Grid) -> History:
    """Return the history of the start of a grid: its stress-free strain, and frames without twist along it."""
    history = _no_history(problem, grid.tables)
    if problem.twist is not None:
        start_frames(grid.knots, grid.start, grid.tables.curvature, start_director(problem), history.past)
    history.memory[:] = _memory(problem, grid, history)
    if problem.start.bow:
        strain = axial_strain(grid.tables, grid.start[:, : problem.plane.dimensions])
        history.axial[:, 0] = strain - _start_strain(problem, grid)
    if problem.start.material is not None:
        _write_stretch(grid, history, problem.start.material)
    if problem.keeps_history:
        remember_start(problem.axes, grid.start, grid.tables, *problem.laws, history)
    return history


def _start_strain(problem: Problem, grid: Grid) -> Floats:
    """Return the axial strain of the start at the axial points (p,)."""
    start = problem.start
    return (
        np.zeros(len(grid.tables.axial.u)) if start.strain is None else at_points(problem.scene, grid, start.strain_at)
    )


def start_director(problem: Problem) -> Floats:
    """Return the director (3,) of the section at u = 0, where its theta is zero, at t = 0.

    It is the remembered one, or the horizontal one to the left of the tangent, turned by the `lean` of a bow.
    """
    tangent = problem.start(0.0, 1)[0]
    tangent = tangent / np.linalg.norm(tangent)
    material = problem.start.material
    director = leftwards(tangent) if material is None else cast(Floats, material.director)
    across = director - tangent * (tangent @ director)
    return turned_about(tangent, across / np.linalg.norm(across), problem.start.lean)


def corners(curve: SplineCurve, length: float) -> list[float]:
    """Return the material coordinates [m] of the sharp bends of a start curve, sharpest first.

    The sharpness of a place is the angle between the tangents BEND of the length to either side; noise that turns to
    and fro adds nothing to it. A bend extends as far as that angle is above half of its local maximum: as wide as the
    bend itself, or as the window. A narrow bend is represented by its middle, a wide one by two places, a third of its
    width to either side.
    """
    spans = np.diff(curve.knots)
    if 2.0 * spans[spans > 0.0].min() > BEND * length:
        return []  # all spans of the curve are too long for a sharp bend
    u = np.linspace(0.0, length, _PLACES)
    first, second = curve(u, 1), curve(u, 2)
    speed = np.linalg.norm(first, axis=1)
    tangents = first / speed[:, None]
    before, after = (tangents[np.clip(np.arange(_PLACES) + k, 0, _PLACES - 1)] for k in (-_REACH, _REACH))
    turned = 2.0 * np.arcsin(np.minimum(0.5 * np.linalg.norm(after - before, axis=1), 1.0))
    bends = np.linalg.norm(np.cross(first, second), axis=1) / speed**3
    least = max(SHARP, _ELSEWHERE * float(np.median(bends)) * 2.0 * BEND * length)
    found: list[float] = []
    while len(found) < _MOST_CORNERS and turned.max() >= least:
        k = int(np.argmax(turned))
        lower = np.flatnonzero(turned < 0.5 * turned[k])
        begin = int(lower[lower < k].max(initial=-1)) + 1
        end = int(lower[lower > k].min(initial=_PLACES))
        middle, wide = float(np.average(u[begin:end], weights=turned[begin:end])), float(u[end - 1] - u[begin])
        found += [middle] if wide <= _WIDE * BEND * length else [middle - wide / 3.0, middle + wide / 3.0]
        turned[max(0, begin - _REACH) : end + _REACH] = 0.0
    return found[:_MOST_CORNERS]


def plane_curvature_of(tables: Tables, q: Floats) -> Floats:
    """Return the signed curvature (points, 1) [1/m] of planar control points q (n_u, 2) at the curvature points."""
    index = tables.curvature.first[:, None] + np.arange(4)
    a = np.einsum("pi,pid->pd", tables.curvature.b1, q[index])
    b = np.einsum("pi,pid->pd", tables.curvature.b2, q[index])
    return ((a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / (a * a).sum(axis=1))[:, None]


def axial_strain(tables: Tables, r: Floats) -> Floats:
    """Return the axial strain (..., points) of control points r (..., n_u, 2 or 3) at the axial points."""
    index = tables.axial.first[:, None] + np.arange(4)
    slopes = np.einsum("pi,...pid->...pd", tables.axial.b1, r[..., index, :])
    return np.asarray(np.linalg.norm(slopes, axis=-1) - 1.0)


def _memory(problem: Problem, grid: Grid, history: History) -> Floats:
    """Return the stress-free strain at the curvature points, and its natural value, (points, 2 m)."""
    rest, material = problem.rest_shape, problem.start.material
    nc = problem.nc
    if nc == 3:
        return history.memory
    if material is not None:
        remembered = _remembered(problem, grid, material, problem.start(0.0, 1)[0], problem.start.knots)
        return _as_stressed(problem, grid, material, remembered)
    if problem.rests_straight:
        return history.memory
    curve: SplineCurve = problem.start if isinstance(rest, str) else rest_curve(rest, problem.scene.cable.length)
    own = _untouched(problem, grid) if curve is problem.start else problem.coordinates(fit_to_knots(curve, grid.knots))
    if nc == 2:
        kappa = plane_curvature_of(grid.tables, own)
        return np.concatenate([kappa, kappa], axis=1)
    # the bends of the natural curve in a frame without twist that starts like that of the sections
    along, across = _bends(grid.knots, own, grid.tables, leftwards(curve(0.0, 1)[0]))
    strain = np.column_stack([along, across, np.zeros(len(along))])
    return np.concatenate([strain, strain], axis=1)


def _untouched(problem: Problem, grid: Grid) -> Floats:
    """Return the start (n_u, nc) on a grid as it was before it was pushed out of the table or obstacles."""
    if problem.contact is None:
        return grid.start
    given = problem.coordinates(fit_to_knots(problem.start, grid.knots))
    own = consistent_start(problem, replace(grid, start=given, find_tables=lambda knots: grid.tables), touches=False)
    return np.concatenate([own[:, : problem.line.nc], grid.start[:, problem.line.nc :]], axis=1)


def _as_stressed(problem: Problem, grid: Grid, material: Material, remembered: Floats) -> Floats:
    """Return what the sections remember (points, 2 m), changed so that the start has the stress of the given one.

    On few control points the start can't bend as sharply as the given one. If that is stress-free, as at a corner, the
    cable would spring; if it has yielded, it would yield anew with every other grid, and keep more. So the curvature
    that is missing in the start is also subtracted from the stress-free one. Memory on the same knots is not changed.
    """
    curve = problem.start
    if not remembered.any() or np.array_equal(curve.knots, grid.knots):
        return remembered
    knots = np.array(curve.knots)  # writable, as the kernels are compiled for
    theta = None if curve.theta is None else fit_to_knots(curve.theta, knots)[:, 0]
    tables = _tables_of(problem, knots)
    there = _section_bends(problem, knots, tables, problem.coordinates(curve.control_points, theta))
    here = _section_bends(problem, grid.knots, grid.tables, _untouched(problem, grid))
    missed = here - _handed_on(material, grid.tables.curvature.u, tables.curvature.u, there, knots)
    out, half, bends = remembered.copy(), remembered.shape[1] // 2, missed.shape[1]
    out[:, :bends] += missed
    out[:, half : half + bends] += missed
    return out


def _section_bends(problem: Problem, knots: Floats, tables: Tables, q: Floats) -> Floats:
    """Return the bends of control points q (n, nc) at the curvature points: one in the plane, two of the sections."""
    if problem.nc == 2:
        return plane_curvature_of(tables, q)
    along, across = _bends(knots, q, tables, start_director(problem))
    assert problem.twist is not None, "without twist in space no bends are remembered"
    theta = spline_at(knots, q[:, 3:], tables.curvature.u)[:, 0] / problem.twist.radius
    return np.column_stack(
        [np.cos(theta) * along + np.sin(theta) * across, np.cos(theta) * across - np.sin(theta) * along]
    )


def _bends(knots: Floats, q: Floats, tables: Tables, director: Floats) -> tuple[Floats, Floats]:
    """Return the two bends (points,) of control points q (n, >= 3) in the frame without twist from a director (3,)."""
    frames = np.zeros((len(tables.curvature.u), PAST))
    start_frames(knots, np.ascontiguousarray(q), tables.curvature, director, frames)
    first, bends = frames[:, DIRECTOR : DIRECTOR + 3], frames[:, 3:6]
    return (bends * first).sum(axis=1), (bends * np.cross(frames[:, :3], first)).sum(axis=1)


def write_material(problem: Problem, grid: Grid, q: Floats, history: History, material: Material) -> None:
    """Write into a history what the sections remember at the state q (n_u, nc) of a motion of this problem."""
    if problem.nc != 3:
        tangent = problem.plane.world_vectors(grid.at(q, 0.0, 1)[: problem.plane.dimensions])
        history.memory[:] = _remembered(problem, grid, material, tangent, grid.knots)
    _write_stretch(grid, history, material)


def _write_stretch(grid: Grid, history: History, material: Material) -> None:
    if material.stretch is not None:
        axial = grid.tables.axial
        history.axial[:, 0] = axial.share * np.interp(axial.u, cast(Floats, material.u), cast(Floats, material.stretch))


def _remembered(problem: Problem, grid: Grid, material: Material, tangent: Floats, knots: Floats) -> Floats:
    """Return the stress-free strain of a material at the curvature points, and its natural value, (points, 2 m).

    `tangent` (3,) is that at u = 0, where the material's director lies; `knots` are those of the memory.
    """
    values = np.concatenate(_memories(material), axis=1)
    sections = _handed_on(material, grid.tables.curvature.u, cast(Floats, material.u), values, knots)
    return sections if problem.nc == 4 else _planar_memory(problem, sections, cast(Floats, material.director), tangent)


def _memories(material: Material) -> tuple[Floats, Floats]:
    """Return the memory of a material, and its value before anything yielded, (k, 3) each."""
    memory = cast(Floats, material.memory)
    return memory, np.zeros_like(memory) if material.natural is None else cast(Floats, material.natural)


def _has_yielded(material: Material) -> bool:
    memory, natural = _memories(material)
    return bool(np.abs(memory - natural).max() > _ROUNDING * np.abs(memory).max())


def _handed_on(material: Material, u: Floats, places: Floats, values: Floats, knots: Floats) -> Floats:
    """Return values (k, m) at u (k,) from those at `places` (p, m): as `_between`, or linear if the cable has yielded.

    Where it is about to yield, the strain between two places must not exceed that at both.
    """
    return _linear(u, places, values) if _has_yielded(material) else _between(u, places, values, knots)


def _linear(u: Floats, places: Floats, values: Floats) -> Floats:
    return np.column_stack([np.interp(u, places, row) for row in values.T])


def _between(u: Floats, places: Floats, values: Floats, knots: Floats) -> Floats:
    """Return values (k, m) at u (k,), interpolated from those at `places` (p, m).

    If the places are the curvature points of a spline with these knots, three in each span, the result is the parabola
    through the three points of a span: the curvature of a cubic is nearly linear in each span, with kinks at the knots.
    For other places it is linear between them.
    """
    cuts = np.unique(knots)
    span = np.clip(np.searchsorted(cuts, places) - 1, 0, len(cuts) - 2)
    if not np.array_equal(span, np.repeat(np.arange(len(cuts) - 1), 3)):
        return _linear(u, places, values)
    at = np.clip(np.searchsorted(cuts, u, side="right") - 1, 0, len(cuts) - 2)
    x, y = places.reshape(-1, 3)[at], values.reshape(-1, 3, values.shape[1])[at]
    shares = [(u - x[:, j]) * (u - x[:, k]) / ((x[:, i] - x[:, j]) * (x[:, i] - x[:, k])) for i, j, k in _THREE]
    return np.einsum("ik,kid->kd", shares, y)


def _planar_memory(problem: Problem, sections: Floats, director: Floats, tangent: Floats) -> Floats:
    """Return the signed curvatures (points, 2) in the solve's plane of bends (points, 6) in the sections' frame."""
    normal = np.cross(problem.plane.axes[0], problem.plane.axes[1])
    first = np.cross(normal, tangent / np.linalg.norm(tangent))
    along, across = float(director @ first), float(director @ normal)
    # the second director is t x director
    return np.column_stack(
        [along * sections[:, 0] - across * sections[:, 1], along * sections[:, 3] - across * sections[:, 4]]
    )


def consistent_start(problem: Problem, grid: Grid, *, touches: bool = True) -> Floats:
    """Return start control points (n_u, nc) that pass exactly through the held points, with the strain of the curve.

    With `touches`, parts of the spline inside the table or an obstacle are pushed out. A start that continues another
    motion, with a strain, is already pressed against them; of that, only parts deeper than a cable lies (_LYING) are
    pushed out. The angle of the sections plays no role.
    """
    line = problem.line
    history = _no_history(line, grid.tables)
    start = np.ascontiguousarray(grid.start[:, : line.nc])
    grasps = [g for g in problem.scene.grasps if g.start == 0.0]
    starts: Starts = {}
    close_grasps(problem, grid, grasps, starts, None)
    held = hold(line, grid, grasps, np.zeros(1), starts, start)
    active, parameters = line.law_table()
    if line.contact is not None and problem.start.strain is not None:
        deep = _LYING * line.contact.depth_under(float(np.linalg.norm(line.weight())))
        parameters[laws.TABLE, 0] -= deep
        parameters[laws.CONTACT, 0] -= deep  # the cable's radius in contact with obstacles
    kept = [laws.STRETCH, *([laws.CONTACT, laws.TABLE] if touches else [])]
    active[[row for row in range(laws.COUNT) if row not in kept]] = 0
    history.axial[:, 0] = _start_strain(problem, grid)
    tables, length = grid.tables, problem.scene.cable.length
    strength = 1e-3 * parameters[0, 0] * (grid.n_u / length) ** 2
    if is_squeezed(problem):
        tables, strength = in_long_waves(tables, parameters[0, 0], length)
    q = start.copy()
    relax(
        line.axes, q, start, strength, np.zeros_like(q), tables, active, parameters, history, held.elimination,
        held.offsets[0], 1e-10 * length, 50,
    )  # fmt: skip
    return np.concatenate([q, grid.start[:, line.nc :]], axis=1)


def applied_forces(problem: Problem, grid: Grid, t: Floats, end: float = np.inf) -> Floats:
    """Return the applied forces (1 or k, n_u, nc) [N]: weight, and loads at times t (k,) if there are any.

    At a jump of a load they are those after it, or those before it for times from `end` [s] on.
    """
    steady = cast(Floats, grid.tables.weight)[:, None] * problem.weight()
    if not problem.scene.loads:
        return steady[None]
    applied = np.tile(steady, (len(t), 1, 1))
    for load in problem.scene.loads:
        first, b = grid.rows(load.u)
        force = problem.rates(load.at(t, end))
        applied[:, first : first + 4] += b[:, None] * force[:, None, :]
    return applied


def applied_at_rest(problem: Problem, grid: Grid, t: float) -> Floats:
    """Return the applied forces (n_u, nc) [N] under which a cable rests at `t` [s]: before a jump of a load there."""
    return applied_forces(problem, grid, np.array([t]), t)[0]


def applied_in_steps(problem: Problem, grid: Grid, times: Floats, begin: float, end: float) -> Floats:
    """Return the applied forces (1 or k, n_u, nc) [N] with which a march steps to evenly spaced times (k,) [s].

    Loads are averaged with weights over the steps before and after each time, so that none is stepped over, however
    short, and no impulse is lost (docs/model.md eq. 13b). A stretch is entered with the forces at its `begin` [s]; the
    difference to their mean is added to the next step. Loads after its `end` [s] have no influence.
    """
    applied = applied_forces(problem, grid, times, end)
    h = times[1] - times[0]
    for load in problem.scene.loads:
        if load.times is None:
            continue
        at, force = cast(Floats, load.times), cast(Floats, load.force)
        lasts, rises, none = np.diff(at)[:, None], np.diff(force, axis=0), np.zeros((1, 3))
        slopes = np.divide(rises, lasts, out=np.zeros_like(rises), where=lasts > 0.0)
        turns = np.diff(slopes, axis=0, prepend=none, append=none)
        jumps = np.append(np.where(lasts > 0.0, 0.0, rises), none, axis=0)
        inside = (at > times[0]) & (at < min(times[-1] + h, end))
        at, turns, jumps = at[inside], turns[inside], jumps[inside]
        before = np.searchsorted(times, at) - 1
        mean = np.zeros((len(times) + 1, 3))
        for rows, apart, sign in ((before, at - times[before], 1.0), (before + 1, h - (at - times[before]), -1.0)):
            near = np.clip(h - apart, 0.0, h)[:, None]
            np.add.at(mean, rows, turns * (near**3 / (6.0 * h**2)) + sign * jumps * (near**2 / (2.0 * h**2)))
        if times[0] == begin:
            mean[1] += mean[0]
        first, b = grid.rows(load.u)
        applied[:, first : first + 4] += b[:, None] * problem.rates(mean[:-1])[:, None, :]
    return applied
