"""The predictor against the step-by-step reference with the same error: `benchmarks.reference --equal-error`.

A converged march tells the true errors. With error control, the march to a target is compared with the reference to the
largest of some targets with which it errs no more. Without, the last grid of that march alone is compared with a single
rod: of all numbers of elements and tolerances of a step, the fastest whose error is no larger.
"""

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from dlocore import Prediction, Quality, Scene, predict
from dlocore.levels.whole_march import sided
from dlocore.problem.problem import Problem, pose
from dlocore.reference.motion import simulate
from dlocore.reference.refine import ELEMENTS, FIRMER, stiffened
from dlocore.reference.rod import build, nodes_of
from dlocore.reference.sampling import samples
from dlocore.solvers.monitor import Monitor
from dlocore.study.judge import SAMPLES, Truth, finest_march, largest_error
from dlocore.study.timing import clock, timed

RODS = (10, 14, 20, 28, 40, 56, 80, 112, 160, 224, 320)  # elements
STEPS = (1.0, 0.3, 0.1, 0.03, 0.01, 3e-3, 1e-3, 3e-4, 1e-4)  # of the error that is to be met: that of one step
TARGETS = (10.0, 5.0, 2.0, 1.0, 0.5, 0.2)  # times the error that is to be met: those of the reference
FLAT = 0.03  # relative change of the error by shorter steps that is none
REPEATS = 5  # of a march: the median of their times counts


class Trial(NamedTuple):
    """A simulation: its time [s], its largest error [m], the elements of its rod and its steps."""

    seconds: float
    error: float
    elements: int
    steps: int


@dataclass(frozen=True, kw_only=True)
class Equal:
    """What the same error takes.

    Attributes:
        error, unsure: largest error of the march, and by how much the last refinement moved its truth [m].
        march: time of the march with all that a target error takes [s].
        alone: that of its last grid, without an estimate [s].
        reference: time and error of the reference that errs as little; None where none does in time.
        rod: the fastest that errs as little; None where none was found in time.
    """

    error: float
    unsure: float
    march: float
    alone: float
    reference: tuple[float, float] | None
    rod: Trial | None


def compare(scene: Scene, target: float, patience: float) -> Equal:
    """Compare the march to a target error [m] with rods, which are searched for `patience` [s]."""
    truth = finest_march(scene, patience=patience)
    march, spent = _timed(replace(scene, quality=Quality(target_error=target)))
    grid = Quality(n_u=march.accuracy.n_u, n_t=march.accuracy.n_t, method="march", estimate=False, keep_grid=True)
    alone, least = _timed(replace(scene, quality=grid))
    error = max(largest_error(march, truth), largest_error(alone, truth))
    problem = sided(pose(scene, {e.name: e.reason for e in march.effects if e.active}), Monitor())
    fastest = min(_trials(problem, truth, error, patience), default=None)
    reference = _refined(scene, truth, error, patience)
    return Equal(error=error, unsure=truth.moved, march=spent, alone=least, reference=reference, rod=fastest)


def _timed(scene: Scene) -> tuple[Prediction, float]:
    """Return a prediction and the median of the processor times that it takes, after a call that is not timed [s]."""
    prediction, times = timed(lambda: predict(scene), REPEATS)
    return prediction, times.median


def _refined(scene: Scene, truth: Truth, error: float, patience: float) -> tuple[float, float] | None:
    """Return time [s] and error [m] of the reference to the largest of TARGETS that keeps its error below `error`."""
    for share in TARGETS:
        quality = Quality(method="reference", target_error=max(share * error, 1e-6))
        began = clock()
        prediction = predict(replace(scene, quality=quality), deadline=patience)
        seconds = clock() - began
        found = largest_error(prediction, truth)
        if found <= error:
            return seconds, found
    return None


def _trials(problem: Problem, truth: Truth, error: float, patience: float) -> Iterator[Trial]:
    """Yield simulations that err by at most `error` [m], the fastest among them, of ever finer rods."""
    began, best = time.process_time(), math.inf
    for elements in RODS:
        before = math.inf
        for share in STEPS:
            if time.process_time() - began > patience:
                return
            trial = _simulated(problem, truth, elements, share * error)
            if trial.error <= error:
                best = min(best, trial.seconds)
                yield trial
            if share == STEPS[0] and trial.seconds > best:
                return  # finer rods take longer still
            if trial.error <= error or trial.seconds > best or abs(trial.error - before) < FLAT * before:
                break
            before = trial.error


def _simulated(problem: Problem, truth: Truth, elements: int, tolerance: float) -> Trial:
    """Simulate a rod, as firm and as stiff as the reference would have it, and compare it with the truth."""
    firmness, stiffening, stiffer = FIRMER ** max(0.0, math.log2(elements / ELEMENTS)), 0.0, 1.0
    nodes = nodes_of(problem, elements, 0)
    while stiffer > stiffening:
        stiffening, began = stiffer, clock()
        motion = simulate(build(problem, nodes, stiffening, firmness), tolerance, Monitor())
        seconds = clock() - began
        stiffer = stiffened(problem, motion, stiffening)
    if motion.stopped:
        return Trial(seconds, math.inf, len(nodes) - 1, motion.steps)
    u = np.linspace(0.0, problem.scene.cable.length, SAMPLES[0])
    t = np.linspace(0.0, problem.horizon, SAMPLES[1])
    positions = CubicSpline(nodes, samples(motion).positions(t), axis=1)(u)
    error = float(np.linalg.norm(positions - truth.positions, axis=-1).max())
    return Trial(seconds, error, len(nodes) - 1, motion.steps)
