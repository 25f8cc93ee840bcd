"""Basis tables of a cable that touches nothing, for tests of single kernels."""

import numpy as np
from numpy.typing import NDArray

from dlocore.kernels.basis import GAUSS_2, GAUSS_3, GAUSS_4, Tables, build_tables

Floats = NDArray[np.float64]


def plain_tables(knots: Floats, free_start: bool = True, free_end: bool = True, masses: Floats | None = None) -> Tables:
    """Return the tables of knots (n_u + 4,) [m], without contact; and of point masses (k, 2) [m]."""
    rules = (*GAUSS_2, *GAUSS_3, *GAUSS_4)
    heavy = np.empty((0, 2)) if masses is None else masses
    tables: Tables = build_tables(knots, free_start, free_end, *rules, np.inf, np.inf, 1, np.inf, heavy)
    return tables
