"""Effects that were left out of a solved motion: which of them it calls for, and how much they matter.

If an effect that `auto` has left out shows in the result, it is switched on and the solve continues with it. An effect
that the scene switches off stays off, and the answer says what it would have done.
"""

from collections.abc import Callable
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from dlocore.answer.reactions import WindowForces
from dlocore.effects import laws
from dlocore.effects.damping import Damping
from dlocore.effects.distance import distances
from dlocore.effects.selfcontact import CLOSE as CLOSE_STRANDS
from dlocore.kernels.assembly import NO_RATES, add_scalar_band, assemble, largest_curvature, times_scalar_band
from dlocore.kernels.banded import solve_free
from dlocore.kernels.twisted_rows import TWIST_RATE
from dlocore.levels.level import CREDIBLE_STRAIN, Level
from dlocore.levels.spin import bends_sharply, spin_forces
from dlocore.levels.taut import taut_notes
from dlocore.problem.buckling import BOW, UNSTABLE, side_notes
from dlocore.problem.discretisation import axial_strain
from dlocore.problem.events import closed_grasps, moments
from dlocore.problem.notes import edge_notes, start_notes
from dlocore.problem.problem import Problem
from dlocore.problem.selection import turned_by_grasps
from dlocore.problem.standing import obstacle_rows
from dlocore.problem.strained import STRAINED, strain_notes
from dlocore.problem.strands import nearest_strands
from dlocore.scene.obstacles import Obstacle
from dlocore.solvers.monitor import Monitor
from dlocore.spline import SplineSurface, design_matrix
from dlocore.stability.determined import DOUBTFUL, UNDETERMINED, goes_astray, in_words
from dlocore.stability.firmness import firmness_in_words, gives_way
from dlocore.stability.mirrored import goes_elsewhere
from dlocore.stability.sideways import WITH_TWIST, lacks_twist, leaves_plane, solved_in_space
from dlocore.statics.statics import settles_elsewhere
from dlocore.statics.tipping import tip_notes
from dlocore.statics.turning import turn_notes
from dlocore.statics.yielding import yield_notes
from dlocore.words import in_mm

Floats = NDArray[np.float64]

CLOSE = 0.01  # of the length: a cable that comes this near to an obstacle that was left out calls for it
MATTERS = 0.001  # of the length: a neglected effect that moves the cable by more than this is reported
_SHARE = 0.2  # of a requested target: how far neglected inertia may move it
_TURNS = 0.1  # of that, and of the target: how far spinning sections may move it: a snapping motion amplifies that
FAR_MORE = 2.0  # times the strain of the march: a spline that adds more is reported
TURNED, OF_TURN = 0.2, 0.05  # [rad], and of the largest angle of its sections: a larger difference of grids is reported
_PLACES, _MOMENTS = 4, 33  # in a span, and in time per swing, at which the strain of a surface is checked
_BLOCK = 4096  # states whose gaps to obstacles are found at once
_LOOKS = 5  # states of each stretch of a motion at which neglected forces are evaluated
_LONGER = 4  # factor on the time over which a motion is searched for turns, from one search to the next
_SKIPPED = 3  # one of this many control points is searched: its neighbours turn with it


def called_for(level: Level, fine: bool = True) -> dict[str, str]:
    """Return the effects that `auto` has left out and the motion calls for, with the reason for each.

    If the grid is not `fine`, the effects that only a fine grid can decide are left open.
    """
    problem, found = level.problem, {}
    switch, length = problem.scene.effects.get, problem.scene.cable.length
    asked = problem.scene.quality.target_error or np.inf
    if not problem.choices["plasticity"].active and switch("plasticity", "auto") == "auto":
        found.update(_yields(level))
    if switch("obstacles", "auto") == "auto":
        found.update(_touches(level))
    if problem.inertia is None and switch("inertia", "auto") == "auto":
        moved = _response(level, "inertia")
        if level.motion.stopped == "step":
            reached = level.motion.times[level.motion.reached]
            found["inertia"] = f"without it the cable has no equilibrium to continue to at {reached:.3g} s"
        elif moved > min(MATTERS * length, _SHARE * asked):
            most = min(moved, length)  # if the cable is about to give way, this is no distance
            found["inertia"] = f"without it a first solve is {in_mm(most)} off"
    if switch("twist", "auto") == "auto":
        moved = _spun(level)
        if moved > _TURNS * min(MATTERS * length, asked):
            found["twist"] = (
                f"sections that turn at sharp bends resist, which moves the cable by {in_mm(moved)} or more"
            )
    if fine and not found:  # these are decided on the motion that has all the others
        found.update(called_for_by_fine(level))
    return found


