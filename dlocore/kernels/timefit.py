"""The time spline of a march and what it misses of it, in one call."""

from typing import Any

from dlocore.kernels.compile import brief
from dlocore.kernels.march import fit_missed, fit_time


@brief
def fitted(knots: Any, times: Any, states: Any, v0: Any, dimensions: int) -> Any:
    """Return control points (n_t, n, nc) as `fit_time` fits to the states (k, n, nc), and their `fit_missed` (k,)."""
    steps, n, nc = states.shape
    flat = fit_time(knots, times, states.reshape((steps, n * nc)), v0.reshape(n * nc))
    control = flat.reshape((len(knots) - 4, n, nc))
    return control, fit_missed(knots, times, states, control, dimensions)
