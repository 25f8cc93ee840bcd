"""How far a measurement is, on a terminal."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager


@contextmanager
def progress_bar(name: str) -> Iterator[Callable[[int, int, str], None]]:
    """Show a bar on standard error, where that is a terminal, as long as the `with` lasts.

    Yields:
        What to call with how many parts are done, how many there are, and what comes, in words.
    """
    from tqdm import tqdm

    with tqdm(desc=name, file=sys.stderr, disable=not sys.stderr.isatty(), leave=False) as bar:

        def show(done: int, total: int, what: str) -> None:
            bar.total = total
            bar.set_postfix_str(what)
            bar.update(done - bar.n)

        yield show
