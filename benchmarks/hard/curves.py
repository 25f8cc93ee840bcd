"""Start shapes: curves of given length from their tangents, and the faults of curves seen by a camera."""

import numpy as np
from scipy.interpolate import make_lsq_spline

from benchmarks.hard.draft import Draft, Floats, Rng, Room, chance, pick, spread
from dlocore import ControlPoints, Points, Straight
from dlocore.spline import DEGREE, uniform_knots

SAMPLES = 96  # points on a curve
FINE = 4 * SAMPLES  # ... on a curve with a sharp bend
SMOOTH = {"arc", "inflections", "nearly straight"}  # kinds that a spline of few control points can follow


def along(tangents: Floats, length: float) -> Floats:
    """Return points (k + 1, 3) from the origin, in steps along unit tangents (k, 3)."""
    steps = tangents / np.linalg.norm(tangents, axis=1, keepdims=True) * (length / len(tangents))
    return np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])


def turning(angle: Floats, room: Room, length: float) -> Floats:
    """Return points of a plane curve from the angle of its tangent (k,) [rad]."""
    across = 2 if room == "upright" else 1
    tangents = np.zeros((len(angle), 3))
    tangents[:, 0], tangents[:, across] = np.cos(angle), np.sin(angle)
    return along(tangents, length)


def _middles() -> Floats:
    return (np.arange(SAMPLES) + 0.5) / SAMPLES


def arc(length: float, angle: float, room: Room) -> Floats:
    """Return an arc that turns by `angle` [rad] and is level at its middle."""
    return turning(angle * (_middles() - 0.5), room, length)


def bend(length: float, angle: float, width: float, at: float) -> Floats:
    """Return a straight curve that turns left by `angle` [rad], over `width` [m] around `at` [m]."""
    middles = (np.arange(FINE) + 0.5) * length / FINE
    return turning(angle * np.clip((middles - at) / width + 0.5, 0.0, 1.0), "flat", length)


def wave(length: float, angle: float, turns: float, room: Room) -> Floats:
    """Return a curve with inflections whose tangent swings by +- `angle` [rad]."""
    return turning(angle * np.sin(2 * np.pi * turns * _middles()), room, length)


def hairpin(length: float, width: float, room: Room) -> Floats:
    """Return two straight strands `width` [m] apart, connected by a half circle."""
    s = (_middles() - 0.5) * length / (0.5 * np.pi * width)  # -0.5 to 0.5 on the half circle
    return turning(np.pi * (np.clip(s, -0.5, 0.5) + 0.5), room, length)


def loop(length: float, share: float, gap: float, room: Room) -> Floats:
    """Return a straight curve with one full loop in its middle `share`, whose strands pass `gap` [m] apart.

    The tangent turns as smoothly as in minimum-jerk motion: a cable with a bent rest shape would remember a kink.
    """
    s = np.clip((_middles() - 0.5) / share + 0.5, 0.0, 1.0)
    angle = 2 * np.pi * s**3 * (10 - 15 * s + 6 * s**2)
    tangents = np.zeros((SAMPLES, 3))
    across, out = (2, 1) if room == "upright" else (1, 2)
    lift = gap / (share * length) * 30 * s**2 * (1 - s) ** 2
    tangents[:, 0], tangents[:, across], tangents[:, out] = np.cos(angle), np.sin(angle), lift
    return along(tangents, length)


def helix(length: float, turns: float, climb: float) -> Floats:
    angle = 2 * np.pi * turns * _middles()
    return along(np.column_stack([np.cos(angle), np.sin(angle), np.full(SAMPLES, climb)]), length)


def corner(length: float, angle: float, at: float, room: Room) -> Floats:
    """Return a polyline with one corner of `angle` [rad] at the share `at` of its length."""
    return turning(np.where(_middles() < at, 0.0, angle), room, length)


