"""Forces and moments of the grippers on the cable, and their errors estimated from marches on other grids."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from dlocore.answer.compared import Series, errors, parts_of
from dlocore.answer.parts import GraspReaction
from dlocore.problem.grid import Grid
from dlocore.problem.holding import SMOOTH, Held
from dlocore.problem.problem import Problem
from dlocore.scene.scene import Grasp

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class WindowForces:
    """The forces that hold the cable over a stretch of time between two events.

    Attributes:
        held: the held degrees of freedom.
        times: (k,) [s].
        forces: residual of the equations at the held degrees of freedom (k, held) [N].
        states: control points (k, n_u, nc) [m] at those times.
        anchors: anchors of friction when the stretch begins, see `History`: (contact nodes, 3) and (lying points, 2)
            [m]; None if the motion has none.
    """

    held: Held
    times: Floats
    forces: Floats
    states: Floats
    anchors: tuple[Floats, Floats] | None = None


Windows = tuple[WindowForces, ...]


def reactions(problem: Problem, grid: Grid, windows: Windows) -> tuple[GraspReaction, ...]:
    """Return force [N] and moment [N m] of every grasp over time.

    The force is the multiplier of the constraint b(u_g) q = p, the moment d x (multiplier of b'(u_g) q = d).
    """
    dimensions = problem.plane.dimensions
    t = np.concatenate([w.times for w in windows])
    force = {g: np.zeros((len(t), 3)) for g in problem.scene.grasps}
    moment = {g: np.zeros((len(t), 3)) for g in problem.scene.grasps}
    for window, part in zip(windows, _parts(windows), strict=True):
        multipliers = problem.plane.world_vectors(window.held.multipliers(window.forces, dimensions))
        for row, (i, derivative) in enumerate(window.held.rows):
            if (i, derivative) == SMOOTH:
                continue
            g = window.held.grasps[i]
            if derivative == 0:
                force[g][part] = multipliers[:, row]
            else:
                moment[g][part] = np.cross(_tangents(problem, grid, window, g), multipliers[:, row])
        if window.held.turned:
            assert problem.twist is not None
            torques = problem.twist.radius * window.held.torques(window.forces, dimensions)
            for r, i in enumerate(window.held.turned):
                g = window.held.grasps[i]
                moment[g][part] += torques[:, r, None] * _tangents(problem, grid, window, g)
    return tuple(GraspReaction(g.u, t, force[g], moment[g]) for g in problem.scene.grasps)


def with_reaction_errors(
    found: tuple[GraspReaction, ...], windows: Windows, beside: Sequence[tuple[Problem, Grid, Windows]]
) -> tuple[GraspReaction, ...]:
    """Return reactions with error estimates, from those of the same motion marched on other grids.

    Args:
        found: the reactions in the `windows`.
        windows: stretches between events.
        beside: problem, grid and windows of each other march.
    """
    others = [(reactions(*other), _parts(other[2])) for other in beside]

    def error(g: int, name: str) -> Floats | None:
        own = Series(found[g].times, _parts(windows), getattr(found[g], name))
        return errors(own, [Series(other[g].times, parts, getattr(other[g], name)) for other, parts in others])

    return tuple(
        replace(reaction, reaction_error=error(g, "reaction"), moment_error=error(g, "moment"))
        for g, reaction in enumerate(found)
    )


def taken_on(found: tuple[GraspReaction, ...], judged: tuple[GraspReaction, ...]) -> tuple[GraspReaction, ...]:
    """Return reactions with the error estimates of a similar motion (`judged`), as far as that has them."""
    return tuple(
        reaction
        if like.reaction_error is None or like.moment_error is None
        else replace(
            reaction,
            reaction_error=np.interp(reaction.times, like.times, like.reaction_error),
            moment_error=np.interp(reaction.times, like.times, like.moment_error),
        )
        for reaction, like in zip(found, judged, strict=True)
    )


def _parts(windows: Windows) -> list[slice]:
    """Return the slice of each window in the times of all windows."""
    return parts_of([len(w.times) for w in windows])


def _tangents(problem: Problem, grid: Grid, window: WindowForces, grasp: Grasp) -> Floats:
    """Return the tangents (k, 3) of a held direction, which has unit length."""
    slope = grid.at(window.states, grasp.u, 1)[..., : problem.plane.dimensions]
    return problem.plane.world_vectors(slope)
