"""What this program runs on, in words."""

import platform
from functools import cache
from importlib.metadata import version
from pathlib import Path

from app.settings import usable_cores

_PACKAGES = ("numpy", "scipy", "numba")


@cache
def machine_line() -> str:
    """Return processor, cores that may be used, system and versions in one line."""
    system = f"{platform.system()} {platform.machine()}"
    versions = [f"{name} {version(name)}" for name in _PACKAGES]
    return ", ".join(
        [_processor(), f"{usable_cores()} cores", system, f"Python {platform.python_version()}", *versions]
    )


def _processor() -> str:
    listing = Path("/proc/cpuinfo")
    if listing.is_file():
        for line in listing.read_text().splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or "unknown processor"
