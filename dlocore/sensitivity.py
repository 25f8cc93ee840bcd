"""Derivatives of a predicted motion by parameters of its scene (docs/identification.md).

Every step of a march solves R(q, v, a, past; parameter) = 0. The derivative of the motion obeys the linearised step,
whose matrix is the step's own Newton matrix. No new march is needed: two neighbouring motions, with the parameter a
little larger and a little smaller, are solved to rounding with the factors of the known motion's steps, and their
difference is taken. This differentiates the converged discrete system directly. It covers everything that depends on
the parameter (knots under a grasp that moves, the start, weights, the past of the strain), and contains no noise of a
solver's tolerance. The remaining error is that of a central difference of a smooth function over a relative step of
1e-4: about 1e-7 of the derivative.

A parameter that may be 0 is changed by at least 1e-6 of its natural scale, for example the length of the cable. A
relative change of a value that happens to be 1e-12 would be lost in rounding.
"""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from itertools import pairwise
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dlocore.answer.report import surface_of
from dlocore.compiling.interrupts import interruptible
from dlocore.errors import SceneError, instance, instances
from dlocore.kernels.sensitivity import factor_steps, follow_steps
from dlocore.kernels.timefit import fit_time
from dlocore.levels.level import stiffened
from dlocore.prediction import Prediction
from dlocore.problem.discretisation import applied_forces, applied_in_steps
from dlocore.problem.events import closed_grasps
from dlocore.problem.features import SAME, longest_tip
from dlocore.problem.grid import Grid
from dlocore.problem.holding import Starts
from dlocore.problem.problem import Problem, pose, stiffer
from dlocore.problem.time_grid import marks_of
from dlocore.scene.scene import Grasp, Scene
from dlocore.solvers.march import March, march
from dlocore.solvers.monitor import Monitor
from dlocore.solvers.stretch import Entry, enter, with_what_lasts
from dlocore.solvers.watched import watched
from dlocore.spline import SplineSurface, in_range
from dlocore.stability.sideways import pose_as_shown
from dlocore.statics.statics import start_grid

Floats = NDArray[np.float64]

STEP = 1e-4  # relative, of the parameter: the error of the difference is its square
COARSE_STEP = 1e-2  # if whole marches are compared: their kinks would drown a smaller step
SETTLED_STEP = 1e-3  # if that is because the start settles: nearly to rounding, but a taut one is far from linear
LEAST = 0.01  # of the natural scale of a parameter that may be 0: a smaller value is changed as if it were that
SLIGHT = 0.1  # the natural scale of a strain
_FITTED = ("shape.points[", "cable.rest_shape[")  # coordinates that a curve is fitted through
_FITTED_STEP = 3e-3  # of the length, for those: at any change the choice of smoothness moves the curve by a millionth
_OFF_END = 1e-3  # of the length, at least: distance from an end of the places compared instead of one at the end
_OF_WAY = 0.25  # of the way to the next grasp, load or point mass: largest change of a place
_FOLLOWED = 1e-12  # of the length: tolerance on the last update of a step of a neighbouring motion
_STRAYED = 1e-8  # of the length: a step whose last update is larger counts as not solved


@dataclass(frozen=True, eq=False)
class Stretch:
    """A smooth stretch of a known motion: its steps, from `first` to `last`, and their factors.

    If it begins with a jump, its first step is by backward Euler.
    """

    begin: float
    end: float
    first: int
    last: int
    jumps: bool
    factors: Floats


@dataclass(frozen=True, eq=False)
class KnownMotion:
    """A marched motion whose steps are factorised, so that neighbouring motions can be solved with the factors.

    Attributes:
        motion: the march.
        stretches: one between each two successive events.
        softened: number of steps whose tangent is not positive definite; its positive part is used for them.
    """

    motion: March
    stretches: tuple[Stretch, ...]
    softened: int


