"""Measures of a group of knot spans in the assembly with twist: their places in its array W and in the stored state."""

from dlocore.compiling.kernel import law
from dlocore.effects.base import Vector
from dlocore.kernels.lanes import LANES, POINTS, SPANS

TANGENT, BEND, DIRECTOR, FRAME, LAST, BEFORE, OFFSET = 0, 3, 6, 9, 10, 13, 16  # columns of `past`
TWIST_RATE = LAST + 2
PAST = 17
# Rows of W with numbers of points. What they are measured against: t0, k0, the director, which is carried to t, theta;
# then r', r''; the strain: |r'|, t . r'', t, kappa, spin, derivative of the twist rate by r', cos and sin of theta, the
# directors of the section, k1, k2, twist rate, and their rates.
T0, K0, D0, ANGLE, R1, R2 = 0, 3, 6, 9, 10, 13
LENGTH, ALONG, NOW, KAPPA, SPIN, BY_FIRST = 16, 17, 18, 21, 24, 27
COS, SIN, M1, M2, K1, K2, TAU, RATE = 30, 31, 32, 35, 38, 39, 40, 41
# Stress times weights: moments, torque, and the torque that the smoothing of the twist rate transfers to a point;
# forces by r', r'' and theta; stiffness of k1 and k2 and of the twist rate.
B1, B2, TORQUE, HANDED, G1, G2, G0, S11, S22, S12, STIFF = 44, 45, 46, 47, 48, 51, 54, 55, 56, 57, 58
# The tangent of a point by r' (B), r'' (C) and theta (A): BB and CC are symmetric, (xx, xy, xz, yy, yz, zz).
BB, BC, CC, AB, AC, AA = 59, 65, 74, 80, 83, 86
_ROWS = 87
# Places in W of the first numbers of spans: control points and forces by coordinate, and the twist rate in its span, as
# independent mean and slope: their stiffnesses and their derivatives with respect to the control points.
Q, F = _ROWS * LANES, _ROWS * LANES + 16 * SPANS
OF_MEAN, OF_SLOPE, LEAN = F + 16 * SPANS, F + 17 * SPANS, F + 18 * SPANS
MEAN, RISE = F + 19 * SPANS, F + 35 * SPANS
SIZE = F + 51 * SPANS
BLOCK = 16 * SPANS  # numbers of the tangent's blocks of two control points, in each of the spans
KNOT = 3  # place [m], S and R [rad] of a knot, see `twisted_angles.py`
# Workspace of an assembly: W, a block and the first knot; and the numbers for each curvature point.
ROOM, ROOM_OF_POINT = SIZE + BLOCK + KNOT, KNOT // POINTS


@law
def count_of(points: int, group: int) -> int:
    """Return the number of spans in a group."""
    return min(SPANS, points // POINTS - SPANS * group)


@law
def derivatives(
    length: float, h: float, director: Vector, by_spin: float, spin: Vector, by_t: float, t: Vector
) -> tuple[Vector, Vector]:
    """Return the derivatives of a curvature along a director, which turns with the frames: by r' and by r''."""
    inverse = 1.0 / length
    along = h * inverse
    first = (
        (by_spin * spin[0] + by_t * t[0] - along * director[0]) * inverse,
        (by_spin * spin[1] + by_t * t[1] - along * director[1]) * inverse,
        (by_spin * spin[2] + by_t * t[2] - along * director[2]) * inverse,
    )
    return first, (director[0] * inverse, director[1] * inverse, director[2] * inverse)
