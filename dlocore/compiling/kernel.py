"""The decorator of every compiled function, with an on-disk cache that follows the source of all of them."""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba

from dlocore.compiling.caching import kept


def _digest() -> str:
    """Hash the source of everything that is compiled."""
    package = Path(__file__).parent.parent
    sources = sorted([*(package / "kernels").glob("*.py"), *(package / "effects").glob("*.py"), Path(__file__)])
    return hashlib.sha256(b"".join(path.read_bytes() for path in sources)).hexdigest()


_SOURCE = _digest()
_njit: Any = numba.njit  # `_nrt`, the counting of references, is an option that it does not document


def kernel(function: Callable[..., Any]) -> Any:
    """Compile `function` without the GIL and without fastmath, which would hide NaN.

    numba's cache of a function looks only at the age of that function's own file, so a change of a law that is inlined
    into a kernel would go unnoticed. The stamp is therefore the hash of all compiled sources.
    """
    return _compiled(function, nogil=True, _nrt=True)


def brief(function: Callable[..., Any]) -> Any:
    """Compile a kernel that takes microseconds, with the GIL: to hand it to another thread and back takes longer."""
    return _compiled(function, nogil=False, _nrt=True)


def leaf(function: Callable[..., Any]) -> Any:
    """Compile a kernel that makes no array and returns none, and so need not count who refers to those it is handed.

    Atomic counts up and down, of every array of every table, take longer than the assembly for a short cable.
    """
    return _compiled(function, nogil=False, _nrt=False)


def law(function: Callable[..., Any]) -> Any:
    """Compile a pointwise law that is inlined into the kernels, and makes no array either."""
    return _njit(error_model="numpy", forceinline=True, _nrt=False)(function)


part = law  # of a kernel, into it: handing over a table, which is a hundred numbers, takes longer than some parts


def _compiled(function: Callable[..., Any], **options: bool) -> Any:
    return kept(_njit(cache=True, error_model="numpy", **options)(function), _SOURCE)