def as_seen(r: Rng, d: Draft, points: Floats) -> Points:
    """Return points as a start shape, sometimes with typical faults of measured points."""
    length = d.length
    fault = pick(r, {"none": 6, "stretched": 1, "repeated": 1, "uneven": 1, "noise": 1, "tiny": 1})
    if fault == "none":
        return Points(points=points)
    d.families.append(f"geometry: {fault} points")
    if fault == "stretched":
        points = points.mean(axis=0) + r.uniform(0.95, 1.05) * (points - points.mean(axis=0))
        if not apart(d):
            points = points * [1, 1, 0] + [0, 0, points[0, 2]]
    elif fault == "repeated":
        jitter = spread(r, 1e-12, 1e-6) * length
        twice = np.repeat(points, r.integers(1, 4, len(points)), axis=0)
        points = twice + jitter * _scatter(r, len(twice), d.room)
    elif fault == "uneven":
        kept = np.sort(r.choice(np.arange(1, len(points) - 1), len(points) // 2, replace=False))
        points = points[np.concatenate([[0], kept, [len(points) - 1]])]
    elif fault == "noise":
        points = points + spread(r, 1e-4, 2e-3) * length * _scatter(r, len(points), d.room)
    else:
        points = points + spread(r, 1e-14, 1e-9) * length * _scatter(r, len(points), d.room)
    return Points(points=points)


def as_spline(r: Rng, d: Draft, points: Floats) -> ControlPoints:
    """Return 4 to 20 unevenly spaced control points of a spline along points (k, 3), in space sometimes twisted."""
    x = np.linspace(0.0, 1.0, len(points))
    x += r.uniform(-0.7, 0.7) * np.sin(2.0 * np.pi * x) / (2.0 * np.pi)
    count, twist = int(r.integers(4, 21)), 0.0
    spline = make_lsq_spline(x, points, uniform_knots(count, 1.0), k=DEGREE)
    long = float(np.linalg.norm(np.diff(spline(np.linspace(0.0, 1.0, FINE)), axis=0), axis=1).sum())
    if d.room == "space" and chance(r, 0.2):
        d.families.append("geometry: twisted control points")
        twist = r.uniform(-3.0, 3.0)
    rows = np.column_stack([spline.c * d.length / long, twist * np.linspace(0.0, 1.0, count)])
    return ControlPoints(control_points=rows)


def _scatter(r: Rng, count: int, room: Room) -> Floats:
    free = {"flat": [1, 1, 0], "upright": [1, 0, 1], "space": [1, 1, 1]}[room]
    return r.normal(size=(count, 3)) * free


def apart(d: Draft) -> bool:
    """Tell whether strands that cross must keep apart; on a table one can lie over another."""
    return d.room != "flat" or d.gravity == 0.0


def start(r: Rng, d: Draft, *, straight: float = 0.35) -> None:
    """Draw a start shape of any kind; `straight` is the share of exactly straight ones."""
    length, room = d.length, d.room
    if chance(r, straight):
        direction = np.array([1.0, 0.0, 0.0])
        if room != "flat" and chance(r, 0.5):
            direction = np.array([0.0, 0.0, -1.0])
        d.shape = Straight(direction=direction)
        d.families.append("geometry: straight")
        if d.splined:
            d.shape = as_spline(r, d, length * np.outer(np.linspace(0.0, 1.0, SAMPLES), direction))
        return
    kind = pick(r, {"arc": 3, "inflections": 2, "hairpin": 1, "loop": 1, "cusp": 1, "nearly straight": 2, "helix": 1})
    if kind == "helix" and room != "space":
        kind = "arc"
    d.families.append(f"geometry: {kind}")
    if kind == "arc":
        points = arc(length, r.uniform(0.3, 4.0) * r.choice([-1, 1]), room)
    elif kind == "inflections":
        points = wave(length, r.uniform(0.1, 1.2), r.choice([1.0, 1.5, 2.0]), room)
    elif kind == "hairpin":
        points = hairpin(length, max(r.uniform(0.06, 0.25) * length, 4 * d.diameter), room)
    elif kind == "loop":
        points = loop(length, r.uniform(0.4, 0.8), 5 * d.diameter * apart(d), room)
    elif kind == "cusp":
        points = corner(length, r.uniform(1.0, 2.6), r.uniform(0.3, 0.7), room)
    elif kind == "nearly straight":
        points = wave(length, spread(r, 1e-12, 1e-3), r.choice([0.5, 1.0, 1.5]), room)
    else:
        points = helix(length, r.uniform(1.0, 3.0), max(r.uniform(0.2, 1.0), 8 * d.diameter / length))
    d.shape = as_spline(r, d, points) if d.splined and kind in SMOOTH else as_seen(r, d, points)
