"""Files that are written whole or not at all."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from uuid import uuid4


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """Give a place beside `path` to write to, which takes its place at the end; whoever is interrupted leaves nothing.

    A device or a pipe is written to itself.

    Raises:
        OSError: the file can't be written.
    """
    path = path.resolve()  # what a link leads to is written, not the link
    if path.exists() and not path.is_file():
        yield path
        return
    unfinished = path.with_name(f".{uuid4().hex}{path.suffix[:8]}")
    try:
        yield unfinished
        if path.exists():
            shutil.copymode(path, unfinished)
        unfinished.replace(path)
    except BaseException:
        unfinished.unlink(missing_ok=True)
        raise


def write_whole(path: Path, content: bytes) -> None:
    """Write a file whole or not at all; OSError where it can't be."""
    with whole(path) as unfinished:
        unfinished.write_bytes(content)
