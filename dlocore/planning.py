"""What a scene calls for, before it is solved."""

from dataclasses import dataclass

import numpy as np

from dlocore.accuracy.companion import coarser, finer
from dlocore.answer.parts import EffectReport
from dlocore.answer.report import planned_effects
from dlocore.compiling.interrupts import interruptible
from dlocore.front import automatic_method
from dlocore.levels.level import Size, given_steps, stretched
from dlocore.problem.discretisation import smallest_n_u, too_few
from dlocore.problem.problem import Problem, pose
from dlocore.problem.time_grid import check_n_t
from dlocore.scene.scene import Scene
from dlocore.shape.shape import rest_curve
from dlocore.solvers import paper

# Medians measured on one 2-core cloud machine in 2026; they give the order of magnitude of the time
# (benchmarks/expected_times.py).
_MARCH = {2: 9e-7, 3: 2.2e-6, 4: 3.1e-6}  # [s] per step and control point, by coordinates
_ITERATION = 2.5e-4  # [s] of the least squares
_UNKNOWNS = 1.6e-9  # [s] per iteration, time span and cubed number of free coordinates
_SETUP = 5e-4  # [s]
_REFERENCE = {2: 2e-5, 3: 4e-5}  # [s] of the reference per step and element, by dimensions
_RODS = ((20, 150), (40, 250), (80, 450))  # elements and steps of the rods that most scenes need
_LEVEL = 1  # refinement level at which most scenes end, ...
_CLIMB = 4.0  # ... and the median time of a scene, as a multiple of the marches up to there
# factors on the time: steps take more iterations, are divided at impacts, and have to be more
_RUBS, _TOUCHES, _MEETS_ITSELF = 1.5, 5.0, 40.0
_EVENTS = 1.5  # power of one more than the events of a motion
_ITERATIONS = 8


@dataclass(frozen=True, kw_only=True)
class Plan:
    """What `predict` would do with a scene.

    Attributes:
        dimensions: 2 if the motion is planar, otherwise 3.
        reason: why it is planar or not.
        effects: which effects it would simulate, and why; magnitudes are known only after solving.
        method: "march", "spacetime", "paper" or "reference".
        n_u, n_t, steps: the grid: as given, or the one on which most scenes meet their target. For method "reference"
            the nodes, times and steps of its finest rod.
        expected_time: order of magnitude of the solve's time [s]. It depends on impacts and instabilities, which are
            known only once the motion is.
    """

    dimensions: int
    reason: str
    effects: tuple[EffectReport, ...]
    method: str
    n_u: int
    n_t: int
    steps: int
    expected_time: float


@interruptible
def plan(scene: Scene) -> Plan:
    """Return what `predict` would do with a scene, without solving it.

    Raises:
        SceneError: the scene can't be solved as it was given.
    """
    problem = pose(scene)
    quality = scene.quality
    method = quality.method
    if method == "auto":
        method = automatic_method(problem)
    rest = problem.rest_shape
    if not isinstance(rest, str) and problem.start.material is None:
        rest_curve(rest, scene.cable.length)
    if quality.n_u is None or quality.n_t is None:
        n_u, n_t, steps = stretched(problem, _LEVEL)
        marches = [stretched(problem, i) for i in range(_LEVEL + 1)]
        factor = _CLIMB * _harder(problem)
    else:
        n_u, n_t, steps = quality.n_u, quality.n_t, given_steps(quality.n_t)
        if n_u < smallest_n_u(problem):
            raise too_few(problem, n_u)
        check_n_t(problem, n_t)
        marches, factor = [Size(n_u, n_t, steps)], _harder(problem)
        if quality.estimate:
            coarse = coarser(problem, marches[0]) if method == "march" else None
            marches.append(coarse or finer(problem, marches[0]))
    if method == "paper":
        paper.refuse(problem, n_u, n_t)
    dimensions = problem.plane.dimensions
    if method == "reference":
        from dlocore.reference.solve import refuse  # its compiled code is loaded only if it is used

        refuse(problem)
        n_u, n_t, steps = _RODS[-1][0] + 1, _RODS[-1][1] + 1, _RODS[-1][1]
        marches = []
    expected = _SETUP + factor * sum(_MARCH[problem.nc] * size * count for size, _, count in marches)
    if method == "reference":
        expected += _REFERENCE[dimensions] * sum(elements * count for elements, count in _RODS)
    elif method != "march":
        expected += _ITERATIONS * (_ITERATION + _UNKNOWNS * n_t * (problem.nc * n_u) ** 3)
    expected = min(expected, quality.time_budget or np.inf)
    return Plan(
        dimensions=dimensions,
        reason=problem.plane.reason,
        effects=planned_effects(problem),
        method=method,
        n_u=n_u,
        n_t=n_t,
        steps=steps,
        expected_time=expected,
    )


def _harder(problem: Problem) -> float:
    """Return the factor by which a motion's steps take longer than those of a smooth one that touches nothing."""
    rubs, touches = problem.friction is not None, problem.contact is not None
    factor = _TOUCHES if touches else _RUBS if rubs else 1.0
    return factor * (_MEETS_ITSELF if problem.self_contact is not None else 1.0) * (1 + len(problem.events)) ** _EVENTS
