"""The bivariate spline through a simulated motion: least squares in u, then in t, with knots where it needs them."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from dlocore.problem.problem import Problem
from dlocore.reference.motion import events_of
from dlocore.reference.rod import nearest
from dlocore.spline import DEGREE, SplineSurface, design_matrix

Floats = NDArray[np.float64]

FIRST_SPANS = 12  # in time
MOST_SPANS = 400
LEAST_TIMES, MOST_TIMES = 257, 2000  # at which a motion is fitted
WITHIN_STEPS = 3  # of them, at most, within each step
FIRM = 1e4  # weight of what the spline has to keep: what grasps hold, and the first and last instant
MARGINS = 2  # samples that each span needs


@dataclass(frozen=True, eq=False)
class Fit:
    """A surface and its largest misfit to the samples [m]."""

    surface: SplineSurface
    missed: float


def fit(problem: Problem, u: Floats, times: Floats, q: Floats, tolerance: float) -> Fit:
    """Fit samples q (k, n, 4) [m, m, m, rad] at times (k,) [s] and u (n,) [m] within about `tolerance` [m]."""
    knots_u = _along(problem, u, q, tolerance)
    over = design_matrix(knots_u, u)
    firm = np.ones((len(u), 1))
    firm[_held(problem, u)] = FIRM
    in_u = _least(firm * over, firm * q.transpose(1, 0, 2).reshape(len(u), -1))
    rows = in_u.reshape(-1, len(q), 4).transpose(1, 0, 2)
    knots_t, control = _in_time(problem, times, rows, tolerance)
    surface = SplineSurface(np.ascontiguousarray(control), knots_u, knots_t)
    reached = np.einsum("tj,jic,ui->tuc", design_matrix(knots_t, times), control, over, optimize=True)
    return Fit(surface, float(np.linalg.norm((reached - q)[..., :3], axis=-1).max()))


def _least(over: Floats, right: Floats) -> Floats:
    """Return the least squares solution of over x = right with the least norm."""
    return np.asarray(np.linalg.lstsq(over, right, rcond=None)[0], dtype=np.float64)


def _held(problem: Problem, u: Floats) -> list[int]:
    """Return the nodes of u (n,) [m] that grasps hold."""
    return [nearest(u, g.u) for g in problem.scene.grasps]


def _along(problem: Problem, u: Floats, q: Floats, tolerance: float) -> Floats:
    """Return knots in u: every 2^k-th node and the held, loaded or heavy ones, twice where a direction is held."""
    length = u[-1]
    marks: dict[int, int] = {}
    for g, node in zip(problem.scene.grasps, _held(problem, u), strict=True):
        marks[node] = max(marks.get(node, 1), 1 if g.hold == "point" else 2)
    for place in problem.scene.places:
        marks.setdefault(nearest(u, place), 1)
    some = q[:: max(1, len(q) // 50)].transpose(1, 0, 2).reshape(len(u), -1)
    stride = 2 ** max(1, int(np.log2(max(2.0, len(u) / 8))))
    while True:
        inner = set(range(stride, len(u) - 1, stride)) | {m for m in marks if 0 < m < len(u) - 1}
        knots = np.concatenate(
            [
                np.zeros(DEGREE + 1),
                *[np.full(marks.get(k, 1), u[k]) for k in sorted(inner)],
                np.full(DEGREE + 1, length),
            ]
        )
        over = design_matrix(knots, u)
        missed = np.abs(over @ _least(over, some) - some).max()
        if missed <= tolerance or stride <= 2:
            return knots
        stride //= 2


def _in_time(problem: Problem, times: Floats, rows: Floats, tolerance: float) -> tuple[Floats, Floats]:
    """Return knots in time and control points (n_t, n_u, 4): spans are halved where the spline misses the rows."""
    events = events_of(problem)
    horizon = events[-1]
    breaks = np.unique(np.concatenate([np.linspace(0.0, horizon, FIRST_SPANS + 1), events]))
    keep = np.concatenate([[True], np.diff(breaks) > 1e-6 * horizon])
    breaks = breaks[keep]
    breaks[-1] = horizon
    weight = np.ones(len(times))
    weight[0] = weight[-1] = FIRM
    flat = rows.reshape(len(times), -1)
    while True:
        inner = breaks[1:-1]
        sharp = np.isin(inner, events)
        knots = np.concatenate(
            [np.zeros(DEGREE + 1), np.repeat(inner, np.where(sharp, DEGREE, 1)), np.full(DEGREE + 1, horizon)]
        )
        over = design_matrix(knots, times)
        control = _least(weight[:, None] * over, weight[:, None] * flat)
        missed = np.abs((over @ control - flat).reshape(rows.shape)[..., :3]).max(axis=(1, 2))
        span = np.clip(np.searchsorted(breaks, times, side="right") - 1, 0, len(breaks) - 2)
        new = [
            0.5 * (breaks[k] + breaks[k + 1])
            for k in np.unique(span[missed > tolerance])
            if (span == k).sum() > 2 * MARGINS
        ]
        if not new or len(breaks) + len(new) > MOST_SPANS:
            return knots, control.reshape(-1, *rows.shape[1:])
        breaks = np.sort(np.concatenate([breaks, new]))
