"""Whether a scene determines its motion, or a change of the start by a millionth of the length leads elsewhere."""

import math
from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray

from dlocore.kernels.growth import LOOKS, SLOWEST, fastest_growth, looked_at
from dlocore.problem.grid import Grid
from dlocore.problem.plane import FLATNESS, off_line
from dlocore.problem.problem import Problem
from dlocore.shape.shape import StartCurve
from dlocore.solvers.march import March, march
from dlocore.solvers.monitor import Monitor
from dlocore.spline import DEGREE
from dlocore.words import in_mm, in_um

Floats = NDArray[np.float64]

DISTURBED = 1e-6  # of the length: bend of a start
TURNED = 1e-4  # rad: turn of its sections
UNDETERMINED = 1e-2  # of the length: a motion that such a bend changes by more is not determined
DOUBTFUL = 1e-3  # of the length: a motion changed by more is reported, and also checked with the opposite bend
UNSEEN = "A disturbance may grow in this motion; the time ran out before its effect could be determined."
_GROWTH = math.log(20.0)  # growth of a disturbance, estimated from some states, from which on its effect is measured
_HARDLY = 1e-4  # of the length: a start no farther from a straight line is hardly bent
_AT_ONCE = 64  # states whose history is looked up at once, which takes memory
_COMPARED = 1025  # states of two motions, at most


def bent(problem: Problem, grid: Grid, seed: int) -> Floats:
    """Return the bend of a start (n_u, nc) [m]: some half waves of about DISTURBED of the length.

    With twist its sections are also turned between its ends, by about TURNED: a cable that turns over on a table hardly
    feels a bend.
    """
    u = np.linspace(0.0, np.pi, grid.n_u)[:, None]
    dimensions = problem.plane.dimensions
    sizes = np.random.default_rng(seed).normal(size=(3, dimensions)) / 2
    waves = np.zeros((grid.n_u, problem.nc))
    waves[:, :dimensions] = DISTURBED * problem.scene.cable.length * np.sin(u * [1.0, 2.0, 3.0]) @ sizes
    if problem.twist is not None:
        waves[:, -1] = TURNED * problem.twist.radius * (np.sin(u) + 0.5 * np.sin(2.0 * u))[:, 0]
    return waves


def goes_astray(problem: Problem, motion: March, monitor: Monitor, hard: bool) -> float:
    """Return how far a motion changes if its start is bent by DISTURBED of the length [m].

    The motion is marched once more with the bent start, if a disturbance may grow in it, or if tangents can't show
    that. It is marched again with the opposite bend if the first result is in doubt (`farther`). If a disturbance grows
    most later on, the cable is also displaced by as much when that growth begins (`_onset`).

    Tangents can't show growth if the cable strikes something, if it touches or rubs and is `hard`, that is, it needed
    grids beyond the first few, and if it starts so nearly straight that it buckles between any two looks.

    The result is 0 in all other cases, and if the march finds no equilibrium. It is also 0 if the start has a bow in a
    plane and another out of it (`problem/buckling.py`), which is no larger than the bend and is reported in the answer.

    Raises:
        Cancelled: the caller asked to stop.
        TimeIsUp: the deadline passed.
    """
    bowed_twice = bool(problem.start.bow and problem.start.aside)
    untold = motion.split or (hard and problem.touches) or _hardly_bent(problem.start)
    if bowed_twice or motion.stopped:
        return 0.0
    grows = may_grow(problem, motion)
    if not (untold or grows):
        return 0.0
    grid, bend = motion.grid, bent(problem, motion.grid, seed=1)
    onset = _onset(problem, motion) if grows else 0.0

    def marched(way: float) -> March:
        knocks = {onset: way * bend} if onset > 0.0 else None
        start = grid.start + way * bend
        return march(
            problem, grid.changed(start=start), motion.asked, monitor, rho=motion.rho, whole=True, knocks=knocks
        )

    plain = marched(0.0) if onset > 0.0 else motion  # in the same steps, some of which begin at the onset
    if plain.stopped:
        return 0.0
    at = np.unique(np.linspace(0, len(plain.states) - 1, _COMPARED).round().astype(int))
    states = plain.states[at]
    del plain  # it can take a gigabyte, and so can the next

    def moved(way: float) -> float:
        other = marched(way)
        if other.stopped:
            return 0.0
        apart = (other.states[at] - states)[..., : problem.plane.dimensions]
        return float(np.linalg.norm(apart, axis=-1).max())

    return farther(moved, problem.scene.cable.length)


