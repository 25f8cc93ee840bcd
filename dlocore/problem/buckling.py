"""Imperfections that make cables buckle: straight ones under compression, and motions that may leave their plane.

A perfectly straight cable is in equilibrium however hard it is compressed, but no real cable stays straight. If a
disturbance would grow much, the cable gets the imperfection that columns are designed with: a stress-free bow of a
thousandth of its length.
"""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from dlocore.effects.distance import distances
from dlocore.problem.events import closed_grasps
from dlocore.problem.plane import FLATNESS, is_straight, leftwards, lies_on, natural_points, off_line, turns_of
from dlocore.problem.standing import obstacle_rows
from dlocore.problem.straightening import straightened
from dlocore.scene.paths import Move, Path, Still
from dlocore.scene.scene import Grasp, Scene
from dlocore.shape.shape import StartCurve, fit_to_knots
from dlocore.shape.transport import transported
from dlocore.spline import greville
from dlocore.words import in_mm

Floats = NDArray[np.float64]

BOW = 1e-3  # height, of the length of the part that buckles
UNSTABLE = "in its plane the motion is unstable, as disturbances out of the plane grow"
_AS_LIKELY = (
    "and its mirror image is as likely; with another bow the motion turns aside earlier or later, which the error "
    "estimate does not include"
)
GROWTH = math.log(10.0)  # of a disturbance, from which on a bow is needed
# Share of a force spread along a part with a free end that counts as a push at that end. For a column under its own
# weight, mu g L^3/EI = 7.84 against P L^2/EI = pi^2/4 (Greenhill, 1881)
_SPREAD = 0.315
_SPANS = 24  # knot spans of a bowed start, in each part
_AGES = 1e6  # times the horizon: as much time as any disturbance needs
_LEANS = 1025  # places along a start at which its frames are evaluated
_TIMES = 65  # times at which each stretch of the motion is evaluated
_SHORTEST, _WAVES = 64.0, 25  # largest wave number over the least one, and how many are evaluated
_RESTS = 1e-3  # of its largest speed: a part that slides more slowly counts as resting


@dataclass(frozen=True)
class _Part:
    """A part of the cable from `begin` to `end` [m], and for each end its grasp, or None if it is free.

    Parts are equal if their ends are, whichever grasps hold them: growth adds up over time, and each is bowed once.
    """

    begin: float
    end: float
    grasps: tuple[Grasp | None, Grasp | None] = field(compare=False)


def with_side(scene: Scene, start: StartCurve, at_rest: bool) -> StartCurve:
    """Return the start, with a bow if it is straight and the motion compresses it along its axis.

    The bow is to the left of the start's direction, horizontally; for a vertical start it is along the x axis. Several
    parts are bowed to alternating sides.

    A start that settles also counts as straight if it comes to rest on a line, or nearly so: a deviation from a line of
    up to a bow's height then counts as free of stress. The bow is on the side to which such a start deviates.

    Args:
        scene: the scene.
        start: start curve.
        at_rest: whether a disturbance has all the time that it needs to grow, because only an equilibrium is wanted.
    """
    given = start
    # a settled start that deviates from a line by less than a bow is straight: its direction is no more certain
    settles = scene.shape.settle and not is_straight(given)
    flat = BOW if settles else FLATNESS
    start = (_straightened(scene, given, flat) if settles else None) or given
    along = _line(scene, start, flat)
    if along is None:
        return given
    pushed = [part for part, growth in _growths(scene, start, along, at_rest).items() if growth > GROWTH]
    if not pushed:
        return given
    bowed = list(dict.fromkeys(piece for part in pushed for piece in _pieces(scene, part)))
    knots = _knots(bowed, scene.cable.length)
    u = greville(knots)
    # on alternating sides: beyond a grasp that lets the cable turn it bends the other way
    aside = np.sum([(-1) ** k * _bow(part, u) for k, part in enumerate(bowed)], axis=0)
    left = leftwards(along)
    if float(np.mean((given.control_points - given.control_points[0]) @ left)) < -FLATNESS * scene.cable.length:
        aside *= -1.0
    control = fit_to_knots(start, knots) + np.outer(aside, left)
    return replace(start, knots=knots, control_points=control, bow=float(aside[np.abs(aside).argmax()]))


