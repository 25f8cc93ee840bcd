"""The time spline of a march: fitted to its states, with more knots where the cable strikes something."""

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from dlocore.kernels.timefit import fit_missed, fitted
from dlocore.solvers.march import March
from dlocore.solvers.monitor import Monitor, TimeIsUp

Floats = NDArray[np.float64]

_REFINEMENTS = 8  # of the time knots: each halves spans
_MOST_OF_THE_TIME = 0.95
MISSED_COUNTS = 3.0  # times the misfit of the time spline to its march: the least value of the error estimate
_EVENINGS = 12  # of the time knots
_MOST_NUMBERS = 10**7  # of all states: with more, no states are added in between
_STATES = 2  # of the march in a span of the time spline, at least
_QUIET = 1e-3  # of the largest misfit: what a span is assumed to miss at least, so that none grows without bounds


def refined(
    motion: March, knots_t: Floats, tolerance: float, strikes: bool, monitor: Monitor, whole: bool = False
) -> tuple[Floats, March]:
    """Return time knots, more where the time spline misses the motion by more than `tolerance` [m], and what to fit.

    If the cable `strikes` something its velocity jumps, and a spline without knots there continues into the obstacle,
    or swings past its states. States half-way through the steps are then added to the motion there, and knots beside
    them. With many states this takes seconds, so it ends at the deadline.

    Raises:
        Cancelled: the caller asked to stop.
        TimeIsUp: the deadline passed, and a spline with fewer knots is of no use (`whole`).
    """
    for _ in range(_REFINEMENTS):
        try:
            monitor.check()
        except TimeIsUp:
            if whole:
                raise
            break
        control, off = fit(motion, knots_t)
        between = _halved(motion, knots_t, control, tolerance) if strikes else motion
        breaks = np.unique(knots_t)
        span = np.clip(np.searchsorted(breaks, motion.times, side="right") - 1, 0, len(breaks) - 2)
        new = []
        for k in np.unique(span[off > tolerance]):
            inside = motion.times[(motion.times > breaks[k] + 1e-12) & (motion.times < breaks[k + 1] - 1e-12)]
            if len(inside) > 1:
                new.append(inside[len(inside) // 2])
        if not new and between is motion:
            break
        knots_t = np.sort(np.concatenate([knots_t, new]))
        motion = between
    return knots_t, motion


def missed(motion: March, knots_t: Floats, control: Floats) -> Floats:
    """Return the distance of each state (steps + 1,) from the time spline of `control` (n_t, n_u, nc) [m]."""
    return _missed(knots_t, motion.times, motion.states, control)


def largest(times: Floats, off: Floats, swing: float) -> float:
    """Return the misfit of a spline to its march [m]; at moments such as a sudden start, a third of it counts.

    Such moments are a share of each `swing` [s], however long the motion is; a third times MISSED_COUNTS is the full
    misfit.

    Args:
        times: of the states (k,) [s], increasing.
        off: the misfit at each (k,) [m].
        swing: the approximate period of a swing of the cable [s].
    """
    at_all = float(off.max()) / MISSED_COUNTS
    last = math.ceil((times[-1] - times[0]) / swing) - 1
    if last <= 0:  # one swing, like most motions: there is no need to tell several apart
        return max(float(np.sort(off)[int(_MOST_OF_THE_TIME * (len(off) - 1))]), at_all)
    window = np.minimum((times - times[0]) / swing, last).astype(int)
    begins = np.flatnonzero(np.diff(window, prepend=-1))
    counts = np.diff(begins, append=len(off))
    ordered = off[np.lexsort((off, window))]
    return max(float(ordered[begins + (_MOST_OF_THE_TIME * (counts - 1)).astype(int)].max()), at_all)


def evened(motion: March, knots_t: Floats, events: Floats, swing: float) -> Floats:
    """Return as many time knots, closer where the motion is fast, so that the time spline misses it evenly.

    The misfit of a span is proportional to the fourth power of its length. Each round redistributes the spans so that
    they would all miss equally, and the best knots of all rounds are kept. Knots at the times of events (k,) [s] stay.
    A span without states would not be determined: if spans would become that short, the motion is too fast for its
    steps. For `swing` see `largest`.
    """
    best = found = knots_t
    least = np.inf
    for _ in range(_EVENINGS):
        if np.histogram(motion.times, np.unique(found))[0].min() < _STATES:
            break
        off = fit(motion, found)[1]
        most_times = largest(motion.times, off, swing)
        if most_times < least:
            best, least = found, most_times
        breaks = np.unique(found)
        span = np.clip(np.searchsorted(breaks, motion.times, side="right") - 1, 0, len(breaks) - 2)
        most = np.zeros(len(breaks) - 1)
        np.maximum.at(most, span, off)
        if not 0.0 < most.max() < np.inf:
            break
        need = np.concatenate([[0.0], np.cumsum(np.maximum(most, _QUIET * most.max()) ** 0.25)])
        found = _shared_out(found, breaks, need, events)
    return best


def _shared_out(knots_t: Floats, breaks: Floats, need: Floats, events: Floats) -> Floats:
    """Return time knots whose spans, between events, have equal shares of the need, given up to each of the breaks."""
    inside = np.unique(events[(events > breaks[0]) & (events < breaks[-1])])
    marks = np.concatenate([breaks[:1], inside, breaks[-1:]])
    at = np.interp(marks, breaks, need)
    spans = np.ones(len(marks) - 1, dtype=np.int64)
    for _ in range(len(breaks) - len(marks)):
        spans[np.argmax(np.diff(at) / spans)] += 1
    new = [np.interp(np.linspace(at[k], at[k + 1], spans[k] + 1)[1:-1], need, breaks) for k in range(len(spans))]
    kept = knots_t[np.isin(knots_t, marks)]
    return np.sort(np.concatenate([kept, *new]))


def _missed(knots_t: Floats, times: Floats, states: Floats, control: Floats) -> Floats:
    return np.asarray(fit_missed(knots_t, times, states, control, min(3, control.shape[2])))


def _halved(motion: March, knots_t: Floats, control: Floats, tolerance: float) -> March:
    """Return the motion with states half-way through those steps where the spline leaves the chord of the states.

    A motion in so many steps that its states fill the memory stays as it is: its steps are short enough.
    """
    times, states = motion.times, motion.states
    if states.size > _MOST_NUMBERS:
        return motion
    middle = 0.5 * (times[1:] + times[:-1])
    chord = 0.5 * (states[1:] + states[:-1])
    away = _missed(knots_t, middle, chord, control)
    split = np.flatnonzero((away > tolerance) & (np.diff(times) > 0.2 * np.median(np.diff(times))))
    if len(split) == 0:
        return motion
    return replace(
        motion,
        times=np.insert(times, split + 1, middle[split]),
        states=np.insert(states, split + 1, chord[split], axis=0),
    )


def fit(motion: March, knots_t: Floats) -> tuple[Floats, Floats]:
    """Return control points (n_t, n_u, nc) [m] of the time spline fitted to a march, and its misfits, see `missed`."""
    control, off = fitted(knots_t, motion.times, motion.states, motion.velocity, min(3, motion.states.shape[2]))
    return control, off
