"""How well each of many smoothing strengths explains the data of a penalised spline."""

from typing import Any

import numpy as np

from dlocore.compiling.kernel import brief
from dlocore.kernels.banded import factor, solve

LEAST_NOISE = 1e-6  # relative to the size of the data: below it, rounding would choose the smoothness, not the data
TINY = 1e-300  # so that data that are all zero have a logarithm


@brief
def scores(
    normal: Any, penalty: Any, right: Any, square: float, count: int, most_noise: float, strengths: Any
) -> Any:  # fmt: skip
    """Return -2 log of the restricted likelihood (k,), up to a constant, for each lambda in `strengths` (k,).

    It is infinite where lambda is so weak that rounding leaves a long gap between the data undetermined.

    Args:
        normal, penalty: (n, 4) bands A and P, by column below their diagonals.
        right: (n, 3) b.
        square: D + b . c, the sum w |y|^2 of the data.
        count: number of data.
        most_noise: bound on the standard deviation of a coordinate of the data.
        strengths: (k,), increasing. The minimum of misfit plus penalty increases with them, apart from rounding; where
            lambda is so strong that rounding drowns this minimum, its previous value is used.
    """
    n, width = normal.shape
    free = n - 3
    seen = 3 * max(count - 3, 1)
    band = np.empty((n, width))
    c = np.empty(n)
    out = np.empty(len(strengths))
    least = 0.0
    for k in range(len(strengths)):
        for i in range(n):
            for o in range(width):
                band[i, o] = normal[i, o] + strengths[k] * penalty[i, o]
        if factor(band) >= 0:
            out[k] = np.inf
            continue
        misfit = square
        for d in range(right.shape[1]):
            c[:] = right[:, d]
            solve(band, c)
            for i in range(n):
                misfit -= c[i] * right[i, d]
        least = max(misfit, least)
        misfit = least + LEAST_NOISE**2 * square + TINY
        variance = min(misfit / seen, most_noise**2)
        determinant = 0.0
        for i in range(n):
            determinant += np.log(band[i, 0])
        fit = np.log(variance) + misfit / (seen * variance)
        out[k] = seen / 3 * fit + determinant - free * np.log(strengths[k])
    return out