def _straightened(scene: Scene, start: StartCurve, flat: float) -> StartCurve | None:
    """Return the straight line on which a start that settles comes to rest, or None if it does not; see `_line`."""
    straight = straightened(scene, start, _gravity(scene, start))
    along = None if straight is None else _line(scene, straight, flat)
    if straight is None or along is None:
        return None
    held = tuple(replace(g, path=Still()) for g in scene.grasps if g.start == 0.0)
    at_rest, times = replace(scene, grasps=held), np.array([0.0, cast(float, scene.horizon)])
    for part in _parts(sorted(held, key=lambda g: g.u), scene.cable.length):
        loaded = _loaded(at_rest, straight, along, part, times)
        if _buckles(scene, part, loaded.push, loaded.torque)[0]:
            return None
    return straight


def out_of_plane(scene: Scene, start: StartCurve, normal: Floats) -> StartCurve:
    """Return a planar start, bowed along the unit normal (3,) of its plane."""
    length = scene.cable.length
    parts = list(_parts(sorted(scene.grasps, key=lambda g: g.u), length))
    knots = _joined(start.knots, _knots(parts, length))
    u = greville(knots)
    # a start that buckles has a bow already: the small second one only shows whether it leaves the plane of the first
    aside = np.sum([_bow(part, u) for part in parts], axis=0) * (BOW if start.bow else 1.0)
    control = fit_to_knots(start, knots) + np.outer(aside, normal)
    bowed = replace(start, knots=knots, control_points=control, aside=float(aside.max()))
    if start.material is None and isinstance(scene.cable.rest_shape, str):
        return bowed  # its stress-free shape has no bends of its own
    level = _off_level(start, bowed) if start.material is None else 0.0
    return replace(bowed, lean=level - _lean(scene, bowed, normal))


def _off_level(start: StartCurve, bowed: StartCurve) -> float:
    """Return the angle by which a bow turns a section that was level at u = 0 out of level [rad].

    If the tangent is near the vertical a small bow is enough, since the level direction across it changes quickly.
    """
    before, after = (curve(0.0, 1)[0] / np.linalg.norm(curve(0.0, 1)[0]) for curve in (start, bowed))
    carried, level = transported(before, after, leftwards(before)), leftwards(after)
    return math.atan2(float(np.cross(after, level) @ carried), float(level @ carried))


def _lean(scene: Scene, curve: StartCurve, normal: Floats) -> float:
    """Return the angle [rad] by which frames without twist, level at u = 0, lean out of a plane at the grasps.

    With tangent t and unit normal N of the plane they lean by f about t, f' = -(t . N) N . (t x t')/(1 - (t . N)^2).
    If sections were placed in such frames, level at u = 0 only, the result would depend on which end has u = 0.
    The angle is the mean over the clamps, which keep sections as they are; without clamps over all grasps; without
    grasps over the two ends.
    """
    u = np.linspace(0.0, scene.cable.length, _LEANS)
    first, second = curve(u, 1), curve(u, 2)
    speed = np.linalg.norm(first, axis=1)
    out = first @ normal / speed
    rate = -out * (np.cross(first, second) @ normal) / speed**2 / (1.0 - out**2)
    lean = np.concatenate([[0.0], np.cumsum(0.5 * (rate[1:] + rate[:-1]) * np.diff(u))])
    clamps = [g.u for g in scene.grasps if g.hold == "clamp"]
    places = clamps or [g.u for g in scene.grasps] or [0.0, scene.cable.length]
    return float(np.interp(places, u, lean).mean())