def called_for_by_fine(level: Level) -> dict[str, str]:
    """Return effects that a rough grid may call for just because it is rough, and why.

    These are contact of the cable with itself, if `auto` has left it out, and on free grids a side to which a motion
    leaves its plane.
    """
    return {**_side(level), **_strands(level)}


def _side(level: Level) -> dict[str, str]:
    problem, motion = level.problem, level.motion
    credible = not motion.stopped and motion.largest_strain <= CREDIBLE_STRAIN
    free = problem.scene.quality.n_u is None and not lacks_twist(problem)
    if credible and free and leaves_plane(problem, motion):
        return {"side": UNSTABLE}
    return {}


def _strands(level: Level) -> dict[str, str]:
    problem = level.problem
    credible = not level.motion.stopped and level.motion.largest_strain <= CREDIBLE_STRAIN
    left_out = not problem.choices["self_contact"].active
    automatic = problem.scene.effects.get("self_contact", "auto") == "auto"
    # a strand that lies on the table can be crossed by another on top of it
    return _meets_itself(level) if credible and left_out and automatic and not problem.lies_over else {}


def objections(level: Level) -> list[str]:
    """Return the notes about a motion beyond its status, in words.

    They report what the effects that the scene switches off would have done, if it matters, a strain along the cable
    that few cables bear, a cable that is pulled taut, and the like.
    """
    problem, found = level.problem, []
    found += strain_notes(level.problem.scene.cable, level.motion.largest_strain, "the motion")
    found += taut_notes(level)
    found += _stretched(level)
    found += _twisted(level)
    found += start_notes(problem.scene, problem.start)
    found += edge_notes(problem.scene, problem.obstacles)
    found += side_notes(problem.start)
    found += turn_notes(problem, level.motion.grid)
    found += tip_notes(level.motion.grid.tipped, problem.scene.cable.length)
    if problem.scene.shape.settle and problem.choices["plasticity"].active:
        found += yield_notes(problem, level.motion.grid, level.motion.states[0], level.motion.grid.history)
    kept = [
        *([WITH_TWIST] if lacks_twist(problem) else []),
        *(["without a given grid"] if problem.scene.quality.n_u is not None else []),
    ]
    if kept and leaves_plane(problem, level.motion):
        found.append(solved_in_space(kept))
    found += _unsure(level)
    elsewhere = goes_elsewhere(problem, level.motion)
    if elsewhere:
        lopsided = f"a cable lopsided by {in_mm(BOW * problem.scene.cable.length)}"
        found.append(
            f"the motion is its own mirror image, which is unstable: {lopsided} departs from it by {elsewhere:.2g} m"
        )
    off = {name for name, value in problem.scene.effects.items() if value == "off"}
    for name, test in (("plasticity", _yields), ("obstacles", _touches), ("self_contact", _meets_itself)):
        if name in off:
            found += [f"{name} is off, though {reason}" for reason in test(level).values()]
    if problem.lies_over and not problem.choices["self_contact"].active and "self_contact" not in off:
        crossings = _meets_itself(level).values()
        found += [
            f"{reason}: one lies over the other; effects.self_contact on keeps them apart" for reason in crossings
        ]
    if "twist" in off and problem.plane.dimensions == 3:
        turned = turned_by_grasps(problem.scene, problem.start)
        found += [f"twist is off, though {turned}"] if turned else []
    allowed = MATTERS * problem.scene.cable.length
    for name in _forces(problem) if off else ():
        if name in off:
            moved = _response(level, name)
            if moved > allowed:  # beyond the cable's length, the linear response is no distance
                far = "its length or more" if moved > problem.scene.cable.length else f"about {in_mm(moved)}"
                found.append(f"{name} is off, though it would move the cable by {far}")
    return found


def _unsure(level: Level) -> list[str]:
    """Return a note if a motion on a given grid depends on its exact start or on the contact stiffness.

    On free grids, status and error estimate say so.
    """
    problem, motion = level.problem, level.motion
    length = problem.scene.cable.length
    if problem.scene.quality.n_u is None:
        return []
    moved = max(goes_astray(problem, motion, Monitor(), hard=False), settles_elsewhere(problem, motion.grid, Monitor()))
    if moved > UNDETERMINED * length:
        return [f"on this grid {in_words(problem, moved)}"]
    gives = gives_way(problem, motion, Monitor())
    told = f"on this grid {firmness_in_words(gives)}, which the estimated error does not include"
    return [told] if gives > DOUBTFUL * length else []


