"""Frames of the sections over a whole motion: the angle theta of the answer, directors, and memory.

A solve measures theta against frames that are carried along in time at each point of the cable. The answer measures it
against a frame without twist along the cable, so that theta' is the twist rate (docs/model.md eq. 19).
"""

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from dlocore.answer.parts import MaterialMotion
from dlocore.kernels.angles import angles_with
from dlocore.kernels.basis import spline_values
from dlocore.kernels.timefit import fit_time
from dlocore.kernels.twisted import twist_rates
from dlocore.kernels.twisted_rows import DIRECTOR, FRAME, TANGENT
from dlocore.problem.discretisation import start_director
from dlocore.problem.grid import Grid
from dlocore.problem.plane import turned_about
from dlocore.problem.problem import Problem
from dlocore.shape.transport import transported
from dlocore.spline import DEGREE, SplineSurface

Floats = NDArray[np.float64]

MATERIAL_TIMES = 33  # most times at which the memory of a motion is stored
_INSIDE = 1e-3  # of a span of the time knots: distance from its ends at which a time counts as inside
_SMOOTH = 0.03  # weight of an angle's curvature against its slopes: small where the slopes determine it


def free_of_frames(problem: Problem, grid: Grid, states: Floats, frames: Floats) -> Floats:
    """Return the states (k, n_u, nc) with theta against a frame without twist along the cable.

    Args:
        states: control points in the solve's coordinates (k, n_u, nc).
        frames: the frames to which their theta refers (k, points, PAST), see `kernels/twisted.py`.
    """
    if problem.twist is None:
        return states
    free = states.copy()
    free[:, :, 3] = angles_of(problem, grid, rates_of(problem, grid, states, frames), states[:, 0, 3])
    return free


def rates_of(problem: Problem, grid: Grid, states: Floats, frames: Floats) -> Floats:
    """Return the twist rates (k, points) [rad/m] of the states (k, n_u, 4) at the curvature points; see above."""
    tau = np.empty((len(states), len(grid.tables.curvature.w)))
    _, parameters = problem.laws
    twist_rates(np.ascontiguousarray(states), grid.tables.curvature, parameters, np.ascontiguousarray(frames), tau)
    return tau


def angles_of(problem: Problem, grid: Grid, rates: Floats, first: Floats) -> Floats:
    """Return the fourth coordinates (k, n_u) [m] whose slopes are the twist rates (k, points) [rad/m].

    The angles are against frames without twist; `first` (k,) are their values at u = 0. The means of the slopes over
    the knot spans leave oscillations about a double knot inside the cable undetermined; a grid has one if it is too
    coarse for a triple knot. Therefore the smoothest of all angles with these slopes is returned.
    """
    assert problem.twist is not None, "without twist there are no angles"
    slopes = problem.twist.radius * rates
    return np.asarray(angles_with(grid.tables, slopes, np.ascontiguousarray(first), _SMOOTH))


def free_control(problem: Problem, grid: Grid, knots_t: Floats, control: Floats, times: Floats, log: Floats) -> Floats:
    """Return control points (n_t, n_u, 4) of a motion with theta against a frame without twist along the cable.

    Knot spans without any of the times inside, which exist where the cable strikes something, would leave theta
    undetermined. There the difference of the angles against the two frames is interpolated linearly between the times.

    Args:
        control: (n_t, n_u, nc), with theta against frames carried in time.
        times: (k,) [s].
        log: the carried frames at the times (k, points, PAST).
    """
    assert problem.twist is not None
    flat = np.ascontiguousarray(control).reshape(len(control), -1)
    states = np.asarray(spline_values(knots_t, flat, times, 0)).reshape(-1, *control.shape[1:])
    theta = free_of_frames(problem, grid, states, log)[:, :, 3]
    starved = _starved(knots_t, times)
    if len(starved):
        differ = theta - states[:, :, 3]
        k = np.searchsorted(times, starved) - 1
        share = ((starved - times[k]) / (times[k + 1] - times[k]))[:, None]
        own = spline_values(knots_t, np.ascontiguousarray(control[:, :, 3]), starved, 0)
        theta = np.insert(theta, k + 1, own + (1.0 - share) * differ[k] + share * differ[k + 1], axis=0)
        times = np.insert(times, k + 1, starved)
    rate = 3.0 * (control[1, :, 3] - control[0, :, 3]) / (knots_t[4] - knots_t[1])
    out = control.copy()
    out[:, :, 3] = fit_time(knots_t, times, np.ascontiguousarray(theta), np.ascontiguousarray(rate))
    return out


