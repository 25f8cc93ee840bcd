"""The time spline of a march: what it misses of the march, and where its surface is, in one call each."""

from typing import Any

import numpy as np

from dlocore.kernels.basis import basis_rows
from dlocore.kernels.compile import brief
from dlocore.kernels.march import fit_missed, fit_time


@brief
def fitted(knots: Any, times: Any, states: Any, v0: Any, dimensions: int) -> Any:
    """Return control points (n_t, n, nc) as `fit_time` fits to the states (k, n, nc), and their `fit_missed` (k,)."""
    steps, n, nc = states.shape
    flat = fit_time(knots, times, states.reshape((steps, n * nc)), v0.reshape(n * nc))
    control = flat.reshape((len(knots) - 4, n, nc))
    return control, fit_missed(knots, times, states, control, dimensions)


@brief
def sampled(knots_t: Any, knots_u: Any, control: Any, count: int) -> Any:
    """Return the surface of control points (n_t, n, nc) at `count` even times and places (count, count, nc) [m]."""
    _, n, nc = control.shape
    share = np.arange(count) / (count - 1)
    first_t, over = basis_rows(knots_t, share * knots_t[-1], 0)
    first_u, along = basis_rows(knots_u, share * knots_u[-1], 0)
    out = np.zeros((count, count, nc))
    q = np.empty((n, nc))
    for k in range(count):
        q[:] = 0.0
        for j in range(4):
            b = over[k, 0, j]
            for i in range(n):
                for d in range(nc):
                    q[i, d] += b * control[first_t[k] + j, i, d]
        for s in range(count):
            for i in range(4):
                for d in range(nc):
                    out[k, s, d] += along[s, 0, i] * q[first_u[s] + i, d]
    return out
