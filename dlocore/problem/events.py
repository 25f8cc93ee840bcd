"""The events at which a motion is not smooth, its length in swings, and the grasps that hold in between."""

from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from dlocore.scene.paths import Path, Still, Waypoints
from dlocore.scene.scene import Grasp, Scene

Floats = NDArray[np.float64]


JUMP = 3  # multiplicity of the knot where the velocity jumps
_LONGEST = 64.0  # swings, up to which grids and comparisons grow with the length of a motion


@dataclass(frozen=True, eq=False)
class Event:
    """A time at which the motion is not smooth, and how much jumps there.

    Attributes:
        time: [s].
        multiplicity: of the time knot there: 1 smooth, 2 acceleration jumps, 3 velocity jumps.
    """

    time: float
    multiplicity: int


def swings(scene: Scene) -> float:
    """Return the approximate length of a motion in periods of a swing of the cable, 1 to _LONGEST."""
    return min(max(cast(float, scene.horizon) / scene.swing, 1.0), _LONGEST)


def moments(scene: Scene, in_a_swing: int) -> int:
    """Return the number of evenly spaced times for comparing motions: `in_a_swing`, and as many per further swing."""
    return round((in_a_swing - 1) * swings(scene)) + 1


def find_events(scene: Scene) -> tuple[Event, ...]:
    """Return the events inside the horizon of a scene, by time; those no farther apart than a `moment` are one."""
    found: dict[float, int] = {}
    horizon, nearest = cast(float, scene.horizon), scene.moment

    def add(time: float, multiplicity: int) -> None:
        if nearest < time < horizon - nearest:
            found[time] = max(found.get(time, 0), multiplicity)

    for g in scene.grasps:
        add(g.start, JUMP)
        if g.release_time is not None:
            add(g.release_time, JUMP)
        released = np.inf if g.release_time is None else g.release_time
        end = g.start + g.path.duration
        if g.path.duration and end < released:
            add(end, _smoothness(g.path))
        if isinstance(g.path, Waypoints):
            first = g.start + float(cast(Floats, g.path.times)[0])
            add(first, 2 if g.path.profile == "spline" else _smoothness(g.path))
            for time in g.start + g.path.stops:
                if time < released:
                    add(float(time), _smoothness(g.path))
    merged: list[Event] = []
    for time in sorted(found):
        if merged and time - merged[-1].time <= nearest:
            merged[-1] = Event(merged[-1].time, max(merged[-1].multiplicity, found[time]))
        else:
            merged.append(Event(time, found[time]))
    return tuple(merged)


def _smoothness(path: Path) -> int:
    """Return the multiplicity of the time knot at the end of a path, or of one of its moves."""
    profile = "" if isinstance(path, Still) else path.profile
    return {"minimum_jerk": 1, "cubic": 2}.get(profile, JUMP)


def closed_grasps(scene: Scene, begin: float, end: float) -> list[Grasp]:
    """Return the grasps that hold all the time from `begin` to `end` [s], between which there is no event."""
    middle = 0.5 * (begin + end)
    return [g for g in scene.grasps if g.start <= middle and (g.release_time is None or g.release_time > middle)]
