"""Interrupts, as by Ctrl-C, wait until compiled code has returned.

When a compiled function returns arrays and tuples, it calls Python for their types. Python then runs the handler of any
signal that arrived meanwhile. numba does not check for an error that this handler raises, as Python's own handler does:
the process would end with a segmentation fault. LLVM also calls Python while it loads a function, and such an error
would be lost.
"""

import _signal  # which `signal` wraps: the enumerations there take longer than everything else here
from collections.abc import Callable
from functools import wraps
from threading import current_thread, main_thread
from types import FrameType
from typing import Any, ParamSpec, TypeVar, cast

P = ParamSpec("P")
T = TypeVar("T")

_SIGINT = cast(int, _signal.SIGINT)
# beginnings of the module names of code that is called by compiled code to find types and make named tuples, or by LLVM
_CALLED = ("numba.core.serialize", "namedtuple_", "llvmlite.binding.executionengine")


class _Deferring:
    """A signal handler that replaces another, and holds back interrupts while compiled code runs."""

    def __init__(self, handler: Callable[[int, FrameType | None], Any]) -> None:
        self.handler = handler
        self.held = False

    def __call__(self, number: int, frame: FrameType | None) -> None:
        if _is_compiled(frame):
            self.held = True
        else:
            self.handler(number, frame)

    def let_in(self) -> None:
        """Call the other handler if an interrupt was held back."""
        if self.held:
            self.held = False
            self.handler(_SIGINT, None)


def _is_compiled(frame: FrameType | None) -> bool:
    """Tell whether the running code was called by compiled code, or by the loading of compiled code."""
    while frame is not None:
        if str(frame.f_globals.get("__name__")).startswith(_CALLED):
            return True
        frame = frame.f_back
    return False


def interruptible(function: Callable[P, T]) -> Callable[P, T]:
    """Make Python's interrupt handler run only outside of compiled code while `function` runs.

    This applies to the main thread, the only one that runs handlers. It takes about a microsecond.
    """

    @wraps(function)
    def call(*args: P.args, **kwargs: P.kwargs) -> T:
        before: Any = _signal.getsignal(_SIGINT)
        if not callable(before) or isinstance(before, _Deferring) or current_thread() is not main_thread():
            return function(*args, **kwargs)
        deferring = _Deferring(before)
        try:
            _signal.signal(_SIGINT, deferring)
            return function(*args, **kwargs)
        finally:
            _signal.signal(_SIGINT, before)
            deferring.let_in()

    return call


def let_in() -> None:
    """Deliver a held-back interrupt, if this is not compiled code; to be called now and then during long work."""
    handler: Any = _signal.getsignal(_SIGINT)
    if isinstance(handler, _Deferring) and handler.held and current_thread() is main_thread():
        handler.let_in()
