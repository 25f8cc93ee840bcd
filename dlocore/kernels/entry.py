"""How a stretch of smooth motion begins, compiled."""

from typing import Any

from dlocore.kernels.compile import brief
from dlocore.kernels.march import begin_stretch


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
