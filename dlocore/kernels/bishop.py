"""The rate of curvature that sections without twist see (docs/model.md eq. 9).

A cable that does not twist turns its sections as one: along it they are a frame without twist (a Bishop frame) at every
time, and only the spin of all of them together about the tangent is free. It is the one that damping resists least.

Between two neighbouring points the frames are carried by the smallest rotation that brings one tangent to the other,
and so is in time every frame at its point. What carrying along the cable and in time differ by is an angle, the area
that the four tangents enclose on the unit sphere, and the sections have to spin by it: exactly, for steps of any size.
So a rigid motion costs nothing, to rounding. `state` (points, 8) is l, h, t and kappa of the curvature points.
"""

from typing import Any

import numpy as np

from dlocore.compiling.kernel import law, leaf
from dlocore.effects.base import Vector
from dlocore.kernels.strain import cross, transport, vector

LENGTH, H, TANGENT, BEND = 0, 1, 2, 5  # columns of `state`
STATE = 8


@law
def _dot(a: Vector, b: Vector) -> float:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@law
def _half_area(a: Vector, b: Vector, c: Vector) -> tuple[float, float]:
    """Return a vector whose angle is half the area of a triangle on the unit sphere."""
    return 1.0 + _dot(a, b) + _dot(b, c) + _dot(c, a), _dot(a, cross(b, c))


@law
def _spun(x: float, y: float, a0: Vector, b0: Vector, a: Vector, b: Vector) -> tuple[float, float]:
    """Return the spin at b, as (cos, sin), from that at a, (x, y): tangents were a0 and b0 and are now a and b."""
    c1, s1 = _half_area(a0, a, b)
    c2, s2 = _half_area(a0, b, b0)
    c, s = c1 * c2 - s1 * s2, c1 * s2 + s1 * c2
    square = c * c + s * s
    if square == 0.0:
        return x, y
    c, s = (c * c - s * s) / square, 2.0 * c * s / square
    return c * x - s * y, c * y + s * x


@leaf
def carry(weights: Any, state: Any, past: Any, now: float, last: float, before: float, out: Any) -> None:
    """Write to out (points, 3) the combination of the two last curvatures in `past`, carried with the sections.

    The spin of all sections is the one that brings it nearest to `now` times the curvature of `state`. Where the cable
    passes through a straight line within the steps at hand, that would be to turn its bend over: with the share of the
    curvature that the spin can't explain, it goes smoothly to none.
    """
    x, y = 1.0, 0.0
    along, across, squares = 0.0, 0.0, 0.0
    for n in range(len(weights)):
        w = weights[n]
        t, t0 = vector(state, n, TANGENT), vector(past, n, 6)
        if n > 0:
            x, y = _spun(x, y, vector(past, n - 1, 6), t0, vector(state, n - 1, TANGENT), t)
        bend = (
            last * past[n, 0] + before * past[n, 3],
            last * past[n, 1] + before * past[n, 4],
            last * past[n, 2] + before * past[n, 5],
        )
        bend = transport(t0, t, bend)
        side = cross(t, bend)
        for d in range(3):
            out[n, d] = x * bend[d] + y * side[d]
        bend, kappa = vector(out, n, 0), vector(state, n, BEND)
        along += now * w * _dot(kappa, bend)
        across += now * w * _dot(kappa, cross(t, bend))
        squares += w * (now * now * _dot(kappa, kappa) + _dot(bend, bend))
    if squares == 0.0:
        return
    left = max(squares - 2.0 * np.sqrt(along * along + across * across), 0.0)
    along = abs(along) + left * (left / squares) ** 2
    size = np.sqrt(along * along + across * across)
    along, across = along / size, across / size
    for n in range(len(weights)):
        bend = vector(out, n, 0)
        side = cross(vector(state, n, TANGENT), bend)
        for d in range(3):
            out[n, d] = along * bend[d] + across * side[d]


@leaf
def rate_by_steps(weights: Any, state: Any, past: Any, rates: Any, rate: Any) -> None:
    """Write the rate of curvature (points, 3) as the combination `rates` of its values now and at the last steps."""
    carry(weights, state, past, rates[0], -rates[1], -rates[2], rate)
    for n in range(len(weights)):
        for d in range(3):
            rate[n, d] = rates[0] * state[n, BEND + d] - rate[n, d]


@leaf
def rate_by_velocity(weights: Any, state: Any, turning: Any, rate: Any) -> None:
    """Take the spin out of the rate of curvature (points, 3) of sections that do not spin.

    The spin sigma obeys sigma' = t . (t_t x kappa) with t_t = `turning` (points, 3), and sigma(0) is such that the rate
    is least. Where all of the cable is straight, the spin means nothing.
    """
    spin, across, square = 0.0, 0.0, 0.0
    for n in range(len(weights)):
        t, kappa = vector(state, n, TANGENT), vector(state, n, BEND)
        if n > 0:
            binormal = _binormal(vector(state, n - 1, TANGENT), t)
            spin -= 0.5 * (_dot(binormal, vector(turning, n - 1, 0)) + _dot(binormal, vector(turning, n, 0)))
        side = cross(t, kappa)
        for d in range(3):
            rate[n, d] -= spin * side[d]
        across += weights[n] * _dot(side, vector(rate, n, 0))
        square += weights[n] * _dot(kappa, kappa)
    if square == 0.0:
        return
    spin = across / square
    for n in range(len(weights)):
        side = cross(vector(state, n, TANGENT), vector(state, n, BEND))
        for d in range(3):
            rate[n, d] -= spin * side[d]


@law
def _binormal(a: Vector, b: Vector) -> Vector:
    """Return 2 a x b/(1 + a . b), about t x kappa times the length between two points."""
    s = 2.0 / (1.0 + _dot(a, b))
    axis = cross(a, b)
    return s * axis[0], s * axis[1], s * axis[2]


@leaf
def torques(weights: Any, state: Any, eta: float, rate: Any, out: Any) -> None:
    """Write the generalised forces (points, 3) by r' of the torque that keeps sections with the moment eta rate from
    twisting: its rate along the cable is the moment's part about t x kappa, and it is zero at both ends.
    """
    torque = 0.0
    out[:] = 0.0
    for n in range(len(weights)):
        t = vector(state, n, TANGENT)
        if n > 0:
            binormal = _binormal(vector(state, n - 1, TANGENT), t)
            for d in range(3):
                out[n - 1, d] -= 0.5 * torque * binormal[d]
                out[n, d] -= 0.5 * torque * binormal[d]
        torque += weights[n] * eta * _dot(vector(rate, n, 0), cross(t, vector(state, n, BEND)))
    for n in range(len(weights)):
        t = vector(state, n, TANGENT)
        along = _dot(vector(out, n, 0), t)
        for d in range(3):
            out[n, d] = (out[n, d] - along * t[d]) / state[n, LENGTH]