def _joined(a: Floats, b: Floats) -> Floats:
    """Return clamped knots that contain those of two others, each with the larger of its two multiplicities."""
    places = np.unique(np.round(np.concatenate([a, b]) / a[-1], 9)) * a[-1]
    near = 1e-9 * a[-1]
    counts = [max(int((np.abs(knots - x) <= near).sum()) for knots in (a, b)) for x in places]
    return np.repeat(places, counts)


def _knots(parts: list[_Part], length: float) -> Floats:
    """Return clamped knots, triple at inner ends of parts, so that the points that grasps hold stay on the line."""
    marks = sorted({0.0, length, *(x for part in parts for x in (part.begin, part.end))})
    knots = [np.zeros(4)]
    for a, b in pairwise(marks):
        knots += [np.linspace(a, b, _SPANS + 1)[1:-1], np.full(3, b)]
    return np.append(np.concatenate(knots), length)


def side_notes(start: StartCurve) -> list[str]:
    """Return notes on a start that was given a bow."""
    notes = []
    if start.bow:
        side = "left" if start.bow > 0.0 else "right"
        bow = f"it starts with a bow of {in_mm(abs(start.bow))} to its {side}, {_AS_LIKELY}"
        why = "the straight cable is compressed or twisted along its axis and has no side to buckle to"
        notes.append(f"{why}: {bow}")
    if start.aside:
        bow = f"it starts with a bow of {in_mm(start.aside)} out of it, {_AS_LIKELY}"
        notes.append(f"{'the cable may leave the plane of its bow' if start.bow else UNSTABLE}: {bow}")
    return notes


def _bow(part: _Part, u: Floats) -> Floats:
    """Return the offset of the bow of a part at u (k,) [m]; its slope is zero where a grasp may hold the direction."""
    length = part.end - part.begin
    x = np.clip((u - part.begin) / length, 0.0, 1.0)
    if None not in part.grasps or part.grasps == (None, None):
        shape = 0.5 * (1.0 - np.cos(2.0 * np.pi * x))
    else:
        shape = 1.0 - np.cos(0.5 * np.pi * (x if part.grasps[1] is None else 1.0 - x))
    return np.asarray(BOW * length * shape)


def _line(scene: Scene, start: StartCurve, flat: float) -> Floats | None:
    """Return the direction (3,) of a straight start, or None.

    It is None if the start, a path, a force or the stress-free shape leads off the line by more than a part `flat`.
    """
    chord = start.control_points[-1] - start.control_points[0]
    size = math.sqrt(chord @ chord)
    if not size > 0.5 * scene.cable.length:
        return None
    along = chord / size
    if any(_aside(g.path, g.u, start, along, scene.cable.length, flat) for g in scene.grasps):
        return None
    forces = [_gravity(scene, start)[None], *(np.atleast_2d(cast(Floats, load.force)) for load in scene.loads)]
    if start.velocity is not None:
        forces.append(start.velocity.control_points)
    if any(off_line(vectors, along) > flat * float(np.abs(vectors).max()) for vectors in forces):
        return None
    natural, material = natural_points(scene), start.material
    if natural is not None and off_line(natural - natural[0], natural[-1] - natural[0]) > FLATNESS * scene.cable.length:
        return None
    if material is not None and bool(cast(Floats, material.memory)[:, :2].any()):
        return None
    straight = off_line(start.control_points - start.control_points[0], along) <= flat * size
    return np.asarray(along) if straight else None


def _aside(path: Path, u: float, start: StartCurve, along: Floats, length: float, flat: float) -> bool:
    """Return whether the path of a grasp at u [m] moves or turns the cable off its line by more than a part `flat`."""
    if isinstance(path, Still):
        return False
    if isinstance(path, Move):
        x, y, z = cast(Floats, path.displacement).tolist()
        a, b, c = along.tolist()
        if abs(y * c - z * b) + abs(z * a - x * c) + abs(x * b - y * a) > flat * length:
            return True
    else:
        from_start = path.at(np.linspace(0.0, path.duration, _TIMES), start(u)[0]) - start(u)[0]
        if off_line(from_start, along) > flat * length:
            return True
    turns = turns_of(path, _TIMES)
    return turns is not None and bool(np.abs(turns @ along - along).max() > flat)


