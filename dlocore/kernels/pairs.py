"""Tangents of the curvature points of a knot span, summed before they are added to the band.

A point adds to the tangent's block of control points i and j a sum of blocks of the point, each times a product of a
derivative of the basis function of i and one of j. `Tables.curvature.pairs` (points, PAIRS, 4) holds these products.
The blocks of a point and the sums of its span are rows of one array, so that whole rows are added: with two arrays, a
compiler would have to check each time whether they overlap. With twist there are too many blocks for that, and spans
are processed side by side, see `lanes.py`.
"""

from typing import Any

import numpy as np

from dlocore.compiling.kernel import kernel, part

# of control point i, then of j: B is the first and C the second derivative of its basis function
BB, BC, CB, CC = range(4)
PAIRS = 10  # i >= j of four control points, column by column
SUMS = 4  # the first row of sums; the rows before are the blocks of a point, by BB, BC, CB and CC


@kernel
def pair_products(b1: Any, b2: Any) -> Any:
    """Return the products (points, PAIRS, 4) of the first and second derivatives b1 and b2 (points, 4)."""
    out = np.empty((len(b1), PAIRS, 4))
    for n in range(len(b1)):
        b, c = b1[n], b2[n]
        pair = 0
        for j in range(4):
            for i in range(j, 4):
                row = out[n, pair]
                row[BB], row[BC], row[CB], row[CC] = b[i] * b[j], b[i] * c[j], c[i] * b[j], c[i] * c[j]
                pair += 1
    return out


@part
def add_point(blocks: Any, products: Any) -> None:
    """Add the blocks of a point, the first rows, to the sums of its span, (SUMS + PAIRS, nc nc) together.

    Column nc e + d is the entry of coordinate d of control point i and coordinate e of j.
    """
    columns = blocks.shape[1]  # a number known to the compiler would be unrolled instead of vectorised
    for pair in range(PAIRS):
        bb, bc, cb, cc = products[pair, BB], products[pair, BC], products[pair, CB], products[pair, CC]
        for c in range(columns):
            blocks[SUMS + pair, c] += bb * blocks[BB, c] + bc * blocks[BC, c] + cb * blocks[CB, c] + cc * blocks[CC, c]


@part
def add_span(nc: int, K: Any, k: int, blocks: Any) -> None:
    """Add the sums of a span from control point k on to the band K, and clear them."""
    pair = SUMS
    for j in range(4):
        for i in range(j, 4):
            for e in range(nc):
                for d in range(e if i == j else 0, nc):
                    K[nc * (k + j) + e, nc * (i - j) + d - e] += blocks[pair, nc * e + d]
            pair += 1
    for pair in range(SUMS, SUMS + PAIRS):
        for c in range(nc * nc):
            blocks[pair, c] = 0.0