def turns_unsurely(level: Level) -> bool:
    """Tell whether two grids disagree on the angles of the sections, which no distance between them shows."""
    if level.turned <= TURNED:
        return False
    twist = level.problem.twist
    assert twist is not None
    return level.turned > OF_TURN * float(np.abs(level.samples[..., 3]).max()) / twist.radius


def _twisted(level: Level) -> list[str]:
    if not turns_unsurely(level):
        return []
    return [
        "the angles of the sections, and the torque, are less certain than the positions: two grids differ by up "
        f"to {level.turned:.2g} rad; a given grid with larger n_u and n_t shows waves of twist"
    ]


def _stretched(level: Level) -> list[str]:
    """Return a note if the surface strains the cable more than few cables bear, and far more than its march does.

    What the time spline misses of the march may be little for the cable, but much for a short span of it. A coarse grid
    may also strain a span between the points at which the march checks it.
    """
    knots, horizon = level.motion.grid.knots, level.problem.horizon
    breaks = np.unique(knots)
    u = (breaks[:-1, None] + np.diff(breaks)[:, None] * np.linspace(0.0, 1.0, _PLACES, endpoint=False)).ravel()
    t = np.linspace(0.0, horizon, moments(level.problem.scene, _MOMENTS))
    slopes = SplineSurface(level.control, knots, level.knots_t)(u, t, du=1)[..., : level.problem.plane.dimensions]
    strain = np.abs(np.linalg.norm(slopes, axis=2) - 1.0)
    k, s = np.unravel_index(np.argmax(strain), strain.shape)
    if not strain[k, s] > max(STRAINED, FAR_MORE * level.motion.largest_strain):
        return []
    quality = level.problem.scene.quality
    advice = "use more control points" if quality.n_u is not None else "ask for a smaller target_error"
    if quality.time_budget is not None:
        advice = "allow a larger time_budget"
    return [
        f"the surface stretches the cable by up to {strain[k, s]:.0%} within a span, at {u[s]:.4g} m and {t[k]:.3g} s: "
        f"the error of the positions says nothing about lengths and directions there; {advice}"
    ]


def neglected(level: Level) -> float:
    """Return about how far the effects that `auto` has left out would have moved the cable, at most [m]."""
    problem, switch = level.problem, level.problem.scene.effects.get
    moved = _spun(level) if switch("twist", "auto") == "auto" else 0.0
    if problem.inertia is None and switch("inertia", "auto") == "auto":
        moved += _response(level, "inertia")
    return moved


def _spun(level: Level) -> float:
    """Return about how far the inertia of turning sections would move a cable that is solved without twist [m]."""
    problem, motion = level.problem, level.motion
    if not _turns_sections(problem) or not bends_sharply(problem, motion.grid, motion.states):
        return 0.0
    return _response(level, "twist")


def _turns_sections(problem: Problem) -> bool:
    """Tell whether a motion turns sections whose inertia is left out: in space, without twist."""
    return problem.plane.dimensions == 3 and problem.twist is None and problem.inertia is not None


def _yields(level: Level) -> dict[str, str]:
    problem, cable = level.problem, level.problem.scene.cable
    grid, states = level.motion.grid, level.motion.states
    if cable.yield_strain is not None:
        most = float(largest_curvature(problem.axes, states, grid.tables.curvature, grid.history.memory))
        threshold = 2.0 * cable.yield_strain / cable.diameter
        if most > threshold:
            return {"plasticity": f"the motion bends the cable by {most:.3g}/m, and it yields at {threshold:.3g}/m"}
    if cable.yield_twist is not None and problem.twist is not None:
        most = float(np.abs(level.motion.frames[:, :, TWIST_RATE]).max())
        threshold = 2.0 * cable.yield_twist / cable.diameter
        if most > threshold:
            return {"plasticity": f"the motion twists it by {most:.3g} rad/m, and it yields at {threshold:.3g} rad/m"}
    if cable.yield_stretch is not None:
        strain = axial_strain(grid.tables, states[..., : problem.plane.dimensions]) / grid.tables.axial.share
        most = float(np.abs(strain).max())
        if most > cable.yield_stretch:
            return {
                "plasticity": f"the motion strains the cable by {most:.2g}, and it yields at {cable.yield_stretch:.2g}"
            }
    return {}


