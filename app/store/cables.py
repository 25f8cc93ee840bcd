"""Cables that were identified and kept: presets in addition to the library's, for all tabs of a service."""

import json
import logging
import threading
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from app.schemas.cable import CableModel
from dlocore import PRESETS, SceneError
from dlocore.files import write_whole

LONGEST_NAME = 60
MOST = 200
FILE = "cables.json"
_OF_A_PIECE = ("length", "point_masses")  # properties of a single cable, not of its kind
_log = logging.getLogger(__name__)


class KeptCables:
    """Named cables with the drag that belongs to them, in one file of the data directory.

    Args:
        folder: the data directory.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder / FILE
        self._lock = threading.Lock()

    def all(self) -> dict[str, dict[str, Any]]:
        """Return the kept cables by name: `cable` without length and connectors, and `environment` with the drag."""
        try:
            found = json.loads(self._path.read_text())
        except FileNotFoundError:
            return {}
        except (OSError, ValueError):
            _log.exception("%s can't be read", self._path)
            return {}
        if not isinstance(found, dict):
            return {}
        return {str(k): v for k, v in found.items() if isinstance(v, dict) and _is_cable(v.get("cable"))}

    def keep(self, name: str, cable: Mapping[str, Any], environment: Mapping[str, Any]) -> None:
        """Keep a cable under a name; it replaces a cable kept under the same name.

        Raises:
            SceneError: the name is empty, too long or that of a preset of the library, or there are too many cables.
            OSError: the file can't be written.
        """
        name = name.strip()
        if not 0 < len(name) <= LONGEST_NAME or name in PRESETS:
            raise SceneError(
                "name", repr(name), f"1 to {LONGEST_NAME} characters, and no name of a preset of the library"
            )
        with self._lock:
            kept = self.all()
            if name not in kept and len(kept) >= MOST:
                raise SceneError("name", repr(name), f"the name of one of the {MOST} cables that are kept already")
            values = {key: value for key, value in cable.items() if key not in _OF_A_PIECE and value is not None}
            kept[name] = {"cable": values, "environment": dict(environment)}
            self._path.parent.mkdir(parents=True, exist_ok=True)
            write_whole(self._path, json.dumps(kept, indent=1).encode())


def _is_cable(values: Any) -> bool:
    return isinstance(values, dict) and set(values) <= set(CableModel.model_fields)