def _gravity(scene: Scene, start: StartCurve) -> Floats:
    """Return the part of gravity (3,) [m/s^2] that a table under the cable does not carry."""
    table = scene.environment.table
    g = cast(Floats, scene.environment.gravity)
    if scene.effects.get("gravity", "auto") == "off":
        return np.zeros(3)
    if table is not None and scene.effects.get("table", "auto") != "off" and lies_on(table, scene, start):
        return np.array([g[0], g[1], 0.0])
    return g


def _growths(scene: Scene, start: StartCurve, along: Floats, at_rest: bool) -> dict[_Part, float]:
    """Return, for the parts of a straight cable, the approximate natural logarithm of the growth of a disturbance.

    Under a push P and a torque M a wave of wave number k grows at the rate s with
    mu s^2 + c s = M k^3 + P k^2 - EI k^4, where c is the resistance to sideways motion. Friction mu_f N of a part that
    slides at a speed v contributes mu_f N/v to c. The rate of the fastest wave is integrated over the time in which the
    part is unstable, P + M^2/(4 EI) > pi^2 EI/l^2 (Greenhill, 1883).
    """
    cable, horizon = scene.cable, cast(float, scene.horizon)
    patience = _AGES if at_rest else 1.0
    mu, EI = cable.linear_density, cast(float, cable.bending_stiffness)
    rubs = 0.0 if at_rest else _friction(scene, start)
    times = {0.0, horizon}
    for g in scene.grasps:
        times |= {t for t in (g.start, g.release_time or 0.0) if t < horizon}
    growths: dict[_Part, float] = {}
    for a, b in pairwise(sorted(times)):
        held = closed_grasps(scene, a, b)
        t = np.linspace(a, b, _TIMES)
        for part in _parts(sorted(held, key=lambda g: g.u), cable.length):
            push, beside, torque, c = _loaded(scene, start, along, part, t, rubs)
            k = (3.0 * torque + np.sqrt(9.0 * torque**2 + 32.0 * EI * push)) / (8.0 * EI)
            k = np.maximum(k, _least_wave_number(part))
            drive = np.where(_buckles(scene, part, push, torque), torque * k**3 + push * k**2 - EI * k**4, 0.0)
            # a push that is spread along a part is larger near the grasp that holds it; shorter waves feel more of it
            waves = _least_wave_number(part) * np.geomspace(1.0, _SHORTEST, _WAVES)[:, None]
            pushes = beside * (1.0 - (1.0 - _SPREAD) * waves[0] / waves)
            shorter = np.where(push > 0.0, (pushes * waves**2 - EI * waves**4).max(axis=0), 0.0)
            drive = np.maximum(np.maximum(drive, shorter), 0.0)
            rate = 2.0 * drive / np.maximum(c + np.sqrt(c**2 + 4.0 * mu * drive), 1e-300)
            growth = float(np.sum(0.5 * (rate[1:] + rate[:-1]) * np.diff(t)))
            growths[part] = growths.get(part, 0.0) + patience * growth
    return growths


def _buckles(scene: Scene, part: _Part, push: Floats, torque: Floats) -> NDArray[np.bool_]:
    """Return whether a push (k,) [N] and a torque (k,) [N m] make a straight part buckle."""
    EI = cast(float, scene.cable.bending_stiffness)
    return push + torque**2 / (4.0 * EI) > EI * _least_wave_number(part) ** 2


def _least_wave_number(part: _Part) -> float:
    """Return the wave number of the longest buckling mode of a part [1/m]."""
    length = part.end - part.begin
    return math.pi / (length if None not in part.grasps else 2.0 * length)


