"""Interrupts of compiled code, as by Ctrl-C: they wait until it is left.

Where a compiled function hands back arrays and tuples, it calls Python, for their types. There the handler of a signal
that came meanwhile is run, and an error that it raises, as Python's own does, is one that numba does not look for: the
process ends by a segmentation fault. LLVM, as it loads a function, calls Python, too, and the error is forgotten.
"""

import _signal  # what `signal` wraps: its enumerations take longer than all else here
from collections.abc import Callable
from functools import wraps
from threading import current_thread, main_thread
from types import FrameType
from typing import Any, ParamSpec, TypeVar, cast

P = ParamSpec("P")
T = TypeVar("T")

_SIGINT = cast(int, _signal.SIGINT)
# what the globals are called, to begin with, of what finds types, makes named tuples, and is told of by LLVM
_CALLED = ("numba.core.serialize", "namedtuple_", "llvmlite.binding.executionengine")


class _Deferring:
    """A handler that stands for another, and keeps for later what comes while compiled code is run."""

    def __init__(self, handler: Callable[[int, FrameType | None], Any]) -> None:
        self.handler = handler
        self.held = False

    def __call__(self, number: int, frame: FrameType | None) -> None:
        if _is_compiled(frame):
            self.held = True
        else:
            self.handler(number, frame)

    def let_in(self) -> None:
        """Call the other handler, where something was kept for it."""
        if self.held:
            self.held = False
            self.handler(_SIGINT, None)


def _is_compiled(frame: FrameType | None) -> bool:
    """Tell whether what is run was called by compiled code, or by what loads it."""
    while frame is not None:
        if str(frame.f_globals.get("__name__")).startswith(_CALLED):
            return True
        frame = frame.f_back
    return False


def interruptible(function: Callable[P, T]) -> Callable[P, T]:
    """Have a handler of interrupts in Python called outside of compiled code alone while `function` runs.

    That is in the main thread, no other runs handlers. It takes about a microsecond.
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
    """Let in an interrupt that waits, where this is not compiled code: to be called now and then in what takes long."""
    handler: Any = _signal.getsignal(_SIGINT)
    if isinstance(handler, _Deferring) and handler.held and current_thread() is main_thread():
        handler.let_in()
