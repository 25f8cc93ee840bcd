"""How fast a disturbance of a motion may grow."""

from typing import Any

import numpy as np

from dlocore.compiling.kernel import brief, kernel
from dlocore.kernels.assembly import NO_RATES, add_scalar_band, assemble, history_at
from dlocore.kernels.banded import factor, reduce_matrix

LOOKS = 6  # least number of states at which a motion is checked
AT_ONCE = 64  # most steps between two checked states: a shorter instability may be missed
SLOWEST = 1.0  # least rate of growth that counts, times the duration of the motion
_DOUBLINGS = 12  # largest number of doublings of a rate


@brief
def looked_at(last: int, looks: int) -> Any:
    """Return the numbers (k + 1,) of states, from 0 to `last`, between which a motion is checked.

    They are evenly spaced, with at least `looks` intervals: a motion of minutes may be unstable for seconds.
    """
    looks = max(looks, -(-last // AT_ONCE))
    return np.round(np.linspace(0.0, last, looks + 1)).astype(np.int64)


@kernel
def fastest_growth(
    axes: Any, states: Any, velocities: Any, histories: Any, tables: Any, active: Any, p: Any, density: float,
    dragged: float, e: Any, slowest: float,
) -> Any:  # fmt: skip
    """Return rates (k,) [1/s] that no disturbance of the states (k, n, nc) exceeds, each at most twice too large.

    A disturbance that grows like exp(s t) obeys (s^2 M + s (C + D) + K) x = 0, with symmetric matrices. Where the sum
    is positive definite, every disturbance grows more slowly than s. This is tested at `slowest`, below which the rate
    is 0, and then for s doubled again and again.

    Args:
        axes: (0, 1), (0, 1, 2) or (0, 1, 2, 3).
        states: (k, n, nc) [m].
        velocities: (k, n, nc) [m/s] in these states. Friction mu N on a part that slides at a speed v resists sideways
            motion with the coefficient mu N/v; on a part at rest, with one large enough to hold it.
        histories: what earlier steps left behind at the states, a `History` with arrays (1 or k, ...).
        density: linear density [kg/m].
        dragged: drag coefficient [N s/m^2].
        e: elimination of the held degrees of freedom.
        slowest: rate [1/s].
    """
    nc, n = len(axes), states.shape[1]
    rates = np.zeros(len(states))
    f, K = np.empty((n, nc)), np.empty((n * nc, 4 * nc))
    A = np.empty((n * nc - len(e.held), e.width))
    for k in range(len(states)):
        history, s = history_at(histories, k), slowest
        for _ in range(_DOUBLINGS):
            assemble(axes, states[k], velocities[k], tables, active, p, history, NO_RATES, (1.0, s, 1.0), f, K)
            add_scalar_band(nc, tables.inertia, density * s * s, K)
            add_scalar_band(nc, tables.unit, dragged * s, K)
            reduce_matrix(e, K, A)
            if factor(A) < 0:
                break
            s *= 2.0
            rates[k] = s
    return rates
