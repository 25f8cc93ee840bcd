"""A step of the space-time least squares from its factors, combined with the last steps (Anderson acceleration)."""

from typing import Any, NamedTuple

import numpy as np

from dlocore.compiling.kernel import kernel
from dlocore.kernels.banded import expand_vector
from dlocore.kernels.blocks import dot, solve_blocks

_PARALLEL = 1e-8  # a difference of steps is dropped where less than this share of it is independent of the others


class Steps(NamedTuple):
    """The last iterates and their steps, newest first (depth + 1, n), and workspace for differences (depth, n)."""

    iterates: Any
    steps: Any
    ways: Any
    changes: Any


@kernel
def room(depth: int, n: int) -> Any:
    """Allocate `Steps` for iterates of n numbers, with up to `depth` differences to combine."""
    return Steps(np.empty((depth + 1, n)), np.empty((depth + 1, n)), np.empty((depth, n)), np.empty((depth, n)))


@kernel
def advance(e: Any, factors: Any, right: Any, control: Any, last: Any, known: int, limit: float, delta: float) -> Any:
    """Take the step -A^-1 right from the iterate `control` (n_t, n, nc), and store both in `last`.

    A step with a component above `limit` is shortened. The step is combined with those before it (Walker and Ni, 2011).
    A step whose norm is below `delta` is the last one, and is taken as it is.

    Args:
        factors: of A, see `blocks.py`.
        last: `Steps`, of which the newest `known` are set.

    Returns:
        the norm of the step over all control points, the factor by which it was shortened, and the next iterate.
    """
    n_t, n, nc = control.shape
    size, free = n * nc, factors.shape[1]
    x = -right
    solve_blocks(factors, x)
    depth = min(known, len(last.ways))
    for j in range(depth, 0, -1):
        last.iterates[j] = last.iterates[j - 1]
        last.steps[j] = last.steps[j - 1]
    last.iterates[0] = control.ravel()
    step = last.steps[0]
    step[: 2 * size] = 0.0
    for j in range(n_t - 2):
        expand_vector(e, x[j * free : (j + 1) * free], step[(j + 2) * size : (j + 3) * size])
    update = np.sqrt(dot(step, step))
    longest = np.max(np.abs(step))
    if update < delta or not np.isfinite(update):
        return update, 1.0, control + step.reshape(control.shape)
    share = 1.0
    if longest > limit:
        share = limit / longest
        step *= share
    following = _combined(last, depth)
    return update, share, following.reshape(control.shape)


@kernel
def _combined(last: Any, depth: int) -> Any:
    """Return the newest iterate plus its step, corrected by the last `depth` differences.

    The combination of step differences that is closest to the newest step is subtracted from it, together with the
    change of the iterate that belongs to it.
    """
    f = last.steps[0]
    following = last.iterates[0] + f
    kept = 0
    for j in range(depth):
        change, way = last.changes[kept], last.ways[kept]
        for i in range(len(f)):
            change[i] = last.steps[j, i] - last.steps[j + 1, i]
            way[i] = last.iterates[j, i] - last.iterates[j + 1, i]
        whole = dot(change, change)
        for k in range(kept):
            along = dot(last.changes[k], change)
            for i in range(len(f)):
                change[i] -= along * last.changes[k, i]
                way[i] -= along * last.ways[k, i]
        square = dot(change, change)
        if square > _PARALLEL * _PARALLEL * whole:
            inverse = 1.0 / np.sqrt(square)
            for i in range(len(f)):
                change[i] *= inverse
                way[i] *= inverse
            along = dot(change, f)
            for i in range(len(f)):
                following[i] -= along * (way[i] + change[i])
            kept += 1
    return following
