"""Prediction of the next step of a motion from the differences of its last states."""

from typing import Any

import numpy as np

from dlocore.compiling.kernel import kernel, leaf

ORDERS = 5  # differences at most: states are known to a tolerance, so higher ones are noise


@kernel
def differences_of(states: Any) -> Any:
    """Return the backward differences (ORDERS + 1, n, nc) at the last of the states (k, n, nc), zero where unknown."""
    past = np.zeros((ORDERS + 1, *states.shape[1:]))
    for k in range(max(0, len(states) - ORDERS - 1), len(states)):
        shift(past, states[k])
    return past


@leaf
def shift(past: Any, q: Any) -> None:
    """Advance the differences to the next state q (n, nc): past[m] is its m-th backward difference."""
    for i in range(q.shape[0]):
        for d in range(q.shape[1]):
            x = q[i, d]
            for m in range(len(past)):
                before = past[m, i, d]
                past[m, i, d] = x
                x -= before


@leaf
def predict_by(past: Any, known: int) -> int:
    """Return how many differences predict the next state best, 0 where fewer than four states are known.

    In the last step, a prediction q_k + ... + past[m - 1] had the error past[m]; the order with the smallest error is
    taken.
    """
    best, least = 0, np.inf
    for order in range(2, min(known, len(past))):
        square = 0.0  # the same in every frame of reference
        for i in range(past.shape[1]):
            for d in range(past.shape[2]):
                square += past[order, i, d] * past[order, i, d]
        if square < least:
            best, least = order, square
    return best
