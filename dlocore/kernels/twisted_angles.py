"""The angle of the sections between the knots (docs/model.md eq. 19b), which the spline of theta can't follow.

Frames that are carried in time turn against each other as a bend swings. Let R(u) be the integral of their twist rate
from u = 0. The angle of a section against its frame is then S - R, where S' is the twist rate of the cable. S is
smooth, as the torque is; R has the kinks of the curvature. Theta is right at the knots, as the twist rate of a span is
its mean, and a spline between them: it would turn sharp bends against the sections, and hold them back from swinging.
So after each step the difference of S - R from theta at a point is stored with the frame there, and is added to theta
in the next step.
"""

from typing import Any

import numpy as np

from dlocore.compiling.kernel import part
from dlocore.kernels.basis import GAUSS_3
from dlocore.kernels.lanes import POINTS, TRIPLE
from dlocore.kernels.twisted_rows import FRAME, LAST, OFFSET

_ORDERS = np.arange(1, POINTS + 1)
# integrals from the start of a span to each of its points, as weights of values at the points, per length of the span
_INTEGRALS = (
    (GAUSS_3[0][:, None] ** _ORDERS - (-1.0) ** _ORDERS)
    / (2.0 * _ORDERS)
    @ np.linalg.inv(np.vander(GAUSS_3[0], increasing=True))
)
_BETWEEN = float(GAUSS_3[0][-1])  # distance of the first and the last point of a span, per length of the span
_Z = 0.5 + 0.5 / _BETWEEN  # end of the span, measured from the first point in units of that distance
# weights of the values and slopes at the first and the last point in the value of a cubic at the end
_V1, _D1 = 2.0 * _Z**3 - 3.0 * _Z**2 + 1.0, _Z**3 - 2.0 * _Z**2 + _Z
_V3, _D3 = 3.0 * _Z**2 - 2.0 * _Z**3, _Z**3 - _Z**2


@part
def correct_angles(q: Any, points: Any, inverse: float, past: Any, knots: Any) -> None:
    """Write the differences of the angles at the points from theta, and turn the strain stored there with the sections.

    Between two knots, S is the cubic through the four nearest knots, none of them beyond a triple knot.

    Args:
        q: (n, 4) the state that the frames have been carried to.
        inverse: inverse of the radius that is the factor of theta in q [1/m].
        past: (points, PAST).
        knots: (spans + 1, KNOT) workspace, overwritten.
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
