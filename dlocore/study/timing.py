"""The time of a solve."""

import time
from collections.abc import Callable
from typing import NamedTuple, TypeVar

import numpy as np

from dlocore.shape.fit import forget_fits

Answer = TypeVar("Answer")

# A solve runs in one thread: the processor time of this thread is its time on a core of its own, whatever else the
# machine does. If the clock of a thread is coarse, the elapsed time has to do.
_FINE = 1e-6  # [s]
clock = time.thread_time if time.get_clock_info("thread_time").resolution <= _FINE else time.perf_counter


class Times(NamedTuple):
    """Times of repeated calls [s]: their median, their median absolute deviation, and their number."""

    median: float
    spread: float
    repeats: int


def timed(call: Callable[[], Answer], repeats: int, patience: float = np.inf) -> tuple[Answer, Times]:
    """Return the last answer of `call` and its times; the first of several calls, which loads code, is not counted.

    No call benefits from earlier ones: cached fits of points are cleared in between.

    Args:
        call: what is measured.
        repeats: how often, at least 1.
        patience: no further repeats after this total time [s].
    """
    taken: list[float] = []
    while len(taken) <= repeats and (len(taken) < 2 or sum(taken) < patience):
        forget_fits()
        began = clock()
        answer = call()
        taken.append(clock() - began)
    counted = np.array(taken[1:])
    median = float(np.median(counted))
    return answer, Times(median, float(np.median(np.abs(counted - median))), len(counted))
