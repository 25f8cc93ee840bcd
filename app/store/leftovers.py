"""Remove what a killed process left half-written in the data directory, when that is safe."""

import contextlib
import fcntl
import logging
import os
import shutil
from pathlib import Path

_log = logging.getLogger("dlo")


def claim(data_dir: Path) -> int:
    """Mark the data directory as in use, and remove half-written files if no other process uses it.

    The mark is a shared lock, which the system releases however the process ends. If another process uses the
    directory, a warning in the log says what that means. If the file system has no locks, nothing is removed. Close the
    returned file descriptor to release the lock.
    """
    handle = os.open(data_dir, os.O_RDONLY)
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        _remove(data_dir)
    except BlockingIOError:
        _log.warning("another process uses %s: each answers 404 for runs that the other stores from now on", data_dir)
    except OSError:  # the file system has no locks
        pass
    with contextlib.suppress(OSError):
        fcntl.flock(handle, fcntl.LOCK_SH)
    return handle


def _remove(data_dir: Path) -> None:
    """Remove unfinished runs, recordings and viewer files; names of finished ones do not begin with a dot."""
    for path in [*(data_dir / "runs").glob(".*"), *data_dir.glob(".viewer-*")]:
        if path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        else:
            path.unlink(missing_ok=True)
