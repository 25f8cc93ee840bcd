"""Surfaces that a rod touches: the distance of a point from them, and the force there (docs/model.md eq. 21, 22)."""

from typing import Any

import numpy as np

from dlocore.reference.compile import compiled

# a row: kind, centre 3, axes of the body's frame 9, half sizes 3, rounding radius, friction
PLANE, BOX, CYLINDER = range(3)  # a sphere is a rounded point and a capsule a rounded segment: boxes without width
ROW = 18
_AXIS = 4
_HALF = 13
ROUNDING = 16
FRICTION = 17


@compiled
def gap(row: Any, x: Any, n: Any) -> float:
    """Return the signed distance [m] of x (3,) from the surface of `row` (ROW,), and write its normal into n (3,)."""
    p = np.empty(3)
    for k in range(3):
        p[k] = 0.0
        for d in range(3):
            p[k] += row[_AXIS + 3 * k + d] * (x[d] - row[1 + d])
    local = np.zeros(3)
    if row[0] == PLANE:
        local[2] = 1.0
        distance = p[2]
    else:
        q = np.empty(3)
        if row[0] == CYLINDER:
            q[0] = np.sqrt(p[0] * p[0] + p[1] * p[1]) - row[_HALF]
            q[1] = -1e300
        else:
            q[0] = abs(p[0]) - row[_HALF]
            q[1] = abs(p[1]) - row[_HALF + 1]
        q[2] = abs(p[2]) - row[_HALF + 2]
        out = 0.0
        for k in range(3):
            out += max(q[k], 0.0) ** 2
        if out > 0.0:
            out = np.sqrt(out)
            for k in range(3):
                local[k] = max(q[k], 0.0) / out
            distance = out - row[ROUNDING]
        else:  # inside, the nearest face counts
            k = int(np.argmax(q))
            local[k] = 1.0
            distance = q[k] - row[ROUNDING]
        if row[0] == CYLINDER:
            radius = max(np.sqrt(p[0] * p[0] + p[1] * p[1]), 1e-300)
            local[1] = local[0] * p[1] / radius
            local[0] = local[0] * p[0] / radius
        else:
            for k in range(2):
                local[k] = np.copysign(local[k], p[k])
        local[2] = np.copysign(local[2], p[2])
    for d in range(3):
        n[d] = 0.0
        for k in range(3):
            n[d] += row[_AXIS + 3 * k + d] * local[k]
    return distance


@compiled
def thickness(row: Any) -> float:
    """Return the depth [m] of the middle of the solid of `row` (ROW,); infinite for a plane."""
    if row[0] == PLANE:
        return np.inf
    across = row[_HALF] if row[0] == CYLINDER else min(row[_HALF], row[_HALF + 1])
    return min(across, row[_HALF + 2]) + row[ROUNDING]


@compiled
def press(stiffness: float, width: float, damping: float, depth: float, approach: float) -> tuple[float, float, float]:
    """Return the normal force per length N [N/m], dN/d(depth) and dN/d(speed of approach): docs/model.md eq. 21."""
    if depth <= 0.0:
        return 0.0, 0.0, 0.0
    slope = min(depth / width, 1.0)
    elastic = stiffness * (0.5 * depth * depth / width if depth < width else depth - 0.5 * width)
    N = elastic + damping * slope * approach
    if N <= 0.0:
        return 0.0, 0.0, 0.0
    return N, stiffness * slope, damping * slope


@compiled
def rub(
    limit: float, n: Any, slip: Any, v: Any, stick: float, density: float, implicit: float, force: Any, tangent: Any
) -> None:
    """Write Coulomb's friction against the slip (3,) from an anchor, and minus its derivative, (3,), (3, 3).

    f = -mu N x/max(|x|, s_0) with x = s + lag v (docs/model.md eq. 22). The lag makes the sticking critically damped,
    so that what sticks does not swing about its anchor, and leaves the force of what slides as it is. The slip is
    limited to `stick` = s_0 [m] in place, by dragging the anchor along. Components of slip and velocity along the
    normal n do not count.

    Args:
        limit: mu N [N/m].
        density: of the cable [kg/m].
        implicit: derivative of the slip with respect to the velocity v (3,) [s].
    """
    lag = 2.0 * np.sqrt(density * stick / limit)
    along = slip[0] * n[0] + slip[1] * n[1] + slip[2] * n[2]
    speed = v[0] * n[0] + v[1] * n[1] + v[2] * n[2]
    cut = size = 0.0
    for d in range(3):
        slip[d] -= along * n[d]
        force[d] = slip[d] + lag * (v[d] - speed * n[d])
        cut += slip[d] * slip[d]
        size += force[d] * force[d]
    cut, size = np.sqrt(cut), np.sqrt(size)
    scale = limit / max(size, stick)
    slope = scale * (1.0 + lag / implicit)
    for i in range(3):
        for j in range(3):
            tangent[i, j] = slope * ((1.0 if i == j else 0.0) - n[i] * n[j])
            if size > stick:
                tangent[i, j] -= slope * force[i] * force[j] / (size * size)
    for d in range(3):
        force[d] *= -scale
        if cut > stick:
            slip[d] *= stick / cut
