"""The angle of the sections between the knots (docs/model.md eq. 19b): what the spline of theta can't follow.

Frames that are carried in time turn against each other as a bend swings. With R(u) the integral of their twist rate
from u = 0, the angle of a section against its frame is S - R, where S' is the twist rate of the cable. S is smooth, as
the torque is; R has the kinks of the curvature. Theta is right at the knots, as the twist rate of a span is the mean
over it, and a spline between them: it would turn sharp bends against the sections, and hold them back from swinging.
So what it misses at a point after each step is kept with the frame there, and counts in the next.
"""

from typing import Any

import numpy as np

from dlocore.compiling.kernel import part
from dlocore.kernels.basis import GAUSS_3
from dlocore.kernels.lanes import POINTS, TRIPLE
from dlocore.kernels.twisted_rows import FRAME, LAST, OFFSET

_ORDERS = np.arange(1, POINTS + 1)
# integrals from the beginning of a span to its points, of values at these, in parts of its length
_INTEGRALS = (
    (GAUSS_3[0][:, None] ** _ORDERS - (-1.0) ** _ORDERS)
    / (2.0 * _ORDERS)
    @ np.linalg.inv(np.vander(GAUSS_3[0], increasing=True))
)
_BETWEEN = float(GAUSS_3[0][-1])  # of its length, of a span between its first and its last point
_Z = 0.5 + 0.5 / _BETWEEN  # where its end lies, in parts of that, from the first
# of the values and the slopes at the first and the last point, of a cubic at the end
_V1, _D1 = 2.0 * _Z**3 - 3.0 * _Z**2 + 1.0, _Z**3 - 2.0 * _Z**2 + _Z
_V3, _D3 = 3.0 * _Z**2 - 2.0 * _Z**3, _Z**3 - _Z**2


@part
def correct_angles(q: Any, points: Any, inverse: float, past: Any, knots: Any) -> None:
    """Write what theta misses of the angles at the points, and turn the strain that is noted there with the sections.

    S between two knots is the cubic through the four nearest, none of them beyond a triple knot.

    Args:
        q: (n, 4) the state that the frames have been carried to.
        inverse: of the radius that theta is in q times [1/m].
        past: (points, PAST).
        knots: (spans + 1, KNOT), written over.
    """
    first, w = points.first, points.w
    spans = len(past) // POINTS
    for s in range(spans):
        n = POINTS * s
        end, h = n + POINTS - 1, w[n] + w[n + 1] + w[n + 2]
        if s == 0:
            knots[0, 0], knots[0, 1], knots[0, 2] = 0.0, inverse * q[0, 3], 0.0
        turned = knots[s, 2] + w[n] * past[n, FRAME] + w[n + 1] * past[n + 1, FRAME] + w[n + 2] * past[n + 2, FRAME]
        angle = 0.0
        for i in range(4):
            values = _V1 * points.b0[n, i] + _V3 * points.b0[end, i]
            slopes = _D1 * points.b1[n, i] + _D3 * points.b1[end, i]
            angle += (values + _BETWEEN * h * slopes) * q[first[n] + i, 3]
        knots[s + 1, 0], knots[s + 1, 1], knots[s + 1, 2] = knots[s, 0] + h, inverse * angle + turned, turned
    for s in range(spans):
        n = POINTS * s
        low = s - 1 if s > 0 and first[n] - first[n - 1] != TRIPLE else s
        high = s + 2 if s + 1 < spans and first[n + POINTS] - first[n] != TRIPLE else s + 1
        h = knots[s + 1, 0] - knots[s, 0]
        for m in range(POINTS):
            smooth = 0.0
            for k in range(low, high + 1):
                share = 1.0
                for j in range(low, high + 1):
                    if j != k:
                        share *= (points.u[n + m] - knots[j, 0]) / (knots[k, 0] - knots[j, 0])
                smooth += share * knots[k, 1]
            turned, angle = knots[s, 2], 0.0
            for j in range(POINTS):
                turned += h * _INTEGRALS[m, j] * past[n + j, FRAME]
            for i in range(4):
                angle += inverse * points.b0[n + m, i] * q[first[n] + i, 3]
            offset = smooth - turned - angle
            more = offset - past[n + m, OFFSET]
            past[n + m, OFFSET] = offset
            c, r, k1, k2 = np.cos(more), np.sin(more), past[n + m, LAST], past[n + m, LAST + 1]
            past[n + m, LAST], past[n + m, LAST + 1] = c * k1 + r * k2, c * k2 - r * k1
