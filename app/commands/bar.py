"""A progress bar for measurements, on a terminal."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def progress_bar(name: str) -> Iterator[Callable[[int, int, str], None]]:
    """Show a bar on standard error during the `with` block, if standard error is a terminal.

    Yields:
        A function to call with the number of parts done, the number of all parts, and the next part in words.
    """
    from tqdm import tqdm

    with tqdm(desc=name, file=sys.stderr, disable=not sys.stderr.isatty(), leave=False) as bar:

        def show(done: int, total: int, what: str) -> None:
            bar.total = total
            bar.set_postfix_str(what)
            bar.update(done - bar.n)

        yield show
