"""A grid on which the cable can't fold within a span, because its stretch is watched at more points."""

import numpy as np

from dlocore.kernels.basis import GAUSS_3, AxialPoints, Tables, basis_rows
from dlocore.problem.grid import Grid

_SHARE = 0.3  # of the axial stiffness, at the points added: a fifth still leaves folds, more locks the bending more


def watched(grid: Grid) -> Grid:
    """Return a grid whose axial points see folds within a span too.

    With only as many axial points as control points have strains, |r'| is not determined between them (docs/model.md,
    selective reduced integration): a limp cable folds there without energy, if the control points are too few for its
    bends. Here three more Gauss points per span bear three tenths of the axial stiffness, and the others the rest. This
    hinders bending, so it is only for grids on which the cable folds otherwise.
    """
    tables, breaks = grid.tables, np.unique(grid.knots)
    half, (rule, weights) = 0.5 * np.diff(breaks)[:, None], GAUSS_3
    more = (breaks[:-1, None] + half * (1.0 + rule)).ravel()
    first, rows = basis_rows(grid.knots, more, 1)
    u = np.concatenate([tables.axial.u, more])
    order = np.argsort(u, kind="stable")

    def merged(own: np.ndarray, added: np.ndarray) -> np.ndarray:
        return np.ascontiguousarray(np.concatenate([own, added])[order])

    points = AxialPoints(
        u=u[order],
        first=merged(tables.axial.first, first),
        b1=merged(tables.axial.b1, rows[:, 1]),
        w=merged((1.0 - _SHARE) * tables.axial.w, _SHARE * (half * weights).ravel()),
        share=np.ones(len(u)),
    )
    finer: Tables = tables._replace(axial=points)
    behind = [np.interp(finer.axial.u, tables.axial.u, column) for column in grid.history.axial.T]
    past = grid.past()
    history = past._replace(axial=np.ascontiguousarray(np.transpose(behind)))
    return grid.changed(tables=finer, history=history)
