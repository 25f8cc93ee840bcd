"""The machine that this program runs on, and the directory of a user's data."""

import os
import platform
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

_PACKAGES = ("numpy", "scipy", "numba")
_BARE = ("processor", "system")  # their values need no label


def usable_cores() -> int:
    """Return how many cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def program_version() -> str:
    """Return the installed version of this program, "0" if it runs from a checkout."""
    try:
        return version("dlo")
    except PackageNotFoundError:
        return "0"


def user_data_dir() -> Path:
    """Return the user's data directory for this program: ``$XDG_DATA_HOME/dlo``, else ``~/.local/share/dlo``."""
    base = os.environ.get("XDG_DATA_HOME", "")
    return (Path(base) if Path(base).is_absolute() else Path.home() / ".local" / "share") / "dlo"


@cache
def machine() -> dict[str, str]:
    """Return the processor, the number of usable cores, the system, and the versions of Python and packages."""
    return {
        "processor": _processor(),
        "cores": str(usable_cores()),
        "system": f"{platform.system()} {platform.machine()}",
        "Python": platform.python_version(),
        **{name: version(name) for name in _PACKAGES},
    }


def machine_line() -> str:
    """Return `machine()` in one line."""
    return ", ".join(value if name in _BARE else f"{name} {value}" for name, value in machine().items())


def _processor() -> str:
    listing = Path("/proc/cpuinfo")
    if listing.is_file():
        for line in listing.read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or "unknown processor"
