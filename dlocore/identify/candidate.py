"""A candidate with which a recording is replayed, and how to make its problem from that of another candidate."""

from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dlocore.problem.problem import Problem
from dlocore.scene.cable import Cable
from dlocore.scene.scene import Environment

Floats = NDArray[np.float64]

_RESISTS = frozenset({"bending_damping", "drag", "drag_quadratic"})  # parameters that only resist motion


@dataclass(frozen=True, kw_only=True, eq=False)
class Candidate:
    """Everything that a recording is replayed with.

    Attributes:
        cable: its length is that of the recording.
        environment: drag; gravity is that of the recording.
        rest_curvature: (k, 2) [1/m] of the stress-free shape at k places from end to end, in the frame of the
            sections; None: straight.
        clamp_angles: (clamps, 2) [rad] between the cable at each clamp and the direction of the clamp's markers.
        turn: [rad] of the last clamp relative to the first, about the cable.
        marker_offsets: (m, 2) [m] of the markers from the centreline, across it, in a frame that is carried from the
            first clamp without twist; None: on it.
        length_ratio: ratio of the cable's length and its markers' coordinates to those of the recording.
        twist: simulate twist; needed for rest_curvature, a torsional stiffness, and cables that yield.
    """

    cable: Cable
    environment: Environment
    rest_curvature: Floats | None = None
    clamp_angles: Floats | None = None
    turn: float = 0.0
    marker_offsets: Floats | None = None
    length_ratio: float = 1.0
    twist: bool = False

    @property
    def yields(self) -> bool:
        """Whether its cable yields in bending, twist or stretch."""
        return self.cable.yields


def resized(cable: Cable, length: float) -> Cable:
    """Return a cable with another length [m], with its point masses at the same fractions of it."""
    share = length / cable.length
    masses = tuple(replace(one, u=min(one.u * share, length)) for one in cable.point_masses)
    return replace(cable, length=length, point_masses=masses)


def varied(problem: Problem, before: Candidate, after: Candidate) -> Problem | None:
    """Return the problem of a candidate, made from the one posed for another.

    It is None if they differ in more than parameters that only resist motion: the start, or what is simulated, then
    differs too.
    """
    if not all(_alike(getattr(before, f.name), getattr(after, f.name)) for f in fields(Candidate)):
        return None
    cable, environment = after.cable, after.environment
    effects: dict[str, tuple[Any, str, float]] = {
        "damping": (problem.damping, "bending_damping", cable.bending_damping),
        "drag": (problem.drag, "drag", environment.drag),
        "quadratic_drag": (problem.quadratic_drag, "drag_quadratic", environment.drag_quadratic),
    }
    if any((effect is None) != (value == 0.0) for effect, _, value in effects.values()):
        return None
    changes: Any = {
        name: replace(effect, **{field: value})
        for name, (effect, field, value) in effects.items()
        if effect is not None
    }
    scene = replace(
        problem.scene,
        cable=replace(problem.scene.cable, bending_damping=cable.bending_damping),
        environment=replace(
            problem.scene.environment, drag=environment.drag, drag_quadratic=environment.drag_quadratic
        ),
    )
    return replace(problem, scene=scene, **changes)


def _alike(a: Any, b: Any) -> bool:
    """Tell whether two values are the same apart from parameters that only resist motion."""
    if a is b:
        return True
    if isinstance(a, Cable | Environment):
        names = [f.name for f in fields(a) if f.name not in _RESISTS]
        return type(a) is type(b) and all(_alike(getattr(a, name), getattr(b, name)) for name in names)
    if isinstance(a, np.ndarray) and isinstance(b, np.ndarray):
        return np.array_equal(a, b)
    return isinstance(a, float | int | str) and bool(a == b)
