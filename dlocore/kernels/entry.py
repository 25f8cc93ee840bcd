"""How a motion and its smooth stretches begin and end: brief steps around the march, which keep the GIL.

To hand it over for microseconds would let another thread's solve take it for as long as its Python lasts.
"""

from typing import Any

from dlocore.kernels.assembly import remember
from dlocore.kernels.compile import brief
from dlocore.kernels.march import begin_stretch


@brief
def remember_start(axes: Any, q: Any, tables: Any, active: Any, p: Any, history: Any) -> None:
    """Note in `history` the strain of the start q (n, nc), with the anchors of friction under the cable."""
    remember(axes, q, tables, active, p, history, 0.0, True)


@brief
def begin(
    axes: Any, q: Any, v: Any, unit: Any, density: float, dragged: float, tables: Any, active: Any, p: Any,
    history: Any, load: Any, e: Any, near: Any, h: float, inertial: bool, dimensions: int,
) -> Any:  # fmt: skip
    """Return what `begin_stretch` does, and by how much a component of the centreline's velocity jumps [m/s]."""
    closed, a, G = begin_stretch(
        axes, q, v, unit, density, dragged, tables, active, p, history, load, e, near, h, inertial
    )
    away = 0.0
    for i in range(len(v)):
        for d in range(dimensions):
            away = max(away, abs(closed[i, d] - v[i, d]))
    return closed, a, G, away


@brief
def to_ends_of_steps(reactions: Any, first: int, last: int, lag: float) -> None:
    """Bring the reactions (steps + 1, held) of the steps after `first` to `last` to their times, in place.

    A generalised-alpha step balances its forces `lag` steps before its end (alpha_f).
    """
    for i in range(reactions.shape[1] if last - first > 1 else 0):
        rate = 0.0
        for k in range(first + 1, last):
            rate = reactions[k + 1, i] - reactions[k, i]
            reactions[k, i] += lag * rate
        reactions[last, i] += lag * rate
