"""When a motion is not smooth, and what follows from that: its stretches, their steps, and the knots in time."""

import math
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, cast

import numpy as np
from numpy.typing import NDArray

from dlocore.kernels.basis import graded_knots
from dlocore.paths import Move, Waypoints
from dlocore.scene import Grasp, Scene

if TYPE_CHECKING:
    from dlocore.problem import Problem

Floats = NDArray[np.float64]


_LONGEST = 64.0  # times that a cable swings, for as many of which grids and comparisons grow


@dataclass(frozen=True, eq=False)
class Event:
    """A time at which the motion is not smooth, and how much of it jumps.

    Attributes:
        time: [s].
        multiplicity: of the time knot there: 1 smooth, 2 acceleration jumps, 3 velocity jumps.
    """

    time: float
    multiplicity: int


def swings(scene: Scene) -> float:
    """Return how many times as long a motion is as a cable of that length needs to swing, about; 1 to _LONGEST."""
    natural = 2.0 * math.sqrt(scene.cable.length)  # [s], for a length in metres
    return min(max(cast(float, scene.horizon) / natural, 1.0), _LONGEST)


def moments(scene: Scene, in_a_swing: int) -> int:
    """Return at how many evenly spaced times motions are compared: so many, and as many again for each swing more."""
    return round((in_a_swing - 1) * swings(scene)) + 1


def find_events(scene: Scene) -> tuple[Event, ...]:
    """Return the events inside the horizon of a scene, by time."""
    found: dict[float, int] = {}
    latest = cast(float, scene.horizon) * (1 - 1e-9)

    def add(time: float, multiplicity: int) -> None:
        if 0.0 < time < latest:
            found[time] = max(found.get(time, 0), multiplicity)

    for g in scene.grasps:
        add(g.start, 3)
        if g.release_time is not None:
            add(g.release_time, 3)
        released = np.inf if g.release_time is None else g.release_time
        end = g.start + g.path.duration
        if g.path.duration and end < released:
            add(end, _smoothness(g, g.path.duration))
        if isinstance(g.path, Waypoints):
            add(g.start + float(np.asarray(g.path.times)[0]), 2)
    return tuple(Event(t, found[t]) for t in sorted(found))


def _smoothness(grasp: Grasp, end: float) -> int:
    if isinstance(grasp.path, Move):
        return {"minimum_jerk": 1, "cubic": 2, "linear": 3}[grasp.path.profile]
    return 3


def time_knots(problem: "Problem", n_t: int) -> Floats | None:
    """Return the time knots (n_t + 4,) [s] with a knot at every event, or None where n_t is too small for them.

    Where the answer is a march waypoints have knots too if these are at most half of what is left, and nowhere closer
    than even ones: a path through waypoints is then a spline on these knots. The least squares prefer even ones.
    """
    found = {event.time: event.multiplicity for event in problem.events}
    quality = problem.scene.quality
    if quality.n_u is None or quality.method == "march":
        found |= dict.fromkeys(_waypoints(problem, n_t), 1)
    times = sorted(found)
    multiplicity = np.array([found[time] for time in times], dtype=np.int64)
    even, wide = np.zeros(len(times)), np.ones(len(times))
    knots = graded_knots(n_t, problem.horizon, np.array(times), multiplicity, even, wide)
    return knots if len(knots) else None


def _waypoints(problem: "Problem", n_t: int) -> list[float]:
    """Return the times [s] of the waypoints inside the horizon, or none where they are too many or too close."""
    horizon, led = problem.horizon, []
    for g in problem.scene.grasps:
        if isinstance(g.path, Waypoints):
            times = g.start + cast(Floats, g.path.times)[1:-1]
            led.append(times[times < min(g.release_time or horizon, horizon)])
    if not led:
        return []
    found = np.setdiff1d(np.concatenate(led), marks_of(problem))
    if 2 * len(found) > n_t - 4 - sum(e.multiplicity for e in problem.events):
        return []
    marks = np.sort(np.concatenate([marks_of(problem), found]))
    close = np.diff(marks) < horizon / n_t
    crowded = close & (np.isin(marks[1:], found) | np.isin(marks[:-1], found))
    return [] if crowded.any() else found.tolist()


def smallest_n_t(problem: "Problem") -> int:
    """Return the least number of control points in time that has a knot at every event."""
    return max(5, 4 + sum(e.multiplicity for e in problem.events))


def closed_grasps(scene: Scene, begin: float, end: float) -> list[Grasp]:
    """Return the grasps that hold all through the times `begin` to `end` [s]."""
    middle = 0.5 * (begin + end)
    return [g for g in scene.grasps if g.start <= middle and (g.release_time is None or g.release_time > middle)]


def marks_of(problem: "Problem") -> list[float]:
    """Return the times [s] between which the motion is smooth: its beginning, its events and its end."""
    return [0.0, *[e.time for e in problem.events], problem.horizon]


def step_counts(marks: list[float], steps: int) -> list[int]:
    """Return the time steps of each stretch between the marks, about `steps` in all, more where marks lie close."""
    if len(marks) == 2:
        return [steps]
    return [max(8, steps // (2 * len(marks)), round(steps * (b - a) / marks[-1])) for a, b in pairwise(marks)]


def step_times(marks: list[float], counts: list[int]) -> Floats:
    """Return the times (steps + 1,) [s] of a march with so many steps between each two marks."""
    times = np.zeros(sum(counts) + 1)
    first = 0
    for (a, b), count in zip(pairwise(marks), counts, strict=True):
        times[first : first + count] = a + (b - a) / count * np.arange(count)
        first += count
        times[first] = b
    return times
