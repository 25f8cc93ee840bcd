"""The compiled time loop of the fast explicit rod (benchmarks/peers/explicit.py).

With the edges d_k = (r_{k+1} - r_k)/h_k, which a nearly inextensible cable keeps close to unit vectors, the energy

    sum_k EA/8 (d_k.d_k - 1)^2 h_k  +  sum_nodes EI/2 |d_k - d_{k-1}|^2 / l_k

is a polynomial: it differs from that of docs/model.md by the axial strain times itself, a thousandth here, and costs
neither root nor division, so that the loops over the nodes are vectorised.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numba import njit


def _build(dims: int) -> Callable[..., None]:
    """Return the loop in `dims` dimensions."""

    @njit(cache=True, nogil=True, error_model="numpy", fastmath={"contract", "reassoc", "nsz"})
    def march(
        x: Any,
        dt: float,
        steps: int,
        h: Any,
        cells: Any,
        EA: float,
        EI: float,
        mu: float,
        drag: float,
        gravity: Any,
        held: Any,
        path: Any,
        slope: Any,
        out: Any,
    ) -> None:
        """March from rest by position Verlet through len(out) - 1 intervals of `steps` steps of `dt` [s].

        Changes x (dims, n) [m]; out (intervals + 1, dims, n) receives its positions. Held nodes follow the cubic
        through `path` and `slope` (intervals + 1, held, dims) [m, m/s] in each interval.
        """
        n = x.shape[1]
        inverse = 1.0 / h
        axial = 0.5 * EA
        stiff = np.zeros(n)
        for k in range(1, n - 1):
            stiff[k] = EI / (0.5 * (h[k - 1] + h[k]))
        damp = 0.5 * dt * drag / mu
        keep, factor = (1.0 - damp) / (1.0 + damp), dt / (1.0 + damp)
        gain = factor / (mu * cells)
        fall = factor * gravity
        first = 0.5 * factor / (mu * cells)  # from rest: half a step to the first half instant
        d = np.zeros((dims, n - 1))
        q = np.zeros((dims, n + 1))  # of the edges, with a zero beyond each end
        s = np.zeros((dims, n))
        v = np.zeros((dims, n))
        span = steps * dt
        for e in range(dims):
            for k in range(n):
                out[0, e, k] = x[e, k]
        for i in range(out.shape[0] - 1):
            for j in range(steps):
                for k in range(n - 1):
                    square = 0.0
                    for e in range(dims):
                        d[e, k] = (x[e, k + 1] - x[e, k]) * inverse[k]
                        square += d[e, k] * d[e, k]
                    tension = axial * (square - 1.0)
                    for e in range(dims):
                        q[e, k + 1] = tension * d[e, k]
                for e in range(dims):
                    for k in range(1, n - 1):
                        s[e, k] = stiff[k] * (d[e, k] - d[e, k - 1])
                for e in range(dims):
                    for k in range(n - 1):
                        q[e, k + 1] += (s[e, k] - s[e, k + 1]) * inverse[k]
                if i == 0 and j == 0:
                    for e in range(dims):
                        for k in range(n):
                            v[e, k] = first[k] * (q[e, k + 1] - q[e, k]) + 0.5 * fall[e]
                else:
                    for e in range(dims):
                        for k in range(n):
                            v[e, k] = keep * v[e, k] + gain[k] * (q[e, k + 1] - q[e, k]) + fall[e]
                for e in range(dims):
                    for k in range(n):
                        x[e, k] += dt * v[e, k]
                z = (j + 1) / steps
                for c in range(len(held)):
                    for e in range(dims):
                        a, b = path[i, c, e], path[i + 1, c, e]
                        p, r = span * slope[i, c, e], span * slope[i + 1, c, e]
                        bend = z * (1.0 - z)
                        x[e, held[c]] = a + z * (b - a) + bend * ((1.0 - z) * (p - b + a) - z * (r - b + a))
            for e in range(dims):
                for k in range(n):
                    out[i + 1, e, k] = x[e, k]

    return march


march_plane = _build(2)
march_space = _build(3)
