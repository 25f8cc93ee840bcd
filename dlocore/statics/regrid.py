"""Transfer a start that has settled on one grid to the next grid."""

import numpy as np
from numpy.typing import NDArray

from dlocore.answer.frames import angles_of, rates_of
from dlocore.kernels.assembly import History, slopes
from dlocore.kernels.entry import remember_start
from dlocore.kernels.tension import ASSUMED, COLUMNS
from dlocore.problem.events import closed_grasps
from dlocore.problem.grid import Grid
from dlocore.problem.problem import Problem
from dlocore.shape.shape import SplineCurve, fit_to_knots

Floats = NDArray[np.float64]

_UNEVEN = 0.4  # of |r'| - 1 between the points that watch the length: the sign of a shape that finer grids do not have
_ASTRAY = 0.3  # [rad]: a held section that ends up farther from its original angle was turned on the way


def starts_folded(grid: Grid) -> bool:
    """Tell whether the start of a grid is folded within a span."""
    least, most = slopes(grid.start[None], 1, grid.tables.curvature.first, grid.tables.curvature.b1)
    return not (least >= 1.0 - _UNEVEN and most <= 1.0 + _UNEVEN)


def begin_on(problem: Problem, grid: Grid, settled: Grid) -> tuple[Floats, History] | None:
    """Return the start of a `settled` grid on another grid of the problem: control points (n_u, nc) [m] and a history.

    The frames of its sections are carried there from the given start in one turn, and theta is chosen so that the twist
    is that of the settled start. The result is None if the two grids are of different kinds, if the settled start is
    folded within a span, or if the sections held by clamps would end up turned.
    """
    dimensions = problem.plane.dimensions
    if settled.start.shape[1] != problem.nc or starts_folded(settled):
        return None
    q = grid.start.copy()
    line = SplineCurve(knots=settled.knots, control_points=settled.start[:, :dimensions])
    q[:, :dimensions] = fit_to_knots(line, grid.knots)
    history = grid.past()
    if problem.twist is not None:
        q[:, 3] = 0.0
        remember_start(problem.axes, q, grid.tables, *problem.laws, history)
        there = rates_of(problem, settled, settled.start[None], settled.history.past[None])[0]
        missing = np.interp(grid.tables.curvature.u, settled.tables.curvature.u, there)
        missing -= rates_of(problem, grid, q[None], history.past[None])[0]
        q[:, 3] = angles_of(problem, grid, missing[None], settled.start[:1, 3])[0]
        held = [g.u for g in closed_grasps(problem.scene, 0.0, 0.0) if g.hold == "clamp"]
        off = np.array([grid.at(grid.start, u)[3] - grid.at(q, u)[3] for u in held])
        if held:  # the start of the frames, at u = 0, may have swung
            q[:, 3] += off[0]
            off -= off[0]
        if not np.abs(off).max(initial=0.0) <= _ASTRAY * problem.twist.radius or not np.isfinite(q).all():
            return None
    tables, behind = settled.tables, settled.history.axial
    index = tables.axial.first[:, None] + np.arange(4)
    along = np.einsum("pi,pid->pd", tables.axial.b1, settled.start[index, :dimensions])
    strain = np.sqrt((along * along).sum(axis=1)) - 1.0 - behind[:, 0]
    tension = np.zeros((len(grid.tables.axial.w), COLUMNS))
    pull = problem.stretch.axial_stiffness * strain
    tension[:, ASSUMED] = np.interp(grid.tables.axial.u, tables.axial.u, pull)
    return q, history._replace(tension=tension)
