"""What a jammed motion presses the cable into deepest, with the place along the cable and the time."""

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from dlocore.effects.selfcontact import APART
from dlocore.problem.depths import depths_by_name
from dlocore.problem.problem import Problem
from dlocore.problem.strands import nearest_strands
from dlocore.solvers.march import March
from dlocore.spline import design_matrix

Floats = NDArray[np.float64]

_AT_ONCE = 1_000_000  # nodes that are examined together, over all times
_MOST_PARTS = 1000  # parts of a cable, at most, between which a meeting pair is sought
_ROUNDING = 1e-9  # of a distance


def pressed_into(problem: Problem, motion: March) -> str:
    """Return in words what the motion is deepest in, with place and time; unspecific words if it is in nothing."""
    found = [*_into_surroundings(problem, motion), *_into_itself(problem, motion)]
    depth, words = max(found, default=(0.0, ""))
    return words if depth > 0.0 else "the table, an obstacle or itself"


def _into_surroundings(problem: Problem, motion: March) -> Iterator[tuple[float, str]]:
    """Yield how deep the cable is in each obstacle and in the table, at most [m], and the words for it."""
    if problem.contact is None:
        return
    u, states = np.unique(motion.grid.tables.contact.u), np.arange(motion.reached + 1)
    for some in np.array_split(states, -(-len(states) * len(u) // _AT_ONCE)):
        for name, depth in depths_by_name(problem, _places(problem, motion, u, some)).items():
            k, i = divmod(int(np.argmax(depth)), len(u))
            yield float(depth.max()), f"{name}, at u = {u[i]:.4g} m and {motion.times[some[k]]:.3g} s"


def _into_itself(problem: Problem, motion: March) -> Iterator[tuple[float, str]]:
    """Yield how far two strands are within a diameter, at most [m], and the words for it, if they may not cross."""
    if problem.self_contact is None:
        return
    diameter, dimensions, knots = problem.scene.cable.diameter, problem.plane.dimensions, motion.grid.knots

    def apart(first: int, last: int) -> float:
        return nearest_strands(knots, motion.states[first:last], dimensions, diameter, diameter)

    first, last = 0, motion.reached + 1
    least = apart(first, last)
    if not least < diameter:
        return
    while last - first > 1:
        middle = (first + last) // 2
        if apart(first, middle) <= least * (1.0 + _ROUNDING):
            last = middle
        else:
            first = middle
    length = problem.scene.cable.length
    u = np.linspace(0.0, length, 1 + min(_MOST_PARTS, round(2.0 * length / diameter)))
    x = _places(problem, motion, u, np.array([first]))
    ways = np.linalg.norm(x[:, None] - x[None], axis=2)
    ways[np.abs(u[:, None] - u) < APART * diameter] = np.inf
    i, j = divmod(int(np.argmin(ways)), len(u))
    yield diameter - least, f"itself, u = {u[i]:.4g} m into u = {u[j]:.4g} m, at {motion.times[first]:.3g} s"


def _places(problem: Problem, motion: March, u: Floats, states: NDArray[np.int64]) -> Floats:
    """Return the points (states u, 3) [m] of the cable at the places u [m] in some states of a motion."""
    plane = problem.plane
    at = design_matrix(motion.grid.knots, u) @ motion.states[states][..., : plane.dimensions]
    return np.ascontiguousarray(plane.world(at).reshape(-1, 3))
