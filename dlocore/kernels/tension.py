"""The tension that the tangent of a step uses: the one that the last update predicts, not that of the current strain.

The predicted state of a step has an error of less than 1e-4 of the length, but its strain is so wrong that the tension
of a nearly inextensible cable is wrong many times over. The tension times the second derivative of the strain is part
of the tangent, and would spoil the first Newton iteration, which is often the only one needed. Therefore the tension is
an unknown of its own in the tangent (mixed integration points: Magisano, Leonetti and Garcea, 2017). The first
iteration of a step uses the tension of the last step; each further one uses the tension that the previous iteration
predicts,

    N = N(e) + dN/de  t . dr',

to first order in the change dr'. Forces are always those of the strain, so the iterations converge to the same result.
"""

from typing import Any

import numpy as np

from dlocore.compiling.kernel import part
from dlocore.kernels.basis import row_of

# columns of `History.tension` [N]: the tension that the tangent uses, NaN for the current one; the tension of the
# strain at the last assembly, and its derivative with respect to the strain; the tension of the last step
ASSUMED, AT_HAND, MODULUS, LAST = range(4)
COLUMNS = 4


@part
def assumed(kept: Any, n: int, tension: float) -> float:
    """Return the tension [N] that the tangent uses at an axial point, where the strain gives `tension`."""
    return kept[n, ASSUMED] if len(kept) > 0 and not np.isnan(kept[n, ASSUMED]) else tension


@part
def assume_last(kept: Any, known: bool) -> None:
    """Use the tension of the last step, or if it is not `known` the current one."""
    for n in range(len(kept)):
        kept[n, ASSUMED] = kept[n, LAST] if known else np.nan


@part
def point_on(nc: int, q: Any, change: Any, points: Any, kept: Any) -> None:
    """Use the tension that a change (n, nc) [m] predicts, from the last assembly of forces and tangent to q."""
    for n in range(len(kept)):
        k = points.first[n]
        b = row_of(points.b1, n)
        square, along = 0.0, 0.0
        for d in range(min(nc, 3)):
            slope, turn = 0.0, 0.0
            for i in range(4):
                slope += b[i] * (q[k + i, d] - change[k + i, d])
                turn += b[i] * change[k + i, d]
            square += slope * slope
            along += slope * turn
        kept[n, ASSUMED] = kept[n, AT_HAND] + kept[n, MODULUS] * along / np.sqrt(square)


@part
def keep(kept: Any) -> None:
    """Store the tension that the tangent would now use as that of the last step."""
    for n in range(len(kept)):
        kept[n, LAST] = kept[n, ASSUMED]
