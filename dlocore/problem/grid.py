"""A space discretisation: knots, basis tables, and the start with its history."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from dlocore.kernels.assembly import History, slopes
from dlocore.kernels.basis import Tables, basis_rows
from dlocore.kernels.tension import COLUMNS
from dlocore.pickling import Known, state_with

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Grid:
    """Space discretisation of a problem.

    Attributes:
        knots: (n_u + 4,) [m].
        start: control points at t = 0 (n_u, nc) [m].
        velocity: their given velocities, before grasps close (n_u, nc) [m/s].
        find_tables: computes `tables` from the knots when they are first read.
        find_history: computes `history` from the grid when it is first read.
        watched: whether the tables have more points than the knots need, see `solvers/watched.py`.
        tipped: whether the start had settled in an unstable equilibrium and was tipped, see `statics/tipping.py`.
    """

    knots: Floats
    start: Floats
    velocity: Floats
    find_tables: Callable[[Floats], Tables] = field(repr=False)
    find_history: Callable[[Self], History] = field(repr=False)
    watched: bool = False
    tipped: bool = False

    @cached_property
    def tables(self) -> Tables:
        """Basis functions at the quadrature points."""
        return self.find_tables(self.knots)

    @cached_property
    def history(self) -> History:
        """History of the start: stress-free strain, frames. Kernels write to what they get: pass them `past()`."""
        return self.find_history(self)

    def changed(
        self,
        *,
        start: Floats | None = None,
        tables: Tables | None = None,
        history: History | None = None,
        tipped: bool = False,
    ) -> "Grid":
        """Return the grid with another start, other tables or another history, and the rest unchanged."""
        return Grid(
            self.knots,
            self.start if start is None else start,
            self.velocity,
            Known(tables or self.tables),
            Known(history or self.history),
            self.watched or tables is not None,
            self.tipped or tipped,
        )

    def __getstate__(self) -> dict[str, Any]:
        return state_with(self, tables="find_tables", history="find_history")

    def past(self) -> History:
        """Return a copy of the history for a march to carry on; contact acts at all nodes until the first step."""
        past = History(*(x.copy() for x in self.history))
        past.pressing[:] = self.tables.contact.w
        return past

    def untensed(self) -> Floats:
        """Return a `History.tension` that is not known yet: the first tangent then takes the tension of the strain."""
        return np.full((len(self.tables.axial.w), COLUMNS), np.nan)

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
        least, most = slopes(states, 1, self.tables.axial.first, self.tables.axial.b1)
        return float(max(0.0, most - 1.0, 1.0 - least))