def objection(problem: Problem, motion: March) -> str:
    """Return why the steps of a motion can't be differentiated one by one, "" if they can."""
    for name in ("contact", "self_contact", "friction"):
        if getattr(problem, name) is not None:
            return f"{name.replace('_', '-')} has kinks, and steps with an impact are solved in another way"
    if motion.stopped:
        return "the motion stopped before its end"
    if motion.split:
        return "some steps had to be split to converge"
    if len(motion.times) <= motion.steps:
        return "not all of its states were kept"
    return ""


def factored(problem: Problem, motion: March) -> KnownMotion:
    """Return the motion with its steps factorised.

    Raises:
        ValueError: `objection` returns a reason against it, or the tangent of a step is singular.
    """
    if objection(problem, motion):
        raise ValueError(objection(problem, motion))
    grid, states = motion.grid, motion.states
    active, parameters = problem.law_table()
    density, dragged = problem.mass_density(), problem.drag_coefficient()
    history, starts, stretches = grid.past(), cast(Starts, {}), []
    v, softened = grid.velocity.copy(), 0
    for begin, end, first, last in _stretches(problem, motion.times):
        h = (end - begin) / (last - first)
        entry, a, _ = _enter(problem, grid, starts, motion.times, first, last, states[first], v, history)
        v = entry.v.copy()
        free = states[0].size - len(entry.held.elimination.held)
        factors = np.empty((last - first, free, entry.held.elimination.width))
        part = np.ascontiguousarray(states[first : last + 1])
        found = factor_steps(
            problem.axes, entry.jumps, h, motion.rho, part, v, a, density, dragged, grid.tables, active, parameters,
            history, entry.held.elimination, factors,
        )  # fmt: skip
        if found < 0:
            raise ValueError("the tangent of a step is singular")
        softened += int(found)
        stretches.append(Stretch(begin, end, first, last, entry.jumps, factors))
    return KnownMotion(motion, tuple(stretches), softened)


def beside(known: KnownMotion, problem: Problem, grid: Grid) -> tuple[Floats, Floats, Floats]:
    """Return the motion of a problem that differs a little from the known one.

    Args:
        known: the known motion.
        problem: the changed problem, with the same effects and events; the events may be at slightly different times.
        grid: its grid, with as many control points.

    Returns:
        States (steps + 1, n_u, nc) [m], their times (steps + 1,) [s] and the velocity after t = 0.

    Raises:
        ValueError: the problem has other effects or events, or its motion differs too much from the known one.
    """
    states = np.empty_like(known.motion.states)
    if problem.nc != states.shape[2]:
        raise ValueError("the motion with the changed parameter has other effects, or leaves its plane")
    states[0] = grid.start
    times = known.motion.times.copy()
    active, parameters = problem.law_table()
    density, dragged = problem.mass_density(), problem.drag_coefficient()
    history, starts, v = grid.past(), cast(Starts, {}), grid.velocity.copy()
    length = problem.scene.cable.length
    velocity = v
    marks = marks_of(problem)
    if len(marks) != len(known.stretches) + 1:
        raise ValueError("the change of the parameter adds an event to the motion, or removes one")
    for stretch, (begin, end) in zip(known.stretches, pairwise(marks), strict=True):
        first, last = stretch.first, stretch.last
        times[first : last + 1] = np.linspace(begin, end, last - first + 1)
        h = (end - begin) / (last - first)
        entry, a, G = _enter(problem, grid, starts, times, first, last, states[first], v, history)
        v = entry.v.copy()
        applied = applied_in_steps(problem, grid, times[first : last + 1], begin, end)
        left = follow_steps(
            problem.axes, stretch.jumps, h, known.motion.rho, _FOLLOWED * length,
            known.motion.states[first : last + 1], stretch.factors, states[first : last + 1], v, a, G, density, dragged,
            grid.tables, active, parameters, history, applied, entry.held.elimination, entry.offsets,
        )  # fmt: skip
        if not left <= _STRAYED * length:
            raise ValueError("the motion with the changed parameter differs too much, for example is in another plane")
        velocity = entry.velocity(states[0], states[1], h, times[1]) if first == 0 else velocity
    return states, times, velocity


