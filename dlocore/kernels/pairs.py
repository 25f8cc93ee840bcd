"""Tangents of the curvature points of a knot span, added up before they go into the band.

What a point adds to the tangent between control points i and j is a sum of numbers of the point, each times a product
of a basis function of i and one of j. `Tables.curvature_pairs` (points, 9, PAIRS) holds these products, so that the
points of a span add up along contiguous rows, one for each entry of the blocks.
"""

from typing import Any

import numpy as np

from dlocore.kernels.banded import clear
from dlocore.kernels.compile import kernel, law

# of control point i, then of j: A its basis function, B the first and C the second derivative
BB, BC, CB, CC, AA, AB, BA, AC, CA = range(9)
PAIRS = 12  # i >= j of four control points, column by column; the last two are empty, to make whole vectors


@kernel
def pair_products(b0: Any, b1: Any, b2: Any) -> Any:
    """Return the products (points, 9, PAIRS) of the basis functions b0 (points, 4) and their derivatives b1 and b2."""
    out = np.zeros((len(b0), 9, PAIRS))
    for n in range(len(b0)):
        a, b, c = b0[n], b1[n], b2[n]
        pair = 0
        for j in range(4):
            for i in range(j, 4):
                out[n, BB, pair], out[n, BC, pair] = b[i] * b[j], b[i] * c[j]
                out[n, CB, pair], out[n, CC, pair] = c[i] * b[j], c[i] * c[j]
                out[n, AA, pair] = a[i] * a[j]
                out[n, AB, pair], out[n, BA, pair] = a[i] * b[j], b[i] * a[j]
                out[n, AC, pair], out[n, CA, pair] = a[i] * c[j], c[i] * a[j]
                pair += 1
    return out


@law
def add_derivatives(row: Any, products: Any, bb: float, bc: float, cb: float, cc: float) -> None:
    """Add to a row (PAIRS,) an entry of the tangent of one point: its second derivatives by r' and r''."""
    first, mixed, turned, second = products[BB], products[BC], products[CB], products[CC]
    for r in range(len(row)):
        row[r] += bb * first[r] + bc * mixed[r] + cb * turned[r] + cc * second[r]


@law
def add_angles(row: Any, products: Any, by_b: int, b: float, by_c: int, c: float) -> None:
    """Add to a row (PAIRS,) an entry between an angle and r', and between it and r''."""
    first, second = products[by_b], products[by_c]
    for r in range(len(row)):
        row[r] += b * first[r] + c * second[r]


@law
def add_one(row: Any, products: Any, by: int, value: float) -> None:
    """Add to a row (PAIRS,) an entry that goes with one kind of products."""
    single = products[by]
    for r in range(len(row)):
        row[r] += value * single[r]


@law
def add_span(nc: int, K: Any, k: int, sums: Any) -> None:
    """Add the blocks of a span from control point k on to the band K, and clear their `sums`.

    Row nc d + e of `sums` (nc nc, PAIRS) is the entry of coordinate d of control point i and coordinate e of j.
    """
    pair = 0
    for j in range(4):
        for i in range(j, 4):
            for e in range(nc):
                for d in range(e if i == j else 0, nc):
                    K[nc * (k + j) + e, nc * (i - j) + d - e] += sums[nc * d + e, pair]
            pair += 1
    clear(sums)
