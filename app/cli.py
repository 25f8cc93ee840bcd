"""The command line: ``dlo serve``, ``predict``, ``identify``, ``validate``, ``calibrate``, ``study``, ``warmup``."""

import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code."""
    try:
        with _ended_by_an_interrupt():
            from app.commands import command_line  # slow to import

        return command_line.run(arguments)
    except KeyboardInterrupt:
        return 130


@contextmanager
def _ended_by_an_interrupt() -> Iterator[None]:
    """Let an interrupt end the process at once: Python can lose an interrupt that arrives during an import."""
    handler = signal.getsignal(signal.SIGINT)
    if handler is not signal.default_int_handler or threading.current_thread() is not threading.main_thread():
        yield
        return
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, handler)


if __name__ == "__main__":
    sys.exit(main())