def _touches(level: Level) -> dict[str, str]:
    problem = level.problem
    left_out = [o for o in problem.scene.environment.obstacles if o not in problem.obstacles]
    if not left_out:
        return {}
    gap, nearer = np.inf, np.inf  # and how near it may have come between the states
    for first in range(0, max(1, len(level.motion.states) - 1), _BLOCK):  # all at once may need too much memory
        gaps, between = _gaps(level, left_out, slice(first, first + _BLOCK + 1))
        gap, nearer = min(gap, float(gaps.min())), min(nearer, float((gaps - between).min()))
    if nearer > CLOSE * problem.scene.cable.length:
        return {}
    what = f"comes within {in_mm(gap)} of" if gap > 0 else "passes through"
    return {"obstacles": f"the motion {what} an obstacle"}


def _gaps(level: Level, obstacles: list[Obstacle], part: slice) -> tuple[Floats, Floats]:
    """Return the gaps (k points,) [m] to obstacles in some states, and how much smaller they may be between states."""
    problem, motion = level.problem, level.motion
    u = np.linspace(0.0, problem.scene.cable.length, 65)
    points = np.einsum("ui,kid->kud", design_matrix(motion.grid.knots, u), motion.states[part])
    world = problem.plane.world(points[..., : problem.plane.dimensions])
    way = np.linalg.norm(np.diff(world, axis=0), axis=2)
    between = 0.5 * np.maximum(np.vstack([way, way[-1:]]), np.vstack([way[:1], way]))
    rows = obstacle_rows(problem.scene, obstacles)
    return distances(rows, world.reshape(-1, 3)).min(axis=1) - 0.5 * problem.scene.cable.diameter, between.ravel()


def _meets_itself(level: Level) -> dict[str, str]:
    problem, motion = level.problem, level.motion
    diameter = problem.scene.cable.diameter
    dimensions = problem.plane.dimensions
    apart = nearest_strands(motion.grid.knots, motion.states, dimensions, diameter, CLOSE_STRANDS * diameter)
    if not np.isfinite(apart):
        return {}
    meet = f"come within {in_mm(apart)} of each other" if apart > 0.05 * diameter else "cross"
    return {"self_contact": f"two strands {meet}"}


class _Look(NamedTuple):
    """Control points (n_u, nc) [m] at a time [s], their velocities and accelerations, taken over the time tau [s]."""

    time: float
    q: Floats
    v: Floats
    a: Floats
    tau: float


Force = Callable[[_Look, Level], Floats]


def _forces(problem: Problem) -> dict[str, Force]:
    """Return, for each effect that is a force on the motion at hand, its generalised forces (n_u, nc) [N]."""
    scene = problem.scene
    density = scene.cable.linear_density

    def inertia(look: _Look, level: Level) -> Floats:
        return density * times_scalar_band(level.motion.grid.tables.inertia, look.a)

    def drag(look: _Look, level: Level) -> Floats:
        speed = float(np.linalg.norm(look.v, axis=1).max())
        drag = scene.environment.drag + scene.environment.drag_quadratic * speed
        return drag * times_scalar_band(level.motion.grid.tables.unit, look.v)

    def gravity(look: _Look, level: Level) -> Floats:
        pull = cast(Floats, scene.environment.gravity)
        weight = problem.rates(density * pull) * (0.0 if problem.on_table else 1.0)
        return np.asarray(level.motion.grid.tables.weight[:, None] * weight)

    def damping(look: _Look, level: Level) -> Floats:
        active, parameters = problem.law_table()
        law = Damping(scene.cable.bending_damping)
        with_damping, table = active * 0, parameters.copy()
        with_damping[laws.DAMPING], with_damping[laws.TWIST] = 1, active[laws.TWIST]
        table[laws.DAMPING, :2] = law.parameters()
        table[[laws.STRETCH, laws.TWIST], 0] = 0.0
        f = np.empty_like(look.q)
        grid = level.motion.grid
        assemble(
            problem.axes, look.q, look.v, grid.tables, with_damping, table, grid.history, NO_RATES, (0.0, 0.0, 0.0),
            f, np.empty((1, 1)),
        )  # fmt: skip
        return f

    def friction(look: _Look, level: Level) -> Floats:
        table = scene.environment.table
        if table is None or not problem.on_table:
            return np.zeros_like(look.q)
        load = table.friction * density * abs(float(cast(Floats, scene.environment.gravity)[2]))
        speed = np.linalg.norm(look.v, axis=1, keepdims=True)
        return load * times_scalar_band(level.motion.grid.tables.inertia, look.v / np.maximum(speed, 1e-3))

    def twist(look: _Look, level: Level) -> Floats:
        clamps = [g.u for g in closed_grasps(scene, look.time, look.time) if g.hold == "clamp"]
        return spin_forces(problem, level.motion.grid, look.q, look.v, look.a, clamps[0] if clamps else None)

    along: dict[str, Force] = {
        "inertia": inertia,
        "drag": drag,
        "gravity": gravity,
        "damping": damping,
        "friction": friction,
    }
    return along | ({"twist": twist} if _turns_sections(problem) else {})