def _parts(held: list[Grasp], length: float) -> Iterator[_Part]:
    return _between([(0.0, None), *((g.u, g) for g in held), (length, None)], length)


def _pieces(scene: Scene, part: _Part) -> Iterator[_Part]:
    """Return the pieces of a part between the grasps of t = 0, which hold the start as given, not on a bow."""
    length = scene.cable.length
    inside = [g for g in scene.grasps if g.start == 0.0 and part.begin < g.u < part.end]
    held = [(g.u, g) for g in sorted(inside, key=lambda g: g.u)]
    return _between([(part.begin, part.grasps[0]), *held, (part.end, part.grasps[1])], length)


def _between(ends: Sequence[tuple[float, Grasp | None]], length: float) -> Iterator[_Part]:
    for (begin, first), (end, second) in pairwise(ends):
        if end - begin > FLATNESS * length:
            yield _Part(begin, end, (first, second))


def _friction(scene: Scene, start: StartCurve) -> float:
    """Return the deceleration by friction of a start that slides on the table [m/s^2]."""
    table, switch = scene.environment.table, scene.effects.get
    if table is None or "off" in (switch("table"), switch("friction")) or not lies_on(table, scene, start):
        return 0.0
    return table.friction * abs(float(cast(Floats, scene.environment.gravity)[2]))


class _Loaded(NamedTuple):
    """The loads on a part of a straight cable, over time.

    Attributes:
        push: largest compression along it (k,) [N], 0 under tension; of a spread push the share that counts.
        beside: for a push spread along a part with a free end, its value at the held end (k,) [N]; otherwise 0.
        torque: (k,) [N m].
        aside: resistance to sideways motion (k,) [N s/m^2].
    """

    push: Floats
    beside: Floats
    torque: Floats
    aside: Floats


def _loaded(scene: Scene, start: StartCurve, along: Floats, part: _Part, t: Floats, rubs: float = 0.0) -> _Loaded:
    """Return the loads on a part at times t (k,) [s].

    A cable that keeps its length moves with the grasp that holds it. It is compressed between two grasps that approach
    each other, or between a grasp and an object that its free end meets. Friction slows a sliding part by `rubs`
    [m/s^2].
    """
    cable, around = scene.cable, scene.environment
    aside = np.full(len(t), around.drag)
    first, second = part.grasps
    length = part.end - part.begin
    loads = [(load.u, load.at(t, t[-1]) @ along) for load in scene.loads if part.begin <= load.u <= part.end]
    fall = float(_gravity(scene, start) @ along)
    weight = cable.linear_density * fall
    holder = first or second
    inside = [one for one in cable.point_masses if part.begin <= one.u <= part.end]
    heavy = [one for one in inside if holder is None or one.u != holder.u]
    if holder is None:
        mass = cable.linear_density * length + sum(one.mass for one in heavy)
        pulled = fall + sum(force for _, force in loads) / mass + np.zeros(len(t))
        way = _free_way(start, along, pulled, t)
        needed = cable.linear_density * pulled - weight
    else:
        way = _way(holder, start, along, t)
        v = np.gradient(way, t)
        speed = np.abs(v)
        slides = np.maximum(speed, max(_RESTS * float(speed.max()), 1e-12))
        aside += around.drag_quadratic * speed + cable.linear_density * rubs / slides
        pulled = np.gradient(v, t) + rubs * v / slides
        needed = cable.linear_density * pulled + (around.drag + around.drag_quadratic * speed) * v - weight
    loads += [(one.u, one.mass * (fall - pulled)) for one in heavy]
    if first is not None and second is not None:
        apart = _way(second, start, along, t) - _way(first, start, along, t)
        met = np.array([max(first.start, second.start)])
        closer = float((_way(second, start, along, met) - _way(first, start, along, met))[0]) - apart
        if scene.shape.settle and met == 0.0:
            closer += length - _way_along(start, part)
        elastic = cast(float, cable.axial_stiffness) * closer / length
        push = elastic + 0.5 * np.abs(needed) * length + np.sum([np.abs(force) for _, force in loads], axis=0)
        turned = np.abs(_spin(second, along, t) - _spin(first, along, t) + _twist(start, part))
        both = first.hold == second.hold == "clamp" and scene.effects.get("twist", "auto") != "off"
        torque = cast(float, cable.torsional_stiffness) * turned / length if both else np.zeros(len(t))
        return _Loaded(np.maximum(push, 0.0), np.zeros(len(t)), torque, aside)
    # each place pushes the part beyond it, up to the free end: find the largest push, load by load from that end
    from_end = second is None
    most = cast(float, cable.axial_stiffness) * _depth(scene, start, along, part, way) / length
    for u in [u for u, _ in loads] + [part.begin if from_end else part.end]:
        rest = (part.end - u) if from_end else (u - part.begin)
        for there in (True, False):  # on the two sides of a load
            beyond = [f for v, f in loads if (v > u if from_end else v < u) or (there and v == u)]
            push = _SPREAD * needed * rest - np.sum(beyond, axis=0)
            most = np.maximum(most, push if from_end else -push)
    spread = np.zeros(len(t)) if holder is None else needed * length * (1.0 if from_end else -1.0)
    return _Loaded(most, np.maximum(spread, 0.0), np.zeros(len(t)), aside)


