"""Compiled inner loops of the explicit discrete elastic rod (benchmarks/rod.py); they share no code with the solver.

Edges e_k = r_{k+1} - r_k have the rest length h_k, the direction t_k and 1/|e_k|. A hinge joins two directions a and b
over the length l of cable between their midpoints. The energy is

    sum_k EA/2 (|e_k|/h_k - 1)^2 h_k  +  sum_hinges EI/(2 l) (phi - phi0)^2,   phi the angle from t_a to t_b.

A held direction is one more column of t with 1/|e| = 0, joined to each adjacent edge over half the length of that edge.
In the plane phi is signed; in space it is not, and the rest angle is zero.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def turning_angle(sine: float, cosine: float) -> float:
    """Return atan2(sine, cosine) of a unit pair; by the series of asin where that is faster and exact to 1e-16."""
    x = sine * sine
    if cosine > 0.0 and x < 0.0064:  # 4.6 degrees
        tail = x * (5 / 112 + x * (35 / 1152 + x * (63 / 2816 + x * (231 / 13312 + x * (143 / 10240)))))
        return sine * (1.0 + x * (1 / 6 + x * (3 / 40 + tail)))
    return np.arctan2(sine, cosine)


@njit(cache=True, nogil=True, error_model="numpy")
def bend_plane(
    t: Any, inverse: Any, rate: Any, q: Any, first: Any, second: Any, per_length: Any, rest: Any, EI: float, eta: float
) -> None:
    """Add to the edge forces `q` (2, e) [N] the bending moments m = (EI (phi - phi0) + eta phi') / l of all hinges.

    With the normal n = z x t: d phi/d e_a = -n_a/|e_a| and d phi/d e_b = n_b/|e_b|.
    """
    for j in range(len(first)):
        a, b = first[j], second[j]
        ax, ay, bx, by = t[0, a], t[1, a], t[0, b], t[1, b]
        m = EI * (turning_angle(ax * by - ay * bx, ax * bx + ay * by) - rest[j])
        if eta > 0.0:
            m += eta * (bx * rate[1, b] - by * rate[0, b] - ax * rate[1, a] + ay * rate[0, a])
        m *= per_length[j]
        on_a, on_b = m * inverse[a], m * inverse[b]
        q[0, a] += on_a * ay
        q[1, a] -= on_a * ax
        q[0, b] -= on_b * by
        q[1, b] += on_b * bx


@njit(cache=True, nogil=True, error_model="numpy")
def bend_space(t: Any, inverse: Any, q: Any, first: Any, second: Any, per_length: Any, EI: float) -> None:
    """Add to the edge forces `q` (3, e) [N] the elastic ones of all hinges in space, where the angle has no sign."""
    for j in range(len(first)):
        a, b = first[j], second[j]
        less, more = 0.0, 0.0
        for d in range(3):
            less += (t[d, b] - t[d, a]) ** 2
            more += (t[d, b] + t[d, a]) ** 2
        cosine = 0.25 * (more - less)
        sine = 0.5 * np.sqrt(less * more)  # exact for small angles too
        ratio = turning_angle(sine, cosine) / sine if sine > 1e-100 else 1.0
        stiff = EI * ratio * per_length[j]
        for d in range(3):
            q[d, a] -= stiff * inverse[a] * (t[d, b] - cosine * t[d, a])
            q[d, b] -= stiff * inverse[b] * (t[d, a] - cosine * t[d, b])


@njit(cache=True, nogil=True, error_model="numpy", inline="always")
def _binormal(a: Any, b: Any, out: Any) -> None:
    """Write 2 a x b/(1 + a . b) of two unit vectors."""
    s = 2.0 / (1.0 + a[0] * b[0] + a[1] * b[1] + a[2] * b[2])
    out[0], out[1], out[2] = (
        s * (a[1] * b[2] - a[2] * b[1]),
        s * (a[2] * b[0] - a[0] * b[2]),
        s * (a[0] * b[1] - a[1] * b[0]),
    )


@njit(cache=True, nogil=True, error_model="numpy")
def damp_space(t: Any, inverse: Any, rate: Any, q: Any, first: Any, second: Any, per_length: Any, eta: float) -> None:
    """Add to the edge forces `q` (3, e) [N] those of the damping of all hinges in space.

    The damping is that of the model (docs/model.md eq. 9) on D = t_b - t_a, the discrete curvature times l, as seen by
    sections that do not twist. Hinges are perpendicular to the mean tangent m. From one hinge to the next, sections
    spin by the change of the angle by which carrying along the rod and carrying in time differ. The common spin of all
    sections is the one of least power. Along D the rate is that of the angle phi itself; across D it is that of a
    vector of the length phi. The torque that keeps the sections from twisting acts on m.
    """
    hinges = len(first)
    m, dm = np.empty((hinges, 3)), np.empty((hinges, 3))  # mean tangent and its rate
    D, A = np.empty((hinges, 3)), np.empty((hinges, 3))  # D and its rate
    size, stretch = np.empty(hinges), np.empty(hinges)  # |t_a + t_b|, and (phi/|D|)^2
    side, binormal = np.empty(3), np.empty(3)
    spin, power, square = 0.0, 0.0, 0.0
    for j in range(hinges):
        a, b = first[j], second[j]
        more, less, turned, along = 0.0, 0.0, 0.0, 0.0
        for d in range(3):
            m[j, d], dm[j, d] = t[d, b] + t[d, a], rate[d, b] + rate[d, a]
            D[j, d], A[j, d] = t[d, b] - t[d, a], rate[d, b] - rate[d, a]
            more += m[j, d] ** 2
            less += D[j, d] ** 2
        size[j] = np.sqrt(more)
        sine = np.sqrt(less * more)
        stretch[j] = (turning_angle(0.5 * sine, 0.25 * (more - less)) ** 2 / less) if less > 1e-24 else 1.0
        for d in range(3):
            m[j, d] /= size[j]
            turned += m[j, d] * A[j, d]
            along += m[j, d] * dm[j, d]
        for d in range(3):
            A[j, d] -= turned * m[j, d]
            dm[j, d] = (dm[j, d] - along * m[j, d]) / size[j]
        if j > 0:
            _binormal(m[j - 1], m[j], binormal)
            for d in range(3):
                spin -= 0.5 * binormal[d] * (dm[j - 1, d] + dm[j, d])
        w = per_length[j] * stretch[j]
        for d in range(3):
            side[d] = m[j, d - 2] * D[j, d - 1] - m[j, d - 1] * D[j, d - 2]
        for d in range(3):
            A[j, d] -= spin * side[d]
            power += w * side[d] * A[j, d]
            square += w * side[d] * side[d]
    spin = power / square if square > 0.0 else 0.0
    torque = 0.0
    for j in range(hinges):
        a, b = first[j], second[j]
        less, radial = 0.0, 0.0
        for d in range(3):
            side[d] = m[j, d - 2] * D[j, d - 1] - m[j, d - 1] * D[j, d - 2]
            A[j, d] -= spin * side[d]
            less += D[j, d] ** 2
            radial += D[j, d] * A[j, d]
        # 1/cos^2(phi/2) - (phi/|D|)^2, divided by |D|^2: phi^2/6 to second order
        more = (4.0 / size[j] ** 2 - stretch[j]) / less if less > 1e-8 else 1.0 / 6.0
        if j > 0:
            _binormal(m[j - 1], m[j], binormal)
            for k in (j - 1, j):
                along = 0.0
                for d in range(3):
                    along += binormal[d] * m[k, d]
                for d in range(3):
                    # transfer the force on m to the two tangents and their edges
                    on = -0.5 * torque * (binormal[d] - along * m[k, d]) / size[k]
                    dm[k, d] = dm[k, d] + on if k < j else on
        else:
            for d in range(3):
                dm[j, d] = 0.0
        for d in range(3):
            A[j, d] = eta * per_length[j] * (stretch[j] * A[j, d] + more * radial * D[j, d])
            torque += side[d] * A[j, d]
    for j in range(hinges):
        for column, sign in ((first[j], -1.0), (second[j], 1.0)):
            along = 0.0
            for d in range(3):
                along += (sign * A[j, d] + dm[j, d]) * t[d, column]
            for d in range(3):
                q[d, column] += inverse[column] * (sign * A[j, d] + dm[j, d] - along * t[d, column])


def _build(dims: int) -> Callable[..., float]:
    """Return the compiled time loop in `dims` dimensions."""

    @njit(cache=True, nogil=True, error_model="numpy")
    def march(
        x: Any,
        v: Any,
        previous: float,
        spans: Any,
        counts: Any,
        h: Any,
        cells: Any,
        first: Any,
        second: Any,
        per_length: Any,
        rest: Any,
        EA: float,
        EI: float,
        eta: float,
        mu: float,
        drag: float,
        quadratic: float,
        gravity: Any,
        held: Any,
        path: Any,
        directions: Any,
        loaded: Any,
        loads: Any,
        out: Any,
    ) -> float:
        """March by leapfrog (position Verlet) through `len(counts)` intervals; return the last step [s].

        Changes `x` (dims, n) [m] and `v` (dims, n) [m/s]; v belongs half a step earlier. In interval i, `counts[i]`
        steps of `spans[i]` [s] are taken, and `out[i]` (n, dims) receives the positions at its end. `path` (steps + 1,
        held, dims), `directions` (steps + 1, held directions, dims) and `loads` (steps + 1, loaded, dims) [N] hold
        their values at every instant. Drag is evaluated at the centre of the step, bending damping half a step late: a
        first-order error, but the step is a thousandth of the time scale of the fastest motion that matters.
        """
        edges, turning = len(h), directions.shape[1]
        t = np.zeros((dims, edges + turning))
        rate = np.zeros((dims, edges + turning))
        q = np.zeros((dims, edges + turning))
        inverse = np.zeros(edges + turning)
        force = np.zeros((dims, edges + 1))
        mobility = 1.0 / (mu * cells)
        trial = np.zeros(dims)
        now = 0
        for i in range(len(counts)):
            dt = spans[i]
            for _ in range(counts[i]):
                for k in range(edges):
                    square = 0.0
                    for d in range(dims):
                        t[d, k] = x[d, k + 1] - x[d, k]
                        square += t[d, k] * t[d, k]
                    length = np.sqrt(square)
                    inverse[k] = 1.0 / length
                    tension = EA * (length / h[k] - 1.0)
                    for d in range(dims):
                        t[d, k] *= inverse[k]
                        q[d, k] = tension * t[d, k]
                for c in range(turning):
                    for d in range(dims):
                        t[d, edges + c] = directions[now, c, d]
                if eta > 0.0:
                    for k in range(edges):
                        along = 0.0
                        for d in range(dims):
                            rate[d, k] = (v[d, k + 1] - v[d, k]) * inverse[k]
                            along += rate[d, k] * t[d, k]
                        for d in range(dims):
                            rate[d, k] -= along * t[d, k]
                    for c in range(turning):
                        for d in range(dims):
                            rate[d, edges + c] = (directions[now + 1, c, d] - directions[now, c, d]) / dt
                if dims == 2:
                    bend_plane(t, inverse, rate, q, first, second, per_length, rest, EI, eta)
                else:
                    bend_space(t, inverse, q, first, second, per_length, EI)
                    if eta > 0.0:
                        damp_space(t, inverse, rate, q, first, second, per_length, eta)
                for d in range(dims):
                    force[d, 0] = q[d, 0]
                    for k in range(1, edges):
                        force[d, k] = q[d, k] - q[d, k - 1]
                    force[d, edges] = -q[d, edges - 1]
                for c in range(len(loaded)):
                    for d in range(dims):
                        force[d, loaded[c]] += loads[now, c, d]

                step = 0.5 * (previous + dt)
                damp = 0.5 * step * drag / mu
                if quadratic > 0.0:
                    for k in range(edges + 1):
                        square = 0.0
                        for d in range(dims):
                            square += v[d, k] * v[d, k]
                        slow = damp + 0.5 * step * quadratic / mu * np.sqrt(square)
                        square = 0.0
                        for d in range(dims):
                            push = step * (force[d, k] * mobility[k] + gravity[d])
                            trial[d] = 0.5 * (v[d, k] + (v[d, k] * (1.0 - slow) + push) / (1.0 + slow))
                            square += trial[d] * trial[d]
                        slow = damp + 0.5 * step * quadratic / mu * np.sqrt(square)
                        for d in range(dims):
                            push = step * (force[d, k] * mobility[k] + gravity[d])
                            v[d, k] = (v[d, k] * (1.0 - slow) + push) / (1.0 + slow)
                else:
                    keep, gain = (1.0 - damp) / (1.0 + damp), step / (1.0 + damp)
                    for d in range(dims):
                        for k in range(edges + 1):
                            v[d, k] = keep * v[d, k] + gain * (force[d, k] * mobility[k] + gravity[d])
                for c in range(len(held)):
                    for d in range(dims):
                        v[d, held[c]] = (path[now + 1, c, d] - x[d, held[c]]) / dt
                for d in range(dims):
                    for k in range(edges + 1):
                        x[d, k] += dt * v[d, k]
                now += 1
                previous = dt
            for k in range(edges + 1):
                for d in range(dims):
                    out[i, k, d] = x[d, k]
        return previous

    return march


march_plane = _build(2)
march_space = _build(3)