def _stretches(problem: Problem, times: Floats) -> list[tuple[float, float, int, int]]:
    marks = marks_of(problem)
    at = [int(np.argmin(np.abs(times - mark))) for mark in marks]
    return [(*pairs, *steps) for pairs, steps in zip(pairwise(marks), pairwise(at), strict=True)]


def _enter(
    problem: Problem, grid: Grid, starts: Starts, times: Floats, first: int, last: int, q: Floats, v: Floats,
    history: Any,
) -> tuple[Entry, Floats, Floats]:  # fmt: skip
    """Close the grasps of the stretch from step `first` to `last` of `times` (steps + 1,) [s].

    Returns:
        The entry into the stretch, and the acceleration [m/s^2] and forces [N], each (n_u, nc), at its first step.
    """
    own = times[first : last + 1]
    load = applied_forces(problem, grid, own[:1])[0]
    grasps = closed_grasps(problem.scene, float(own[0]), float(own[-1]))
    h = float(own[-1] - own[0]) / (last - first)
    before = float(times[first] - times[first - 1]) if first > 0 else 0.0
    q = np.ascontiguousarray(q)
    entry = enter(problem, grid, grasps, starts, own, h, before, q, v, history, load)
    a, G = with_what_lasts(problem, grid, entry, entry.a, h, q, history)
    return entry, a, G


@dataclass(frozen=True, kw_only=True, eq=False)
class Sensitivities:
    """Derivatives of a predicted motion by parameters of its scene.

    Attributes:
        names: the parameters.
        exact: for each parameter, whether it was differentiated step by step; otherwise whole marches were compared.
        reason: for each parameter, why it is not exact; "" if it is.
        steps: for each parameter, half the difference of its values in `above` and `below`.
        above, below: for each parameter, the motions with it a little larger and a little smaller. If the parameter is
            at a limit, such as a drag of zero, one of them is the predicted motion itself, and the derivative is
            one-sided. For a place near an end both places may lie further inward.
    """

    names: tuple[str, ...]
    exact: tuple[bool, ...]
    reason: tuple[str, ...]
    steps: tuple[float, ...]
    above: tuple[SplineSurface, ...]
    below: tuple[SplineSurface, ...]

    def __repr__(self) -> str:
        return f"<Sensitivities by {', '.join(self.names) or 'nothing'}>"

    def __call__(self, u: ArrayLike, t: ArrayLike) -> Floats:
        """Return dr/dparameter on the grid of t (m,) [s] and u (k,) [m]; (parameters, m, k, 3) [m per its unit].

        Derivatives by the length of the cable, or by the horizon, are read where both motions exist: the value at the
        very end is that one change of the parameter before the end.

        Raises:
            SceneError: a coordinate is off the cable, or a time outside the predicted time.
        """
        surfaces = (*self.above, *self.below)
        u = in_range("u", u, max((s.length for s in surfaces), default=np.inf), "m")
        t = in_range("t", t, max((s.horizon for s in surfaces), default=np.inf), "s")
        both = zip(self.above, self.below, self.steps, strict=True)
        found = [_difference(high, low, u, t) / (2.0 * step) for high, low, step in both]
        return np.array(found).reshape(len(self.names), len(t), len(u), 3)


