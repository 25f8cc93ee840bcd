"""Decorators of the compiled functions, with a cache on disk that depends on the source of all of them."""

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
_njit: Any = numba.njit  # `_nrt`, reference counting, is an option that numba does not document


def kernel(function: Callable[..., Any]) -> Any:
    """Compile `function` without the GIL and without fastmath, which would hide NaN.

    numba's cache checks only the age of the function's own file, and so would miss a change of a law that is inlined
    into a kernel. The stamp here is therefore the hash of all compiled sources.
    """
    return _compiled(function, nogil=True, _nrt=True)


def brief(function: Callable[..., Any]) -> Any:
    """Compile a kernel that takes microseconds and keeps the GIL: releasing and retaking it would take longer."""
    return _compiled(function, nogil=False, _nrt=True)


def leaf(function: Callable[..., Any]) -> Any:
    """Compile a kernel that neither creates nor returns arrays, and so needs no reference counts of its arguments.

    For a short cable, atomic counts of every array of every table take longer than the assembly.
    """
    return _compiled(function, nogil=False, _nrt=False)


def law(function: Callable[..., Any]) -> Any:
    """Compile a pointwise law that is inlined into the kernels; it creates no arrays either."""
    return _njit(error_model="numpy", forceinline=True, _nrt=False)(function)


part = law  # a part of a kernel, inlined: passing a table, which is a hundred numbers, takes longer than some parts


def _compiled(function: Callable[..., Any], **options: bool) -> Any:
    return kept(_njit(cache=True, error_model="numpy", **options)(function), _SOURCE)
