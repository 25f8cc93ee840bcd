"""Keep viser from announcing its internal ports, which users should not open."""

import contextlib
from collections.abc import Iterator

import rich


@contextlib.contextmanager
def quiet_console() -> Iterator[None]:
    """Print nothing to rich's console while the context lasts."""
    console = rich.get_console()
    before, console.quiet = console.quiet, True
    try:
        yield
    finally:
        console.quiet = before