@interruptible
def sensitivities(prediction: Prediction, wrt: Sequence[str]) -> Sensitivities:
    """Return the derivatives of a predicted motion by parameters of its scene.

    The prediction's march is differentiated step by step, on its grid and with the effects that it found. The result is
    exact up to about 1e-7 of the largest derivative, for a time spline whose knots move with events alone. If steps
    can't be differentiated (contact, friction, strands that touch, steps that had to be split), whole marches are
    compared instead, and `exact` and `reason` say so.

    A parameter at a limit, such as a drag of zero or the place of a grasp at an end, is changed to one side only. The
    relative error of the derivative is then about as large as the relative change of the derivative itself over that
    change of the parameter, a millionth of its natural scale.

    The knots for a grasp, load or point mass at an end of the cable differ from those for one a little away from the
    end. For one at an end, two motions are compared: with it at a thousandth of the length from the end, and at twice
    that. Both are nearer to the end if another grasp, load or point mass is close.

    Args:
        prediction: of the scene.
        wrt: numbers of the scene by their path, e.g. "cable.bending_stiffness", "environment.drag", "grasps[0].u",
            "grasps[0].path.displacement[1]", "shape.control_points[4][2]". Only that number is changed: stiffnesses
            that were derived from others keep their values.

    Raises:
        SceneError: a path does not lead to a number, or the number can be changed to neither side.
    """
    instance("prediction", prediction, Prediction, "a Prediction")
    wrt = instances("wrt", wrt, str, 'paths such as "cable.bending_stiffness"')
    scene, accuracy = prediction.scene, prediction.accuracy
    values = [_number(scene, name) for name in wrt]
    monitor = Monitor(None, None, None)
    problem, motion = _solved(prediction, monitor)
    hardness, knots_t = _hardness(prediction), prediction.surface.knots_t

    def begun(problem: Problem) -> Grid:
        """Return the start of a problem on a grid like the prediction's."""
        grid = start_grid(problem, accuracy.n_u, monitor)
        return watched(grid) if motion.grid.watched else grid

    objected = objection(problem, motion)
    known, coarse = None, COARSE_STEP
    if not objected and not scene.shape.settle:
        try:
            known = factored(problem, motion)
        except ValueError as error:
            objected = str(error)
    elif not objected:
        coarse = SETTLED_STEP
        objected = (
            "the start is an equilibrium found by iteration; whole marches are compared, with the parameter "
            f"{100.0 * coarse:g} % larger and smaller"
        )

    def around(name: str, value: float, changes: tuple[float, float]) -> list[tuple[float, Problem, Grid]]:
        """Return the problems and grids with a parameter changed, and its changes: unchanged if a change is refused."""
        found, refused = list[tuple[float, Problem, Grid]](), list[SceneError]()
        for change in changes:
            try:
                other = stiffer(pose(_with(scene, name, value + change), problem.called_for), hardness)
                found.append((change, other, begun(other)))
            except SceneError as error:
                refused.append(error)
                found.append((0.0, problem, motion.grid))
        if len(refused) == len(found):
            raise SceneError("wrt", name, "a number that can be changed a little", str(refused[0]).rstrip("."))
        return found

    above, below, reasons, widths = [], [], list[str](), []
    for name, value in zip(wrt, values, strict=True):
        size = max(abs(value), LEAST * _scale(scene, name))
        surfaces: list[SplineSurface] = []
        fitted = name.startswith(_FITTED)
        changes = _changes(scene, name, STEP * size)
        reason = objected
        if fitted:
            reason = "the fit through the points chooses its smoothness anew for each change"
        elif changes[0] != -changes[1]:
            reason = "a place at an end has other knots than one near the end"
        sides = [] if reason else around(name, value, changes)
        try:
            if known is not None and not reason:
                surfaces = [_surface(p, g, *beside(known, p, g), _moved(knots_t, problem, p)) for _, p, g in sides]
        except ValueError as error:
            reason = str(error)
        if reason:
            width = _FITTED_STEP * scene.cable.length if fitted else coarse * size
            sides = around(name, value, _changes(scene, name, width))
            marched = [(p, g, march(p, g, motion.asked, monitor, rho=motion.rho)) for _, p, g in sides]
            surfaces = [
                _surface(p, g, m.states, m.times, m.velocity, _moved(knots_t, problem, p)) for p, g, m in marched
            ]
        above.append(surfaces[0])
        below.append(surfaces[1])
        reasons.append(reason)
        widths.append(0.5 * (sides[0][0] - sides[1][0]))
    return Sensitivities(
        names=tuple(wrt), exact=tuple(not reason for reason in reasons), reason=tuple(reasons), steps=tuple(widths),
        above=tuple(above), below=tuple(below),
    )  # fmt: skip


