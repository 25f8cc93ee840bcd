"""Search the settings of a peer for the fastest ones that meet each tolerance."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from benchmarks.peers.cases import Case

Floats = NDArray[np.float64]
Value = float | int | str
Setting = dict[str, Value]
TOLERANCES = (1e-2, 3e-3, 1e-3, 3e-4)  # [m]
PATIENCE = 0.3  # [s] for the repeats of one measurement, of which there are at least three
FLAT = 0.03  # relative change of the error by a finer resolution in time that is none
STEEP = 5.0  # the most that one more value of the last knob improves the error: 1.4 times the steps, fourth order
BEYOND = 1.5  # the expected costs are that rough
QUICK = 0.003  # [s]: a trial below it is repeated, since a single time of it says little


class Peer(Protocol):
    """What predicts a case.

    Attributes:
        name: for tables and plots.
        budget: processor time [s] that the search may take on one case.
    """

    name: str
    budget: float

    def knobs(self, case: Case) -> dict[str, tuple[Value, ...]]:
        """Return the values of each setting, that of the resolution in time last; empty where it can't do the case."""

    def cost(self, case: Case, setting: Setting) -> float:
        """Return what a setting is expected to cost, in a unit of the peer's own."""

    def prepare(self, case: Case, setting: Setting) -> Callable[[], Callable[[], Floats]]:
        """Set the case up; the returned call predicts it (timed) and returns what samples it (33, 101, 3) [m]."""


@dataclass(frozen=True, kw_only=True)
class Trial:
    """One setting on one case: largest error over the motion [m], of the final shape, rms; times [s]."""

    peer: str
    case: str
    setting: Setting
    error: float
    final: float
    rms: float
    seconds: float
    setup: float
    repeats: int = 1


def measure(peer: Peer, case: Case, setting: Setting, *, repeats: int = 1) -> Trial:
    """Predict a case with one setting; what fails, or leaves the finite numbers, has an infinite error."""
    times: list[float] = []
    setups: list[float] = []
    positions = np.full_like(case.truth, np.nan)
    while len(times) < repeats and (len(times) < 3 or sum(times) < PATIENCE):
        began = time.process_time()
        run = peer.prepare(case, setting)
        ready = time.process_time()
        try:
            sample = run()
            ended = time.process_time()
            if not times:
                positions = sample()
        except (ArithmeticError, ValueError, RuntimeError):
            ended = time.process_time()
        setups.append(ready - began)
        times.append(ended - ready)
        if len(times) == repeats == 1 and times[0] < QUICK:
            repeats = 3
    away = np.linalg.norm(positions - case.truth, axis=-1)
    finite = bool(np.isfinite(away).all())
    return Trial(
        peer=peer.name,
        case=case.name,
        setting=setting,
        error=float(away.max()) if finite else math.inf,
        final=float(away[-1].max()) if finite else math.inf,
        rms=float(np.sqrt((away**2).mean())) if finite else math.inf,
        seconds=float(np.median(times)),
        setup=float(np.median(setups)),
        repeats=len(times),
    )


def search(peer: Peer, case: Case, patience: float = 1.0) -> list[Trial]:
    """Return all trials of a search: every setting in the order of expected cost, but for those that cannot win.

    The last knob resolves time. Where raising it no longer changes the error by `FLAT`, the rest of its values is
    left out, and so is a value after which the error can't be small enough for a tolerance that nothing cheaper meets.
    The search ends where each tolerance is met and all that is left is expected to cost `BEYOND` times as much as the
    dearest winner, or after `patience` times the peer's budget.
    """
    knobs = peer.knobs(case)
    if not knobs:
        return []
    settings = [dict(zip(knobs, values, strict=True)) for values in product(*knobs.values())]
    time_knob = list(knobs)[-1]
    began = time.process_time()
    trials: list[Trial] = []
    done: dict[tuple[Value, ...], float] = {}  # errors of the last trial of every line, NaN for a finished one
    for setting in sorted(settings, key=lambda s: peer.cost(case, s)):
        if time.process_time() - began > patience * peer.budget:
            break
        winners = [best(trials, tolerance) for tolerance in TOLERANCES]
        costs = [math.inf if w is None else BEYOND * peer.cost(case, w.setting) for w in winners]
        cost = peer.cost(case, setting)
        open_to = [tolerance for tolerance, most in zip(TOLERANCES, costs, strict=True) if cost <= most]
        if not open_to:
            break
        line = tuple(value for name, value in setting.items() if name != time_knob)
        last = done.get(line, math.inf)
        if math.isfinite(last) and last > STEEP * open_to[0]:
            done[line] = last / STEEP
            continue
        if math.isnan(last):
            continue
        trial = measure(peer, case, setting)
        trials.append(trial)
        flat = math.isfinite(trial.error) and abs(trial.error - last) < FLAT * trial.error
        done[line] = math.nan if flat or trial.error < TOLERANCES[-1] else trial.error
    return trials


def best(trials: list[Trial], tolerance: float) -> Trial | None:
    """Return the fastest of trials that meets a tolerance [m]."""
    met = [t for t in trials if t.error <= tolerance]
    return min(met, key=lambda t: t.seconds) if met else None