def _starved(knots_t: Floats, times: Floats) -> Floats:
    """Return the middles [s] of the spans of the time knots without any of the times (k,) [s] well inside."""
    begin, end = knots_t[DEGREE : -DEGREE - 1], knots_t[DEGREE + 1 : -DEGREE]
    margin = _INSIDE * (end - begin)
    none = np.searchsorted(times, begin + margin, side="right") == np.searchsorted(times, end - margin)
    return (0.5 * (begin + end))[none & (end > begin)]


def carried(director: Floats, tangents: Floats) -> Floats:
    """Return the unit vectors (k, 3) to which `director` is carried along the unit tangents (k, 3), without spin."""
    out = np.empty_like(tangents)
    d, before = director, tangents[0]
    for k, t in enumerate(tangents):
        d = transported(before, t, d)
        d = d - t * (t @ d)
        d /= np.linalg.norm(d)
        out[k], before = d, t
    return out


def unit(x: Floats) -> Floats:
    """Return the vectors (..., 3) scaled to length one."""
    return x / np.linalg.norm(x, axis=-1, keepdims=True)


def material_of(
    problem: Problem, grid: Grid, times: Floats, states: Floats, memory: Floats, axial: Floats
) -> MaterialMotion:
    """Return what the sections remember over a motion.

    Args:
        times: (k,) [s].
        states: (k, n_u, nc).
        memory: (k, points, 1 in the plane or 3).
        axial: stress-free axial strain (k, axial points).
    """
    kept = np.unique(np.linspace(0, len(times) - 1, MATERIAL_TIMES).round().astype(int))
    slopes = np.stack([grid.at(q, 0.0, 1)[: problem.plane.dimensions] for q in states])
    tangents = unit(problem.plane.world_vectors(slopes))
    if problem.nc == 2:
        normal = np.cross(problem.plane.axes[0], problem.plane.axes[1])
        directors = np.cross(normal, tangents[kept])
        sections = np.zeros((len(kept), memory.shape[1], 3))
        sections[..., 0] = memory[kept, :, 0]
        natural = np.zeros((memory.shape[1], 3))
        natural[:, 0] = grid.history.memory[:, 1]
    else:
        directors = carried(_first_director(problem, grid, tangents[0]), tangents)[kept]
        sections, natural = memory[kept], grid.history.memory[:, 3:]
    u = np.array(grid.tables.curvature.u)
    stretch = np.array([np.interp(u, grid.tables.axial.u, row / grid.tables.axial.share) for row in axial[kept]])
    return MaterialMotion(
        times=times[kept], director=directors, u=u, memory=sections,
        stretch=stretch, natural=np.array(natural),
    )  # fmt: skip


def _first_director(problem: Problem, grid: Grid, tangent: Floats) -> Floats:
    """Return the director (3,) at u = 0, fixed in the section where theta is zero, when a motion begins.

    `tangent` (3,) is the tangent there. The frames of a start that has settled were carried along with the cable, each
    by itself. The director is then found from the frame at the first curvature point and the twist on the way to it.
    """
    if not problem.scene.shape.settle or problem.twist is None:
        return _in_one_turn(problem, tangent)
    past, (u, after) = grid.history.past, grid.tables.curvature.u[:2]
    director = transported(past[0, TANGENT : TANGENT + 3], tangent, past[0, DIRECTOR : DIRECTOR + 3])
    rate = past[0, FRAME] - 0.5 * u * (past[1, FRAME] - past[0, FRAME]) / (after - u)  # half-way to that point
    return turned_about(tangent, director, -float(rate * u))


def _in_one_turn(problem: Problem, tangent: Floats) -> Floats:
    """Return the director (3,) of the given start, turned by the smallest rotation of its tangent to another (3,)."""
    return transported(unit(problem.start(0.0, 1)[0]), tangent, start_director(problem))


def directors(problem: Problem, surface: SplineSurface, times: Floats, material: MaterialMotion | None) -> Floats:
    """Return the directors (k, 3) of the section at u = 0, where theta is zero, at `times` (k,) [s].

    If the `material` of the motion is not known, they begin with that of the given start, turned to the tangent at
    t = 0 by the smallest rotation.
    """
    spans = np.unique(surface.knots_t)
    fine = np.unique(np.concatenate([np.linspace(a, b, 9) for a, b in pairwise(spans)] + [times]))
    tangents = unit(surface([0.0], fine, du=1)[:, 0, :3])
    first = _in_one_turn(problem, tangents[0]) if material is None else material.director[0]
    return carried(first, tangents)[np.searchsorted(fine, times)]