def farther(moved: Callable[[float], float], length: float) -> float:
    """Return how far a bend of a start, moved(1.0), or its opposite, moved(-1.0), changes a motion [m].

    The opposite is tried if the first leaves a doubt: a motion that changes by more than DOUBTFUL may have gone to the
    same of two sides, only sooner or later.
    """
    first = moved(1.0)
    return max(first, moved(-1.0)) if DOUBTFUL * length < first <= UNDETERMINED * length else first


def in_words(problem: Problem, moved: float) -> str:
    """Return a message that a scene does not determine its motion, which a bend changes by `moved` [m]."""
    return f"the scene does not determine its motion: {bend_in_words(problem, moved)}"


def bend_in_words(problem: Problem, moved: float) -> str:
    """Return a message that a tiny bend of the start changes the motion by `moved` [m]."""
    bend = in_um(DISTURBED * problem.scene.cable.length)
    turned = "" if problem.twist is None else f" and turning its sections by {TURNED * 1e3:.2g} mrad"
    return f"bending the start by a millionth of the length, {bend},{turned} changes the motion by up to {in_mm(moved)}"


def bend_of(start: StartCurve) -> float:
    """Return how far a start lies from the line between its ends, relative to its length; infinite if the ends meet."""
    ways = start.control_points - start.control_points[0]
    chord = ways[-1]
    return off_line(ways, chord) / float(start.knots[-1]) if chord @ chord > 0.0 else np.inf


def _hardly_bent(start: StartCurve) -> bool:
    """Tell whether a start is nearly but not quite straight, so that very little decides where it buckles to."""
    if start.bow or len(start.control_points) <= DEGREE + 1:
        return False
    return FLATNESS < bend_of(start) < _HARDLY


def may_grow(problem: Problem, motion: March) -> bool:
    """Tell whether a disturbance may grow by much in a motion, judged by the tangents of some states.

    See docs/model.md eq. 18a.
    """
    growth = motion.growth
    if growth is None:
        growth = sum(float(rates.mean() * (times[-1] - times[0])) for times, rates in _rates(problem, motion))
    return growth > _GROWTH


def _onset(problem: Problem, motion: March) -> float:
    """Return when the part of a motion begins in which a disturbance grows most [s]; 0 if it grows in none.

    By then a damped motion has forgotten any disturbance of its start.
    """
    onset = most = grown = begin = 0.0
    for times, rates in _rates(problem, motion):
        for k, rate in enumerate(rates):
            begin = begin if grown > 0.0 else times[k]
            grown = grown + rate * (times[k + 1] - times[k]) if rate > 0.0 else 0.0
            if grown > most:
                onset, most = begin, grown
    return float(onset)


def _rates(problem: Problem, motion: March) -> Iterator[tuple[Floats, Floats]]:
    """Yield times (k + 1,) [s] in each stretch of a motion, and the largest growth rates of a disturbance between them.

    The rates (k,) [1/s] are those of the states at the end of each interval.
    """
    for window in motion.forces:
        lasts = float(window.times[-1] - window.times[0])
        at = looked_at(len(window.times) - 1, max(2, round(LOOKS * lasts / problem.horizon)))
        step = lasts / (len(window.times) - 1)
        frequency = 1.0 / step if problem.friction is not None else 0.0  # without friction, speeds play no part
        rates = [
            fastest_growth(
                problem.axes, window.states[some], frequency * (window.states[some] - window.states[some - 1]),
                motion.behind(window.times[some]), motion.grid.tables, *problem.laws, problem.mass_density(),
                problem.drag_coefficient(), window.held.elimination, SLOWEST / problem.horizon,
            )
            for some in np.array_split(at[1:], -(-len(at) // _AT_ONCE))
        ]  # fmt: skip
        yield window.times[at], np.concatenate(rates)
