"""The time grid of a problem: knots at its events, and the steps between them."""

from itertools import pairwise
from typing import cast

import numpy as np
from numpy.typing import NDArray

from dlocore.errors import SceneError
from dlocore.kernels.basis import graded_knots
from dlocore.problem.problem import Problem
from dlocore.scene.paths import Waypoints

Floats = NDArray[np.float64]

_LEAST = 8  # least steps of a stretch
_SHORTER = 64.0  # times, at most, that the steps of a short stretch are shorter to make more of them


def time_knots(problem: Problem, n_t: int) -> Floats | None:
    """Return the time knots (n_t + 4,) [s] with a knot at every event, or None if n_t is too small for them.

    If the answer is a march, waypoints get knots too, provided that these are at most half of the remaining ones and
    nowhere closer than even knots. A path through waypoints is then a spline on these knots. The least squares work
    better with even knots.
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


def _waypoints(problem: Problem, n_t: int) -> list[float]:
    """Return the times [s] of the waypoints inside the horizon, or none if they are too many or too close."""
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


def smallest_n_t(problem: Problem) -> int:
    """Return the least number of control points in time with which there is a knot at every event."""
    return max(5, 4 + sum(e.multiplicity for e in problem.events))


def check_n_t(problem: Problem, n_t: int) -> None:
    """Raise SceneError if a grid has fewer control points in time than `smallest_n_t`."""
    least = smallest_n_t(problem)
    if n_t < least:
        reason = "Every jump in the grasps' motion needs knots in time"
        raise SceneError("quality.n_t", n_t, f"at least {least} in this scene", reason)


def marks_of(problem: Problem) -> list[float]:
    """Return the times [s] between which the motion is smooth: the beginning, the events and the end."""
    return [0.0, *[e.time for e in problem.events], problem.horizon]


def step_counts(marks: list[float], steps: int) -> list[int]:
    """Return the time steps of each stretch between the marks: about `steps` in all, and more if marks lie close.

    In a short stretch the steps are up to `_SHORTER` times shorter than elsewhere, or there are `_LEAST` of them. Even
    shorter ones would drown accelerations, and forces with them, in noise.
    """
    if len(marks) == 2:
        return [steps]
    shares = [steps * (b - a) / marks[-1] for a, b in pairwise(marks)]
    return [max(_LEAST, min(steps // (2 * len(marks)), int(_SHORTER * share)), round(share)) for share in shares]


def step_times(marks: list[float], counts: list[int]) -> Floats:
    """Return the times (steps + 1,) [s] of a march with `counts` steps between each two successive marks."""
    times = np.zeros(sum(counts) + 1)
    first = 0
    for (a, b), count in zip(pairwise(marks), counts, strict=True):
        times[first : first + count] = a + (b - a) / count * np.arange(count)
        first += count
        times[first] = b
    return times
