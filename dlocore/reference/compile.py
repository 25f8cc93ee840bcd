"""The decorator of the compiled functions of this package, whose cache depends only on their source."""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba

from dlocore.compiling.caching import kept

# files that are compiled, or read by compiled code
_FILES = ("compile", "body", "banded", "hinge", "surface", "forces", "energy", "step")
_SOURCE = hashlib.sha256(b"".join(Path(__file__).with_name(f"{name}.py").read_bytes() for name in _FILES)).hexdigest()


def compiled(function: Callable[..., Any]) -> Any:
    """Compile `function` without the GIL and without fastmath, which would hide NaN.

    numba checks only the age of the function's own file, so the stamp of the cache here is the hash of all these files.
    """
    made: Any = numba.njit(cache=True, nogil=True, error_model="numpy")(function)
    return kept(made, _SOURCE)
