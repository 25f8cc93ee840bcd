"""What a process that was killed left half-written in the data directory, and when it is safe to remove it."""

import contextlib
import fcntl
import logging
import os
import shutil
from pathlib import Path

_log = logging.getLogger("dlo")


def claim(data_dir: Path) -> int:
    """Mark the data directory as in use, and remove what is half-written where no other process uses it.

    The mark is a shared lock, which the system takes back from a process however it ends. Where another process uses
    the directory the log says what that means. Where the file system has no locks nothing is removed. Close the
    returned file descriptor to give the lock up.
    """
    handle = os.open(data_dir, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        _remove(data_dir)
    except BlockingIOError:
        _log.warning("another process uses %s: each answers 404 for what the other one is given from now on", data_dir)
    except OSError:  # no locks
        pass
    with contextlib.suppress(OSError):
        fcntl.flock(handle, fcntl.LOCK_SH)
    return handle


def _remove(data_dir: Path) -> None:
    """Remove unfinished runs, recordings and viewer files; the names of finished ones have no dot in front."""
    for path in [*(data_dir / "runs").glob(".*"), *data_dir.glob(".viewer-*")]:
        if path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)
