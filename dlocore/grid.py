"""A space discretisation: knots, basis tables, the start on them and what lies behind it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dlocore.kernels.assembly import History, slopes
from dlocore.kernels.basis import Tables, basis_rows

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Grid:
    """Space discretisation of a problem.

    Attributes:
        knots: (n_u + 4,) [m].
        tables: basis functions at the quadrature points.
        history: what the start has behind it: stress-free strain, frames. Kernels write to it: pass `past()`.
        start: control points at t = 0 (n_u, nc) [m].
        velocity: their given velocities, before grasps close (n_u, nc) [m/s].
    """

    knots: Floats
    tables: Tables
    history: History
    start: Floats
    velocity: Floats

    def past(self) -> History:
        """Return a copy of the history, to be carried on."""
        return History(*(x.copy() for x in self.history))

    @property
    def n_u(self) -> int:
        """Number of control points."""
        return len(self.knots) - 4

    def rows(self, u: float, derivative: int = 0) -> tuple[int, Floats]:
        """Return the first control point and the four basis functions, or derivatives, at `u` [m]."""
        first, table = basis_rows(self.knots, np.array([u]), derivative)
        return int(first[0]), table[0, derivative]

    def at(self, q: Floats, u: float, derivative: int = 0) -> Floats:
        """Return the value or derivative at `u` [m] of control points q (..., n_u, nc)."""
        first, b = self.rows(u, derivative)
        return b @ q[..., first : first + 4, :]

    def largest_strain(self, states: Floats) -> float:
        """Return the largest |axial strain| at the axial points over the states (k, n_u, nc)."""
        least, most = slopes(states, 1, self.tables.axial_first, self.tables.axial_b1)
        return float(max(0.0, most - 1.0, 1.0 - least))
