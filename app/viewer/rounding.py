"""Round numbers of the document, which people read: 0.0053 rather than 0.0053000000000000001."""

from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike


def rounded(value: float, digits: int = 9) -> float:
    """Return a number rounded to so many significant digits."""
    return float(f"{value:.{digits}g}")


def listed(values: ArrayLike, digits: int = 6) -> list[Any]:
    """Return an array as a list of numbers, or of lists, rounded to so many digits after the point; -0 becomes 0."""
    return cast(list[Any], (np.round(np.asarray(values, dtype=float), digits) + 0.0).tolist())
