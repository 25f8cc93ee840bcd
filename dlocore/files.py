"""Files that are written whole or not at all."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from uuid import uuid4


@contextmanager
def whole(path: Path) -> Iterator[Path]:
    """Yield a temporary path beside `path`, which replaces `path` at the end; an error or interrupt leaves no file.

    A device or a pipe is yielded itself.

    Raises:
        OSError: the file can't be written.
    """
    path = path.resolve()  # the target of a link is replaced, not the link
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
    """Write a file whole or not at all.

    Raises:
        OSError: it can't be written.
    """
    with whole(path) as unfinished:
        unfinished.write_bytes(content)
