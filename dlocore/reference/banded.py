"""Factorisation, without pivoting, of a symmetric band: the tangent of a rod's equations."""

from typing import Any

from dlocore.reference.compile import compiled


@compiled
def factor(K: Any) -> bool:
    """Factor the band K (n, w + 1) as L D L' in place and return whether D is positive.

    Before, K[i, o] is the element (i, i - o); afterwards K[:, 0] is D and the rest is L.
    """
    n, w = K.shape[0], K.shape[1] - 1
    for i in range(n):
        low = max(0, i - w)
        for j in range(low, i):
            value = K[i, i - j]
            for k in range(max(low, j - w), j):
                value -= K[i, i - k] * K[j, j - k]
            K[i, i - j] = value
        d = K[i, 0]
        for j in range(low, i):
            value = K[i, i - j]
            scaled = value / K[j, 0]
            d -= value * scaled
            K[i, i - j] = scaled
        if not d > 0.0:
            return False
        K[i, 0] = d
    return True


@compiled
def solve(K: Any, x: Any) -> None:
    """Solve in place for x (n,) with the factors that `factor` left in K."""
    n, w = K.shape[0], K.shape[1] - 1
    for i in range(n):
        value = x[i]
        for j in range(max(0, i - w), i):
            value -= K[i, i - j] * x[j]
        x[i] = value
    for i in range(n):
        x[i] /= K[i, 0]
    for i in range(n - 1, -1, -1):
        value = x[i]
        for j in range(max(0, i - w), i):
            x[j] -= K[i, i - j] * value
