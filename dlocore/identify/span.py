"""The part of a cable between its grippers that bends, and where the markers lie on it."""

from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from dlocore.recordings import Recording
from dlocore.spline import design_matrix

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Span:
    """The part of a recorded cable that is simulated.

    Between the two markers of a clamp the cable is as straight as the gripper that holds it, so it ends at the inner
    one; not where free markers lie beyond a clamp.

    Attributes:
        length: [m].
        u: of all markers (m,) [m], from where it begins: negative, or beyond its length, for those on a gripper.
    """

    length: float
    u: Floats

    @staticmethod
    def of(recording: Recording) -> "Span":
        """Return that of a recording."""
        u, free = cast(Floats, recording.u), recording.free
        begin, end = 0.0, cast(float, recording.length)
        for h in recording.holds:
            if h.towards is None:
                continue
            if not h.forward and h.marker < free.min():
                begin = float(u[h.marker])
            elif h.forward and h.marker > free.max():
                end = float(u[h.marker])
        return Span(end - begin, u - begin)

    def scaled(self, ratio: float) -> "Span":
        """Return it with all lengths `ratio` times as large."""
        return Span(self.length * ratio, self.u * ratio)

    def inside(self, markers: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Tell which of some markers lie on it."""
        slack = 1e-9 * self.length
        return np.asarray((self.u[markers] >= -slack) & (self.u[markers] <= self.length + slack))

    def rows(self, knots: Floats) -> Floats:
        """Return the rows (m, n) that give the markers' positions by the control points of a spline on it."""
        on = np.clip(self.u, 0.0, self.length)
        return np.asarray(design_matrix(knots, on) + (self.u - on)[:, None] * design_matrix(knots, on, 1))