def _response(level: Level, name: str) -> float:
    """Return about the largest displacement [m] of a control point that a neglected effect would cause.

    It is (K + 2/T^2 M + 1/T C)^-1 f for the effect's forces f at a few states of the motion: the static displacement
    where the cable is held stiffly, and that of a free body after the time T of the motion where it isn't. Inertia is
    evaluated where the motion turns fastest, over longer and longer times tau: (K + M/tau^2)^-1 M a is then the static
    displacement in modes faster than tau, and how far the motion turned in slower ones.
    """
    force, most = _forces(level.problem)[name], 0.0
    for window in level.motion.forces:
        looks = _evenly(window) + (_turns(window) if name == "inertia" else [])
        most = max([most, *(_given_way(level, window, look, force) for look in looks)])
    return most


def _look(window: WindowForces, k: int, stride: int) -> _Look:
    """Return a look at the state k of a stretch, with rates over `stride` of its (equal) steps to both sides."""
    before, q, after = window.states[k - stride], window.states[k], window.states[k + stride]
    tau = stride * float(window.times[-1] - window.times[0]) / (len(window.times) - 1)
    return _Look(float(window.times[k]), q, (after - before) / (2.0 * tau), (after - 2.0 * q + before) / tau**2, tau)


def _evenly(window: WindowForces) -> list[_Look]:
    """Return looks at states evenly spaced over a stretch of motion, as if they were without end."""
    last = len(window.times) - 2
    at = np.unique(np.linspace(1, last, _LOOKS).round().astype(int)).tolist() if last >= 1 else []
    return [_look(window, k, 1)._replace(tau=np.inf) for k in at]


def _turns(window: WindowForces) -> list[_Look]:
    """Return looks at the states of a stretch where the motion turns fastest, over longer and longer times."""
    states, stride, found = window.states[:, ::_SKIPPED], 1, []
    while 2 * stride < len(states):
        step, end = max(1, stride // 2), len(states)
        turned = states[: end - 2 * stride : step] + states[2 * stride :: step]
        turned -= 2.0 * states[stride : end - stride : step]
        sharpest = int(np.einsum("kid,kid->ki", turned, turned).max(axis=1).argmax())
        found.append(_look(window, stride + step * sharpest, stride))
        stride *= _LONGER
    return found


def _given_way(level: Level, window: WindowForces, look: _Look, force: Force) -> float:
    """Return how far a force moves the cable at most, from the state of a look [m]; 0 if it gives way anyway."""
    problem, grid = level.problem, level.motion.grid
    nc, e = problem.nc, window.held.elimination
    active, parameters = problem.law_table()
    slow = problem.scene.cable.linear_density * (2.0 / problem.horizon**2 + look.tau**-2)
    K, f = np.empty((look.q.size, 4 * nc)), np.empty_like(look.q)
    right = np.ascontiguousarray(force(look, level)).ravel()
    for geometric in (1.0, 0.0):  # for a cable that is about to give way only the positive part is of use
        scales = (1.0, 0.0, geometric)
        assemble(problem.axes, look.q, look.v, grid.tables, active, parameters, grid.history, NO_RATES, scales, f, K)
        add_scalar_band(nc, grid.tables.inertia, slow, K)
        add_scalar_band(nc, grid.tables.unit, problem.drag_coefficient() / problem.horizon, K)
        change, positive = solve_free(e, K, right)
        if positive:
            return float(np.linalg.norm(change.reshape(-1, nc)[:, : problem.plane.dimensions], axis=1).max())
    return 0.0