def _way(grasp: Grasp, start: StartCurve, along: Floats, t: Floats) -> Floats:
    """Return how far a grasp has moved along a direction at times t (k,) [s]; (k,) [m]."""
    return (grasp.path.at(t - grasp.start, start(grasp.u)[0]) - start(grasp.u)[0]) @ along


def _way_along(start: StartCurve, part: _Part) -> float:
    """Return the length of the start between the ends of a part [m]."""
    return float(np.linalg.norm(np.diff(start(np.linspace(part.begin, part.end, _TIMES)), axis=0), axis=1).sum())


def _free_way(start: StartCurve, along: Floats, acceleration: Floats, t: Floats) -> Floats:
    """Return how far a cable that nothing holds has moved along its direction at times t (k,) [s]; (k,) [m]."""
    velocity = 0.0 if start.velocity is None else float(start.velocity.control_points.mean(axis=0) @ along)
    return velocity * t + 0.5 * acceleration * t**2


def _depth(scene: Scene, start: StartCurve, along: Floats, part: _Part, way: Floats) -> Floats:
    """Return how deep the free ends of a part would be in the table or an obstacle after moving `way` (k,) [m]."""
    environment, radius = scene.environment, 0.5 * scene.cable.diameter
    on = {name for name in ("table", "obstacles") if scene.effects.get(name, "auto") != "off"}
    deepest = np.zeros(len(way))
    for u, grasp in zip((part.begin, part.end), part.grasps, strict=True):
        if grasp is not None:
            continue
        end = start(u)[0] + np.outer(way, along)
        if environment.table is not None and "table" in on:
            deepest = np.maximum(deepest, environment.table.height - end[:, 2])
        if environment.obstacles and "obstacles" in on:
            rows = obstacle_rows(scene, environment.obstacles)
            deepest = np.maximum(deepest, radius - distances(rows, end).min(axis=1))
    return deepest


def _twist(start: StartCurve, part: _Part) -> float:
    """Return the angle by which the section at the end of a part is turned against that at its start [rad]."""
    return 0.0 if start.theta is None else float(np.diff(start.theta([part.begin, part.end])[:, 0])[0])


def _spin(grasp: Grasp, along: Floats, t: Floats) -> Floats:
    """Return the angle by which a grasp has turned about a direction since t[0] at times t (k,) [s]; (k,) [rad]."""
    spins = grasp.path.spin(t - grasp.start, np.tile(along, (len(t), 1)))
    return np.concatenate([[0.0], np.cumsum(spins)])
