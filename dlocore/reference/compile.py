"""The decorator of the compiled functions of this package, whose cache follows their source and no other."""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba

from dlocore.compiling.caching import kept

_FILES = ("compile", "body", "banded", "hinge", "surface", "forces", "energy", "step")  # what is compiled, or read so
_SOURCE = hashlib.sha256(b"".join(Path(__file__).with_name(f"{name}.py").read_bytes() for name in _FILES)).hexdigest()


def compiled(function: Callable[..., Any]) -> Any:
    """Compile `function` without the GIL and without fastmath, which would hide NaN.

    numba looks only at the age of a function's own file, so the stamp of its cache is the hash of all of these.
    """
    made: Any = numba.njit(cache=True, nogil=True, error_model="numpy")(function)
    return kept(made, _SOURCE)
