"""Locate the files of the web pages."""

from pathlib import Path

_PACKAGE = Path(__file__).parents[1]


def static_dir() -> Path:
    """Return the directory of the pages: next to the package in a checkout, inside it when installed."""
    root = _PACKAGE.parent
    return root / "static" if (root / "pyproject.toml").is_file() else _PACKAGE / "static"
