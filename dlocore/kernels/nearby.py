"""Pairs of the cable's strands that are near each other, kept as long as the cable moves little.

For a long thin cable, placing all strand nodes and searching for pairs takes longer than the rest of an assembly.
Therefore the search includes pairs up to `_ROOM` diameters farther apart than where strands meet. Until two points of
the cable have moved by that distance against each other, all pairs that meet are among those found.
"""

from typing import Any, NamedTuple

import numpy as np

from dlocore.compiling.kernel import kernel, law, leaf
from dlocore.effects.laws import SELF_CONTACT
from dlocore.kernels.strands import clear_way, clear_way_of, near_pairs

_ROOM = 2.0  # diameters
_FIRST = 64  # pairs that fit into the first array


class Nearby(NamedTuple):
    """The known pairs of segments between neighbouring strand nodes.

    Arrays of pairs may be replaced by larger ones. They are in lists, as variables would cost reference counts in every
    step.

    Attributes:
        pairs, count: a list with one array (room, 2) of the pairs near each other, and their number (1,), -1 before the
            first search.
        seen: control points (n, nc) [m] at the last search.
        met: a list with one array (room, 2) of the pairs in contact.
    """

    pairs: Any
    count: Any
    seen: Any
    met: Any


@kernel
def nothing_known(n: int, nc: int) -> Any:
    """Return an empty `Nearby` for n control points."""
    count, seen = np.full(1, -1, np.int64), np.zeros((n, nc))
    return Nearby([np.empty((_FIRST, 2), np.int64)], count, seen, [np.empty((_FIRST, 2), np.int64)])


@law
def _place(q: Any, nodes: Any, n: int, x: Any) -> None:
    k = nodes.first[n]
    for d in range(x.shape[1]):
        value = 0.0
        for i in range(4):
            value += nodes.b0[n, i] * q[k + i, d]
        x[n, d] = value


@leaf
def place_nodes(q: Any, nodes: Any, x: Any) -> None:
    """Write the positions x (nodes, 2 or 3) [m] of the strand nodes of the control points q (n, nc)."""
    for n in range(len(x)):
        _place(q, nodes, n, x)


@leaf
def place_pairs(q: Any, nodes: Any, pairs: Any, count: int, x: Any) -> None:
    """Do the same as `place_nodes` for the ends of `count` pairs of segments only; other nodes may stay as they are."""
    if 2 * count > len(x):
        place_nodes(q, nodes, x)
        return
    for c in range(count):
        for side in range(2):
            i = pairs[c, side]
            if c == 0 or pairs[c - 1, side] != i:
                _place(q, nodes, i, x)
                _place(q, nodes, i + 1, x)


@leaf
def _is_known(q: Any, seen: Any, count: int, nd: int, D: float) -> bool:
    """Tell whether all pairs that meet at q (n, nc) are among those found at the control points `seen`."""
    if count < 0:
        return False
    square = 0.0
    for d in range(nd):
        low, high = np.inf, -np.inf
        for i in range(len(q)):
            move = q[i, d] - seen[i, d]
            low, high = min(low, move), max(high, move)
        square += (high - low) ** 2
    return square <= (_ROOM * D) ** 2


@kernel
def look(q: Any, nodes: Any, p: Any, x: Any, near: Any) -> None:
    """Update `near` to include all pairs that may meet at the control points q (n, nc), and place their nodes x."""
    D = p[SELF_CONTACT, 0]
    if _is_known(q, near.seen, near.count[0], x.shape[1], D):
        place_pairs(q, nodes, near.pairs[0], near.count[0], x)
        return
    place_nodes(q, nodes, x)
    near.pairs[0], near.count[0] = near_pairs(x, nodes.u, (1.0 + _ROOM) * D, p[SELF_CONTACT, 4], near.pairs[0])
    near.seen[:] = q


@kernel
def clear(q0: Any, q1: Any, nodes: Any, p: Any, x0: Any, x1: Any, near: Any) -> float:
    """Return how far, 0 to 1, the cable may move straight from q0 to q1 (n, nc) before strands pass through strands.

    x0, x1 (nodes, 2 or 3) are written, at least for pairs that are near each other.
    """
    D = p[SELF_CONTACT, 0]
    pairs, seen, count, nd = near.pairs[0], near.seen, near.count[0], x0.shape[1]
    if _is_known(q0, seen, count, nd, D) and _is_known(q1, seen, count, nd, D):
        place_pairs(q0, nodes, pairs, count, x0)
        place_pairs(q1, nodes, pairs, count, x1)
        return clear_way_of(x0, x1, D, pairs, count)
    place_nodes(q0, nodes, x0)
    place_nodes(q1, nodes, x1)
    found = np.empty((_FIRST, 2), np.int64)
    return clear_way(x0, x1, nodes.u, D, p[SELF_CONTACT, 4], found)[1]
