"""How near a motion comes to obstacles: the least gap over the whole surface, also between samples."""

from functools import reduce

import numpy as np
from numpy.typing import NDArray

from dlocore.effects.distance import distances
from dlocore.kernels.basis import basis_rows
from dlocore.spline import DEGREE, SplineSurface

Floats = NDArray[np.float64]

_PARTS = 4  # into which a cell is cut, along the cable or in time, in the direction of larger doubt
_MOST = 256  # cells cut in a round: if a cable lies on an obstacle for long, many are equally near
_ROUNDS = 30  # most rounds of cuts, a tenth of a second
_BENDS = (2, 0), (1, 1), (0, 2)  # orders of the derivatives that bound how far a cell deviates from linear
_STEP = 1e-6  # of half a cell: step for slopes


def least_distance(surface: SplineSurface, rows: Floats, tolerance: float) -> float:
    """Return the least signed distance [m] of a surface's centreline from obstacles.

    It is right to `tolerance` [m] unless the cable bends so fast that the rounds of cuts do not suffice. Then it is the
    least one that was found, since the cells whose middles are nearest are cut first.

    Obstacles are convex, so their distance is nowhere below its tangent plane at the middle of a cell of the surface.
    The control points of the second derivatives bound how far the cell's points deviate from linear. Cells that can't
    be nearer than the nearest point so far are dropped. The others are cut, _MOST of them in a round.

    Args:
        surface: the motion.
        rows: of the obstacles (m, ROW), see `effects/distance.py`.
        tolerance: above zero.
    """
    (u, half_u), (t, half_t) = _spans(surface.knots_u), _spans(surface.knots_t)
    gaps = distances(rows, np.ascontiguousarray(surface.positions(u, t).reshape(-1, 3))).min(axis=1)
    least = float(gaps.min())
    way = _largest(surface, 1, 0) * half_u + _largest(surface, 0, 1) * half_t[:, None]
    near = (gaps.reshape(way.shape) - way < least - tolerance) & (half_u > 0.0) & (half_t > 0.0)[:, None]
    if not near.any():
        return least
    k, i = np.nonzero(near)
    cells = np.column_stack([u[i], t[k], half_u[i], half_t[k], *[_largest(surface, *order)[k, i] for order in _BENDS]])
    left = np.empty((0, cells.shape[1] + 3))  # cells with their gap, its lower bound, and the axis to cut along
    for _ in range(_ROUNDS):
        if len(cells) == 0:
            break
        gaps, doubt = _looked_at(surface, rows, cells)
        least = min(least, float(gaps.min()))
        nearest = (gaps - doubt.sum(axis=0)).min(axis=1)
        in_time = doubt[1].max(axis=1) > doubt[0].max(axis=1)
        left = np.concatenate([left, np.column_stack([cells, gaps.min(axis=1), nearest, in_time])])
        left = left[left[:, -2] < least - tolerance]
        left = left[np.argsort(left[:, -3])]
        cells, left = _cut(left[:_MOST, :-3], left[:_MOST, -1].astype(int)), left[_MOST:]
    return least


def _spans(knots: Floats) -> tuple[Floats, Floats]:
    """Return middles and half widths (k,) of the spans between knots (k + 7,), including spans of zero width."""
    begin, end = knots[DEGREE : -DEGREE - 1], knots[DEGREE + 1 : -DEGREE]
    return 0.5 * (begin + end), 0.5 * (end - begin)


def _largest(surface: SplineSurface, du: int, dt: int) -> Floats:
    """Return a bound on a derivative of r in each span (spans in time, spans along the cable) [m/(m^du s^dt)]."""
    control = surface.control_points[..., :3]
    for axis, knots, order in ((1, surface.knots_u, du), (0, surface.knots_t, dt)):
        for k in range(1, order + 1):
            n = control.shape[axis] - 1
            width = knots[DEGREE + 1 : DEGREE + 1 + n] - knots[k : k + n]
            factor = np.divide(DEGREE + 1.0 - k, width, out=np.zeros(n), where=width > 0.0)
            control = np.diff(control, axis=axis) * np.expand_dims(factor, (1 - axis, 2))
    bound = np.sqrt(np.einsum("kid,kid->ki", control, control))
    for order in (dt, du):  # the control points of a span, first in time, then along the cable
        count = len(bound) - DEGREE + order
        bound = reduce(np.maximum, (bound[k : k + count] for k in range(DEGREE + 1 - order))).T
    return bound


def _looked_at(surface: SplineSurface, rows: Floats, cells: Floats) -> tuple[Floats, Floats]:
    """Return the distances of the middles of cells from obstacles, and by how much they may be less in the cells.

    Args:
        surface: the motion.
        rows: of the obstacles (m, ROW).
        cells: their middles u [m], t [s] and half widths, and bounds of |r_uu|, |r_ut| and |r_tt| in them (k, 7).

    Returns:
        The distances (k, m) [m], and the possible decrease along the cable and in time (2, k, m) [m].
    """
    u, t, half_u, half_t, r_uu, r_ut, r_tt = cells.T
    places, times = [u, u + _STEP * half_u, u], [t, t, t + _STEP * half_t]
    found = distances(rows, _points(surface, np.concatenate(places), np.concatenate(times)))
    gaps, beside, after = found.reshape(3, len(cells), -1)
    slopes = np.abs([beside - gaps, after - gaps]) / _STEP
    across = r_ut * half_u * half_t
    bent = 0.5 * np.array([r_uu * half_u**2 + across, r_tt * half_t**2 + across])
    return gaps, slopes + bent[:, :, None]


def _cut(cells: Floats, along: NDArray[np.int64]) -> Floats:
    """Return the cells (k, 7) cut into _PARTS each, in u where `along` (k,) is 0 and in t where it is 1."""
    out = np.repeat(cells, _PARTS, axis=0)
    k, axis = np.arange(len(out)), np.repeat(along, _PARTS)
    place = (2.0 * np.arange(_PARTS) + 1.0) / _PARTS - 1.0  # middles of the parts, relative to half the width
    out[k, axis] += np.tile(place, len(cells)) * out[k, axis + 2]
    out[k, axis + 2] /= _PARTS
    return out


def _points(surface: SplineSurface, u: Floats, t: Floats) -> Floats:
    """Return the points r (k, 3) [m] at the pairs of u (k,) [m] and t (k,) [s]."""
    first_u, over_u = basis_rows(np.array(surface.knots_u), u, 0)
    first_t, over_t = basis_rows(np.array(surface.knots_t), t, 0)
    near = np.arange(DEGREE + 1)
    control = surface.control_points[(first_t[:, None] + near)[:, :, None], (first_u[:, None] + near)[:, None]]
    return np.asarray((over_t @ (over_u[:, None] @ control).squeeze(2))[:, 0, :3])
