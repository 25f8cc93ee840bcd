"""Newton's steps with an incomplete tangent, corrected by the last ones (Anderson mixing).

The tangent of bending damping in space leaves out how the spin of the sections depends on the whole cable. That does
not fit into the band, but affects few motions. From iterates x and their plain steps f = -A^-1 R(x), the differences of
f show how far the tangent A was right along the differences of x, and the next step is corrected accordingly: the few
motions that A misjudges converge as fast as the others.
"""

from typing import Any, NamedTuple

import numpy as np

from dlocore.compiling.kernel import kernel

DEPTH = 40  # differences that are kept
_PARALLEL = 1e-10  # a difference is dropped if the share of it that is independent of the others is less: rounding


class Mixing(NamedTuple):
    """Workspace: differences of plain steps, made orthonormal, and of iterates (DEPTH, n); the last of both (2, n)."""

    steps: Any
    iterates: Any
    last: Any


@kernel
def room(n: int) -> Any:
    """Allocate `Mixing` for iterates of n numbers."""
    return Mixing(np.empty((DEPTH, n)), np.empty((DEPTH, n)), np.empty((2, n)))


@kernel
def mixed(mixing: Any, known: int, f: Any) -> int:
    """Correct the plain step f (n,) in place; return how many differences are known afterwards.

    `known` is their number before, negative at the first step with a tangent.
    """
    steps, iterates, last = mixing
    n = len(f)
    if known < 0:
        known = 0
    elif known < DEPTH:
        new, way = steps[known], iterates[known]
        whole = 0.0
        for i in range(n):
            new[i] = f[i] - last[0, i]
            way[i] = last[1, i]
            whole += new[i] * new[i]
        for j in range(known):
            along = 0.0
            for i in range(n):
                along += steps[j, i] * new[i]
            for i in range(n):
                new[i] -= along * steps[j, i]
                way[i] -= along * iterates[j, i]
        square = 0.0
        for i in range(n):
            square += new[i] * new[i]
        if square > _PARALLEL * _PARALLEL * whole:
            size = np.sqrt(square)
            for i in range(n):
                new[i] /= size
                way[i] /= size
            known += 1
    last[0] = f
    for j in range(known):
        along = 0.0
        for i in range(n):
            along += steps[j, i] * last[0, i]
        for i in range(n):
            f[i] -= along * (iterates[j, i] + steps[j, i])
    last[1] = f
    return known
