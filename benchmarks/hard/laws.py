"""Laws that every predicted motion obeys, measured on its surface and on the forces that it reports."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dlocore import Grasp, Prediction, Scene, Waypoints, energies
from dlocore.answer.compared import at_times
from dlocore.scene.paths import held_at
from dlocore.shape.shape import start_curve

Floats = NDArray[np.float64]

_LOOKS = 33  # times at which a law is evaluated
_NOTHING = 1e-3  # of the cable's own forces: anything smaller is no motion
_BEFORE = 1e-9  # of a stretch between two events: how far before its end the stretch is still evaluated
_SETTLE = 4  # steps after an event in which the forces of a jump decay
_TOUCH = {"friction", "obstacles", "table"}  # effects whose forces the reference does not report


@dataclass(frozen=True, kw_only=True)
class Measures:
    """Deviations of a motion from its laws; each is zero where the law holds exactly.

    Attributes:
        finite: whether every number of the answer is finite.
        strain: largest |axial strain| of the surface, averaged over a span.
        held: largest distance of a grasped point from its gripper, at the start and at the end of the motion [m].
        held_between: the same in between, where the time spline only approximates the path [m].
        energy: largest gain of energy that no gripper or load supplied, relative to the energies in the motion.
        momentum: largest impulse that no force accounts for, relative to the impulses in the motion. None where nothing
            holds the cable, or where an answer does not report all forces: strikes happen between the reported times.
    """

    finite: bool
    strain: float
    held: float
    held_between: float
    energy: float | None
    momentum: float | None


def measure(prediction: Prediction) -> Measures:
    """Measure a prediction against all laws."""
    if not is_finite(prediction):
        nan = float("nan")
        return Measures(finite=False, strain=nan, held=nan, held_between=nan, energy=None, momentum=None)
    at_ends, between = held(prediction)
    return Measures(
        finite=True,
        strain=strain(prediction),
        held=at_ends,
        held_between=between,
        energy=energy_gain(prediction),
        momentum=lost_impulse(prediction),
    )


def is_finite(prediction: Prediction) -> bool:
    surface = prediction.surface
    parts = [surface.control_points, surface.knots_u, surface.knots_t]
    parts += [x for g in prediction.grasps for x in (g.reaction, g.moment, g.times)]
    estimate = prediction.accuracy.error_estimate
    return all(np.isfinite(x).all() for x in parts) and (estimate is None or bool(np.isfinite(estimate)))


def strain(prediction: Prediction) -> float:
    """Return the largest |axial strain|, averaged over a span: within a span the derivative of a spline oscillates."""
    surface = prediction.surface
    u, w = along(surface.knots_u)
    slope = np.linalg.norm(surface(u, np.linspace(0.0, surface.horizon, _LOOKS), du=1)[..., :3], axis=-1)
    lengths = (w * slope).reshape(len(slope), -1, 4).sum(axis=-1)
    return float(np.abs(lengths / w.reshape(-1, 4).sum(axis=1) - 1.0).max())


def held(prediction: Prediction) -> tuple[float, float]:
    """Return how far grasped points are from their grippers, at both ends of the motion and in between [m]."""
    scene, surface = prediction.scene, prediction.surface
    start = start_curve(scene.shape, scene.cable.length)
    worst_end, worst = 0.0, 0.0
    for g in scene.grasps:
        end = min(g.release_time or surface.horizon, surface.horizon)
        if g.start >= end:
            continue
        t = np.linspace(g.start, end, _LOOKS)
        if g.start > 0.0:
            begin = surface.positions(g.u, g.start)[0, 0]  # the spline's approximation of where the march closed it
        else:
            settled = getattr(scene.shape, "settle", False) or scene.environment.table is not None
            begin = surface.positions(g.u, 0.0)[0, 0] if settled else start(g.u)[0]
        path = held_at(g.path, t - g.start, begin) if g.start > 0.0 else g.path.at(t, begin)
        away = np.linalg.norm(surface.positions(g.u, t)[:, 0] - path, axis=1)
        ends = away[(t == 0.0) | (t == surface.horizon)] if g.start == 0.0 else away[:0]
        worst_end, worst = max(worst_end, ends.max(initial=0.0)), max(worst, away.max())
    return float(worst_end), float(worst)


def energy_gain(prediction: Prediction) -> float | None:
    """Return the largest gain of energy beyond the work of grippers and loads, relative to the energies in the motion.

    It is evaluated in each stretch between two events, from a few steps after the first event on, as the impulse of a
    jump is not part of the reactions. The energy of stretch, which is never negative, counts only at the beginning: the
    time spline smooths out the strain of a nearly inextensible cable. None where the reactions are too coarse, because
    a path turns more often than there are steps.
    """
    scene, surface = prediction.scene, prediction.surface
    windows = [np.linspace(0.0, surface.horizon, _LOOKS)]
    if prediction.grasps:
        windows = windows_of(prediction.grasps[0].times)
    if any(isinstance(g.path, Waypoints) and len(np.asarray(g.path.times)) > len(windows[0]) for g in scene.grasps):
        return None
    worst, scale = 0.0, _NOTHING * sum(_own(scene)) * scene.cable.length
    for window in windows:
        times = window[_SETTLE:]
        if len(times) < 3:
            continue
        t = times[np.unique(np.linspace(0, len(times) - 1, _LOOKS).round().astype(int))]
        parts = energies(scene, surface, t, prediction.material)
        stored = parts.pop("stretch")[0]
        total = np.sum(list(parts.values()), axis=0)
        work = np.interp(t, times, _work(prediction, window)[_SETTLE:])
        gain = total - total[0] - stored - (work - work[0])
        largest = max(float(np.ptp(x)) for x in (work, *parts.values()))
        scale = max(scale, largest, float(parts["kinetic"].max()), float(parts["bend"].max()))
        worst = max(worst, float(gain.max()))
    return float(worst / scale)


def windows_of(times: Floats) -> list[Floats]:
    """Return the stretches of smooth motion between events; at an event the times of the reactions occur twice.

    Each stretch except the last ends slightly before its event: at the event itself a surface has the velocity after
    it.
    """
    windows = [times[part] for part in _parts(times)]
    for part in windows[:-1]:
        part[-1] -= _BEFORE * (part[-1] - part[0])
    return windows


def _parts(times: Floats) -> list[NDArray[np.int64]]:
    """Return the indices of the times in each stretch between events."""
    return np.split(np.arange(len(times)), np.flatnonzero(np.diff(times) <= 0.0) + 1)


def _own(scene: Scene) -> tuple[float, float]:
    """Return the force that bends a cable to a circle, and its weight [N]."""
    cable = scene.cable
    assert cable.bending_stiffness is not None
    gravity = float(np.linalg.norm(np.asarray(scene.environment.gravity)))
    return cable.bending_stiffness / cable.length**2, cable.mass * gravity


def _work(prediction: Prediction, times: Floats) -> Floats:
    """Return the work of grippers and loads since the first of the times (k,) [J]."""
    scene, surface = prediction.scene, prediction.surface
    power = np.zeros(len(times))
    for g, hold in zip(prediction.grasps, scene.grasps, strict=True):
        at = _window(g.times, times)
        velocity = surface([g.u], times, dt=1)[:, 0, :3]
        power += (g.reaction[at] * velocity).sum(axis=1)
        power += (g.moment[at] * _spin(hold, times)).sum(axis=1)
    for load in scene.loads:
        velocity = surface([load.u], times, dt=1)[:, 0, :3]
        power += (load.at(times) * velocity).sum(axis=1)
    steps = 0.5 * (power[1:] + power[:-1]) * np.diff(times)
    return np.concatenate([[0.0], np.cumsum(steps)])


def _window(all_times: Floats, times: Floats) -> slice:
    """Return the slice of a window of times among all times."""
    first = int(np.searchsorted(all_times, times[0], side="right")) - 1
    if all_times[first : first + len(times)].shape != times.shape:
        first = int(np.searchsorted(all_times, times[0], side="left"))
    return slice(first, first + len(times))


def _spin(grasp: Grasp, times: Floats) -> Floats:
    """Return the angular velocity of a gripper (k, 3) [rad/s]."""
    dt = 1e-6 * max(grasp.path.duration, 1e-3)
    clock = times - grasp.start
    after, before = grasp.path.rotation_at(clock + dt), grasp.path.rotation_at(clock - dt)
    if after is None or before is None:
        return np.zeros((len(times), 3))
    rate = (after - before) / (2 * dt) @ np.swapaxes(0.5 * (after + before), 1, 2)
    return np.column_stack([rate[:, 2, 1], rate[:, 0, 2], rate[:, 1, 0]])


def lost_impulse(prediction: Prediction) -> float | None:
    """Return the largest impulse that no force accounts for, relative to the impulses in the motion."""
    scene, surface = prediction.scene, prediction.surface
    active = {e.name for e in prediction.effects if e.active}
    strikes = prediction.contacts and prediction.level is not None and prediction.level.motion.split
    if not prediction.grasps or strikes or (prediction.accuracy.method == "reference" and active & _TOUCH):
        return None
    cable, around = scene.cable, scene.environment
    u, w = along(surface.knots_u)
    inertial = "inertia" in active
    places = np.concatenate([u, [one.u for one in cable.point_masses]])
    masses = np.concatenate([cable.linear_density * w, [one.mass for one in cable.point_masses]])
    carried = "table" in active and prediction.accuracy.dimensions == 2  # by a table, whose force is reported
    weight = cable.mass * np.asarray(around.gravity) * ("gravity" in active or carried)
    worst, scale = 0.0, _NOTHING * sum(_own(scene)) * surface.horizon
    for k, times in enumerate(windows_of(prediction.grasps[0].times)):
        if len(times) < 3 * _SETTLE:
            continue
        held = [g.reaction[_window(g.times, times)][_SETTLE:] for g in prediction.grasps]
        times = times[_SETTLE:]
        moving = surface(places, times, dt=1)[..., :3]
        force = np.tile(weight, (len(times), 1)) + np.sum(held, axis=0)
        pressed = np.zeros(len(times))
        for contact in prediction.contacts:
            at = _parts(contact.times)[k]
            force += at_times(times, contact.times[at], (contact.force + contact.friction)[at])
            pressed += np.interp(times, contact.times[at], contact.pressed[at])
        for load in scene.loads:
            force += load.at(times)
        if "drag" in active:
            v = moving[:, : len(u)]
            speed = np.linalg.norm(v, axis=-1, keepdims=True)
            force -= np.einsum("u,kud->kd", w, (around.drag + around.drag_quadratic * speed) * v)
        impulse = np.concatenate(
            [np.zeros((1, 3)), np.cumsum(0.5 * (force[1:] + force[:-1]) * np.diff(times)[:, None], axis=0)]
        )
        momentum = inertial * np.einsum("u,kud->kd", masses, moving)
        lost = np.linalg.norm(momentum - momentum[0] - impulse, axis=1)
        flow = np.linalg.norm(held, axis=2).sum(axis=0) + np.linalg.norm(weight) + pressed
        scale = max(scale, float(np.trapezoid(flow, times)), float(np.abs(momentum).max()))
        worst = max(worst, float(lost.max()))
    return float(worst / scale)


def along(knots: Floats) -> tuple[Floats, Floats]:
    """Return four Gauss points u (k,) [m] in each knot span and their weights (k,) [m]."""
    x, w = np.polynomial.legendre.leggauss(4)
    cuts = np.unique(knots)
    half = 0.5 * np.diff(cuts)[:, None]
    return (cuts[:-1, None] + half * (1 + x)).ravel(), (half * w).ravel()
