"""The tension that the tangent of a step takes: not that of the strain at hand, but the one that it points to.

The predicted state of a step is off by less than 1e-4 of the length, and yet strained by so much that the tension of a
cable that hardly stretches is wrong many times over. Its part of the tangent, tension times the second derivative of
the strain, would spoil the first Newton iteration, and with it the need for no more than one. So tension is an unknown
of its own there (mixed integration points: Magisano, Leonetti and Garcea, 2017): the first iteration of a step takes
that of the last step, each further one what the one before made of it,

    N = N(e) + dN/de  t . dr',

to first order in the change dr'. Forces are those of the strain throughout, so what iterations converge to is the same.
"""

from typing import Any

import numpy as np

from dlocore.compiling.kernel import part
from dlocore.kernels.basis import row_of

# columns of `History.tension`: what the tangent takes, NaN where that at hand; that of the strain at the last assembly,
# and its derivative by the strain [N]; that of the last step
ASSUMED, AT_HAND, MODULUS, LAST = range(4)
COLUMNS = 4


@part
def assumed(kept: Any, n: int, tension: float) -> float:
    """Return the tension [N] that the tangent takes at an axial point, where that of the strain is `tension`."""
    return kept[n, ASSUMED] if len(kept) > 0 and not np.isnan(kept[n, ASSUMED]) else tension


@part
def assume_last(kept: Any, known: bool) -> None:
    """Take the tension of the last step, or where it is not `known` that at hand."""
    for n in range(len(kept)):
        kept[n, ASSUMED] = kept[n, LAST] if known else np.nan


@part
def point_on(nc: int, q: Any, change: Any, points: Any, kept: Any) -> None:
    """Take the tension that a change (n, nc) [m] to q points to from where forces and tangent were last assembled."""
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
    """Make the tension that the tangent would take now that of the last step."""
    for n in range(len(kept)):
        kept[n, LAST] = kept[n, ASSUMED]
