"""The machine of a measurement: processor, cores, versions, commit."""

import subprocess
from pathlib import Path

from dlocore import machine as here


def machine() -> dict[str, str]:
    """Return processor, usable cores, system, versions and commit; the commit is marked where files differ from it."""
    return here.machine() | {"commit": _commit()}


def machine_line() -> str:
    """Return `machine()` in one line."""
    return f"{here.machine_line()}, commit {_commit()}"


def _commit() -> str:
    def git(*arguments: str) -> str:
        folder = Path(__file__).parent
        done = subprocess.run(["git", *arguments], capture_output=True, text=True, check=True, cwd=folder)
        return done.stdout.strip()

    try:
        changed = git("status", "--porcelain", "--untracked-files=no", ":/dlocore", ":/benchmarks")
        return git("rev-parse", "--short", "HEAD") + ("+changes" if changed else "")
    except (OSError, subprocess.CalledProcessError):
        return "unknown"
