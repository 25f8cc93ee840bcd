"""The time of a solve as a function of its grid, fitted to measured solves."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]


@dataclass(frozen=True, kw_only=True)
class Rates:
    """The times that add up to the time of a solve, for one number of coordinates.

    A march takes `setup` + steps (`step` + `step_point` n_u). Each iteration of the least squares adds `iteration` +
    n_t n_u (`block` + `block_1` n_u + `block_2` n_u^2): factorising a band grows with n_u^3, other work with less.

    Attributes:
        setup: knots, tables and the start [s].
        step: of one time step [s].
        step_point: of one control point in one time step [s].
        iteration: of one iteration of the least squares [s].
        block, block_1, block_2: of one control point of the space-time spline in one iteration [s].
        iterations: of the least squares on a measured scene, the median.
    """

    setup: float
    step: float
    step_point: float
    iteration: float = 0.0
    block: float = 0.0
    block_1: float = 0.0
    block_2: float = 0.0
    iterations: float = 0.0

    def march(self, n_u: float, steps: float) -> float:
        """Return the time of a march and its fit [s]."""
        return self.setup + steps * (self.step + self.step_point * n_u)

    def least_squares(self, n_u: float, n_t: float) -> float:
        """Return the time of the iterations of the least squares [s]."""
        point = self.block + self.block_1 * n_u + self.block_2 * n_u * n_u
        return self.iterations * (self.iteration + n_t * n_u * point)


@dataclass(frozen=True, kw_only=True)
class Cost:
    """A model of the time of a solve on one machine.

    Attributes:
        rates: by number of coordinates: 2 in the plane, 3 in space, 4 in space with twist.
        effects: by effect, the factor by which it lengthens a march.
        estimates: by method, the factor by which an error estimate lengthens a solve.
        deviation: by method, the typical factor between the model and a measured time, at least 1.
    """

    rates: Mapping[int, Rates]
    effects: Mapping[str, float] = field(default_factory=dict)
    estimates: Mapping[str, float] = field(default_factory=dict)
    deviation: Mapping[str, float] = field(default_factory=dict)

    def time(
        self,
        method: str,
        n_u: int,
        n_t: int,
        steps: int,
        *,
        coordinates: int = 2,
        effects: Sequence[str] = (),
        estimate: bool = True,
    ) -> float:
        """Return the approximate time of a solve on one grid [s].

        Args:
            method: "march" or "spacetime".
            n_u: control points along the cable.
            n_t: control points in time.
            steps: time steps of the march.
            coordinates: of a control point, 2 to 4.
            effects: the active ones.
            estimate: whether the error is estimated too.
        """
        rates = self.rates[coordinates]
        total = rates.march(n_u, steps)
        for effect in effects:
            total *= self.effects.get(effect, 1.0)
        if method == "spacetime":
            total += rates.least_squares(n_u, n_t)
        return total * (self.estimates.get(method, 1.0) if estimate else 1.0)


@dataclass(frozen=True, kw_only=True)
class Sample:
    """One measured solve: grid, number of coordinates, iterations of the least squares (0: a march), time [s]."""

    coordinates: int
    n_u: int
    n_t: int
    steps: int
    iterations: int
    wall_time: float


def fitted_rates(samples: Sequence[Sample]) -> dict[int, Rates]:
    """Return the rates that best fit measured solves, by number of coordinates.

    No part of a time is negative. Relative errors of all times count the same, so short solves are fitted as well as
    long ones.
    """
    found: dict[int, Rates] = {}
    for coordinates in sorted({s.coordinates for s in samples}):
        marches = [s for s in samples if s.coordinates == coordinates and s.iterations == 0]
        parts = _nonnegative([[1.0, s.steps, s.steps * s.n_u] for s in marches], [s.wall_time for s in marches])
        rates = Rates(setup=parts[0], step=parts[1], step_point=parts[2])
        solves = [s for s in samples if s.coordinates == coordinates and s.iterations > 0]
        if solves:
            points = [s.n_t * s.n_u for s in solves]
            rows = [
                [s.iterations * x for x in (1.0, p, p * s.n_u, p * s.n_u**2)]
                for s, p in zip(solves, points, strict=True)
            ]
            beyond = [max(s.wall_time - rates.march(s.n_u, s.steps), 0.05 * s.wall_time) for s in solves]
            more = _nonnegative(rows, beyond)
            rates = replace(
                rates,
                iteration=more[0],
                block=more[1],
                block_1=more[2],
                block_2=more[3],
                iterations=float(np.median([s.iterations for s in solves])),
            )
        found[coordinates] = rates
    return found


def _nonnegative(rows: ArrayLike, times: ArrayLike) -> list[float]:
    """Return the non-negative factors (k,) of rows (m, k) that fit times (m,) with the least relative errors."""
    from scipy.optimize import nnls  # slow to import, and not needed for a prediction

    matrix = np.asarray(rows, float) / np.asarray(times, float)[:, None]
    scale = np.abs(matrix).max(axis=0)
    factors, _ = nnls(matrix / scale, np.ones(len(matrix)))
    return [float(x) for x in factors / scale]


def exponent(sizes: ArrayLike, times: ArrayLike) -> tuple[float, float]:
    """Return (p, c) of the power law c size^p [s] that best fits measured times, in logarithms."""
    p, log_c = np.polyfit(np.log(np.asarray(sizes, float)), np.log(np.asarray(times, float)), 1)
    return float(p), float(np.exp(log_c))


def pareto_front(times: ArrayLike, errors: ArrayLike) -> list[int]:
    """Return the indices of the points that no other point beats in both time and accuracy, fastest first.

    Points without a finite error are left out.
    """
    time, error = np.asarray(times, float), np.asarray(errors, float)
    front: list[int] = []
    least = np.inf
    for i in np.lexsort((error, time)):
        if error[i] < least:
            front.append(int(i))
            least = float(error[i])
    return front
