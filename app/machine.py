"""What this program runs on."""

import platform
from functools import cache
from importlib.metadata import version
from pathlib import Path

from app.settings import usable_cores

_PACKAGES = ("numpy", "scipy", "numba")
_BARE = ("processor", "system")  # they name themselves


@cache
def machine() -> dict[str, str]:
    """Return processor, cores that may be used, system and versions."""
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
