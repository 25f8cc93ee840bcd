"""Rests in which a cable would yield, because nothing yields on the way to them."""

import numpy as np
from numpy.typing import NDArray

from dlocore.kernels.assembly import History, largest_curvature
from dlocore.kernels.twisted_rows import LAST
from dlocore.problem.discretisation import axial_strain
from dlocore.problem.grid import Grid
from dlocore.problem.problem import Problem

Floats = NDArray[np.float64]

_MORE = 1.01  # times the yield limit: a cable that has yielded as far as it will is not reported


def yield_notes(problem: Problem, grid: Grid, q: Floats, history: History) -> list[str]:
    """Return a note if control points q (n_u, nc) at rest are strained by more than the yield limit of the cable.

    `history` is their history. For a strain that has yielded before, what is left of it counts (docs/model.md eq. 20).
    """
    cable = problem.scene.cable
    memory, natural = np.split(history.memory, 2, axis=1)
    elastic_about = natural + (1.0 + cable.hardening) * (memory - natural)
    if problem.twist is not None:
        strain = np.abs(history.past[:, LAST : LAST + 3] - elastic_about)
        bend, twist = float(np.hypot(strain[:, 0], strain[:, 1]).max()), float(strain[:, 2].max())
    else:
        bend, twist = float(largest_curvature(problem.axes, q[None], grid.tables.curvature, elastic_about)), 0.0
    along = axial_strain(grid.tables, q[:, : problem.plane.dimensions])
    stretch = np.abs(along - (1.0 + cable.hardening) * history.axial[:, 0]) / grid.tables.axial.share
    by_diameter = 2.0 / cable.diameter
    found = []
    bends_at = cable.yield_strain if problem.bend is not None else None
    for how, most, limit, unit in (
        ("bent", bend, bends_at and by_diameter * bends_at, "/m"),
        ("twisted", twist, cable.yield_twist and by_diameter * cable.yield_twist, " rad/m"),
        ("stretched", float(stretch.max()), cable.yield_stretch, ""),
    ):
        if limit is not None and most > _MORE * limit:
            found.append(
                f"yielding is left out as the cable settles: at rest it is {how} by {most:.3g}{unit}, but it yields at "
                f"{limit:.3g}{unit}"
            )
    return found
