"""What a process that was killed left half-written in the data directory, and when it is safe to remove it."""

import contextlib
import fcntl
import os
import shutil
from pathlib import Path


def claim(data_dir: Path) -> int:
    """Mark the data directory as in use, and remove what is half-written where no other process uses it.

    The mark is a shared lock, which the system takes back from a process however it ends. Where the file system has
    no locks nothing is removed. Close the returned file descriptor to give the lock up.
    """
    handle = os.open(data_dir, os.O_RDONLY)
    with contextlib.suppress(OSError):  # in use, or no locks
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        _remove(data_dir)
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