def _solved(prediction: Prediction, monitor: Monitor) -> tuple[Problem, March]:
    """Return the problem of a prediction as it was solved, and its march, which is a new one for a reference."""
    level = prediction.level
    if level is not None:
        return level.problem, level.motion
    active = {report.name for report in prediction.effects if report.active}
    found = active & {"plasticity", "self_contact", "obstacles"}
    called = dict.fromkeys(sorted(found), "the prediction found it")
    problem = pose_as_shown(prediction.scene, called, prediction.surface.control_points)
    accuracy = prediction.accuracy
    return problem, march(problem, start_grid(problem, accuracy.n_u, monitor), accuracy.steps, monitor)


def _hardness(prediction: Prediction) -> float:
    """Return the factor by which contact had to be stiffer in the solve than posed."""
    return 1.0 if prediction.level is None else stiffened(prediction.level)


def _moved(knots_t: Floats, problem: Problem, other: Problem) -> Floats:
    """Return the time knots [s] for the motion of another problem, made from those of `problem`.

    They move with the events, or only with the end if the other has more or fewer events.
    """
    before, after = marks_of(problem), marks_of(other)
    if len(before) != len(after):
        before, after = before[:: len(before) - 1], after[:: len(after) - 1]
    return np.interp(knots_t, before, after)


def _surface(
    problem: Problem, grid: Grid, states: Floats, times: Floats, velocity: Floats, knots_t: Floats
) -> SplineSurface:
    """Return the bivariate spline of the centreline of marched states; theta is left out."""
    steps, n_u, nc = states.shape
    flat = fit_time(knots_t, times, states.reshape(steps, n_u * nc), velocity.reshape(-1))
    return surface_of(problem, grid.knots, knots_t, flat.reshape(len(knots_t) - 4, n_u, nc))


def _difference(high: SplineSurface, low: SplineSurface, u: Floats, t: Floats) -> Floats:
    """Return the differences of the positions (m, k, 3) [m] of two surfaces at u (k,) [m] and t (m,) [s]."""
    u, t = np.minimum(u, min(high.length, low.length)), np.minimum(t, min(high.horizon, low.horizon))
    return high.positions(u, t) - low.positions(u, t)


_STEP_OF_PATH = re.compile(r"([A-Za-z_]\w*)|\[(\d+)\]")


def _steps_of(path: str) -> list[str | int]:
    if not re.fullmatch(r"[A-Za-z_]\w*(\.[A-Za-z_]\w*|\[\d+\])*", path):
        raise SceneError("wrt", path, 'a path such as "cable.bending_stiffness" or "grasps[0].u"')
    return [int(index) if index else name for name, index in _STEP_OF_PATH.findall(path)]


def _part(scene: Scene, path: str) -> Any:
    """Return the part of the scene at a path."""
    value: Any = scene
    where = ""
    for step in _steps_of(path):
        try:
            value = value[step] if isinstance(step, int) else _field(value, step)
        except (AttributeError, IndexError, TypeError):
            raise _no_number(path, where or "The scene", value) from None
        where += f"[{step}]" if isinstance(step, int) else f".{step}" if where else step
    return value


def _no_number(path: str, where: str, value: Any) -> SceneError:
    """Return the error of a path that leads to no number; `value` is what lies at `where`."""
    if is_dataclass(value):
        what = f"has {', '.join(f.name for f in fields(value))}"
    elif isinstance(value, np.ndarray | tuple) and len(value):
        what = f"has [0] to [{len(value) - 1}]"
    else:
        what = f"is {value!r}"
    return SceneError("wrt", path, "the path of a number of the scene", f"{where} {what}")


