"""The rate of curvature seen by sections that do not twist (docs/model.md eq. 9).

All sections of a cable without twist turn together: at every time their frames along the cable are a frame without
twist (a Bishop frame), and only their common spin about the tangent is free. The spin taken is the one that damping
resists least.

Between two neighbouring points, the smallest rotation from one tangent to the other carries the frames. The same holds
in time at each point. Carrying along the cable and carrying in time differ by an angle: the area that the four tangents
enclose on the unit sphere. The sections must spin by this angle, exactly, for steps of any size. So a rigid motion
dissipates nothing, to rounding. `state` (points, 8) holds l, h, t and kappa of the curvature points.
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
    """Return a vector (cos, sin, up to a factor) whose angle is half the area of a triangle on the unit sphere."""
    return 1.0 + _dot(a, b) + _dot(b, c) + _dot(c, a), _dot(a, cross(b, c))


@law
def _spun(x: float, y: float, a0: Vector, b0: Vector, a: Vector, b: Vector) -> tuple[float, float]:
    """Return the spin (cos, sin) at b from the spin (x, y) at a; the tangents were a0 and b0 and are now a and b."""
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
    """Write to out (points, 3) the combination of the last two curvatures in `past`, carried with the sections.

    All sections spin together such that the result is closest to `now` times the curvature of `state`. If the cable
    passes through a straight line within the steps at hand, this would turn its bend over. The result therefore goes
    smoothly to zero with the share of the curvature that the spin cannot explain.
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
    """Write the rate of curvature (points, 3): the combination `rates` of its values now and at the last two steps."""
    carry(weights, state, past, rates[0], -rates[1], -rates[2], rate)
    for n in range(len(weights)):
        for d in range(3):
            rate[n, d] = rates[0] * state[n, BEND + d] - rate[n, d]


@leaf
def rate_by_velocity(weights: Any, state: Any, turning: Any, rate: Any) -> None:
    """Turn the rate of curvature (points, 3) of sections that do not spin into that of sections that do not twist.

    The spin sigma obeys sigma' = t . (t_t x kappa) with t_t = `turning` (points, 3), and sigma(0) minimises the rate.
    Where the whole cable is straight, the spin has no meaning.
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
    """Write the generalised forces by r' (points, 3) of the torque that keeps the sections from twisting.

    The sections have the moment eta `rate`. The rate of this torque along the cable is the component of the moment
    along t x kappa; it is zero at both ends.
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
