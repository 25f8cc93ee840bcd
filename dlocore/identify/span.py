"""The part of a cable between its grippers that bends, and where the markers lie on it."""

from dataclasses import dataclass, replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from dlocore.identify.candidate import resized
from dlocore.recordings import Recording
from dlocore.scene.cable import Cable
from dlocore.spline import design_matrix

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Span:
    """The part of a recorded cable that is simulated.

    Between the two markers of a clamp the cable is as straight as the gripper that holds it, so the span ends at the
    inner one, unless free markers lie beyond a clamp.

    Attributes:
        length: [m].
        u: coordinates of all markers (m,) [m] from its beginning: negative, or beyond its length, for those on a
            gripper.
        begin: where it begins on the whole cable [m].
        whole: length of the whole cable [m].
    """

    length: float
    u: Floats
    begin: float
    whole: float

    @staticmethod
    def of(recording: Recording) -> "Span":
        """Return the span of a recording."""
        u, free = cast(Floats, recording.u), recording.free
        begin, end = 0.0, cast(float, recording.length)
        for h in recording.holds:
            if h.towards is None:
                continue
            if not h.forward and h.marker < free.min():
                begin = float(u[h.marker])
            elif h.forward and h.marker > free.max():
                end = float(u[h.marker])
        return Span(end - begin, u - begin, begin, cast(float, recording.length))

    def scaled(self, ratio: float) -> "Span":
        """Return the span with all lengths multiplied by `ratio`."""
        return Span(self.length * ratio, self.u * ratio, self.begin * ratio, self.whole * ratio)

    def of_cable(self, cable: Cable) -> Cable:
        """Return this part of a whole cable, with the point masses that lie on it; grippers hold the others.

        Point masses keep their fractions of the cable's length, whatever that is in the recording.
        """
        slack = 1e-9 * self.length
        moved = [(one.u - self.begin, one) for one in resized(cable, self.whole).point_masses]
        masses = [
            replace(one, u=min(max(u, 0.0), self.length)) for u, one in moved if -slack <= u <= self.length + slack
        ]
        return replace(cable, length=self.length, point_masses=tuple(masses))

    def to_whole(self, cable: Cable) -> Cable:
        """Return the whole cable of which `cable` is this part, with the point masses on that."""
        part = resized(cable, self.length)
        masses = [replace(one, u=min(one.u + self.begin, self.whole)) for one in part.point_masses]
        return replace(cable, length=self.whole, point_masses=tuple(masses))

    def inside(self, markers: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Tell which of the given markers lie on the span."""
        slack = 1e-9 * self.length
        return np.asarray((self.u[markers] >= -slack) & (self.u[markers] <= self.length + slack))

    def rows(self, knots: Floats) -> Floats:
        """Return the rows (m, n) that give the markers' positions from the control points of a spline on the span."""
        on = np.clip(self.u, 0.0, self.length)
        return np.asarray(design_matrix(knots, on) + (self.u - on)[:, None] * design_matrix(knots, on, 1))
