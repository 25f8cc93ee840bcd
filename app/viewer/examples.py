"""The ready scenes: files of the gallery, each a scene as the API takes it."""

import json
import re
from functools import cache
from typing import Any

from app.routes.pages import static_dir

_NAME = re.compile(r"[a-z0-9]+(-[a-z0-9]+)*")


@cache
def example_names() -> tuple[str, ...]:
    """Return the names of the ready scenes."""
    return tuple(sorted(path.stem for path in (static_dir() / "gallery").glob("*.json") if _NAME.fullmatch(path.stem)))


def example(name: str) -> dict[str, Any] | None:
    """Return the document of a ready scene; None where there is none of that name."""
    if name not in example_names():
        return None
    document: dict[str, Any] = json.loads((static_dir() / "gallery" / f"{name}.json").read_bytes())
    return document