def _number(scene: Scene, path: str) -> float:
    """Return the number at a path of the scene."""
    value = _part(scene, path)
    if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
        raise _no_number(path, "It", value)
    return float(value)


def _changes(scene: Scene, path: str, width: float) -> tuple[float, float]:
    """Return the two changes of the number at a path for which motions are compared: `width` up and down.

    A place near an end is an exception, in two cases: the tip beyond it would have a span of its own in only one of the
    two motions; or it has one in neither, and a held direction bends it, which doubles the derivative. The place is
    then moved to where the tip has its own span in both. No place passes, or comes near to, another grasp, load or
    point mass, because the motion has a kink there.
    """
    if path.endswith(".u"):
        part, length = _part(scene, path.removesuffix(".u")), scene.cable.length
        between = min((d for v in scene.places if (d := abs(v - part.u)) > SAME * length), default=math.inf)
        width = min(width, _OF_WAY * between)
        directed = isinstance(part, Grasp) and part.hold != "point"
        tip, longest = min(part.u, length - part.u), longest_tip(scene, part.u, directed)
        shorter = tip - width if width <= tip else tip
        if shorter <= longest and (directed or tip + width > longest):
            off = min(max(_OFF_END * length, 2.0 * longest), _OF_WAY * (tip + between))
            inward = (2.0 * off - tip, off - tip)
            return inward if part.u < 0.5 * length else (-inward[1], -inward[0])
    return width, -width


def _scale(scene: Scene, path: str) -> float:
    """Return the natural scale of the number at a path of the scene, in its unit.

    It is 0 for a number that can't be 0, such as a stiffness: only its own value counts then.
    """
    *before, last = _steps_of(path)
    field = next(step for step in (last, *reversed(before)) if isinstance(step, str))
    cable, time = scene.cable, min(cast(float, scene.horizon), scene.swing)
    length, mass = cable.length, cable.mass
    match field:
        case "control_points" | "velocity" if last == 3:
            return 1.0 if field == "control_points" else 1.0 / time
        case "u" | "start" | "end" | "center" | "height" | "control_points" | "knots" | "displacement" | "positions":
            return length
        case "times" | "grasp_time" | "release_time":
            return time
        case "velocity":
            return length / time
        case "gravity":
            return length / time**2
        case "force":
            return max(mass * length / time**2, cast(float, cable.bending_stiffness) / length**2)
        case "drag":
            return mass / length / time
        case "drag_quadratic":
            return mass / length**2
        case "axial_damping":  # about critical for its slowest wave
            return math.sqrt(mass * length * cast(float, cable.axial_stiffness))
        case "bending_damping" | "torsional_damping":
            return float(getattr(cable, field.replace("damping", "stiffness"))) * time
        case "memory" | "natural":
            return 1.0 / length
        case "stretch" | "strain":
            return SLIGHT
        case "direction" | "axis" | "director" | "orientation" | "orientations":
            return float(np.linalg.norm(_part(scene, path.rpartition("[")[0])))
        case "hardening" | "friction" | "rotation":
            return 1.0
    return 0.0


def _field(part: Any, name: str) -> Any:
    """Return a field of a part of the scene by name; derived properties can't be changed and are refused."""
    if not is_dataclass(part) or name not in {f.name for f in fields(part)}:
        raise AttributeError(name)
    return getattr(part, name)


def _with(part: Any, path: str, value: float) -> Any:
    """Return a part of a scene with the number at a path replaced."""

    def changed(part: Any, steps: list[str | int]) -> Any:
        if not steps:
            return value
        step, *rest = steps
        if isinstance(step, str):
            return replace(part, **{step: changed(_field(part, step), rest)})
        if isinstance(part, np.ndarray):
            out = part.copy()
            out[step] = changed(part[step], rest)
            return out
        items = list(part)
        items[step] = changed(items[step], rest)
        return type(part)(items)

    return changed(part, _steps_of(path))
