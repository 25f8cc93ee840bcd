"""Stored studies: one JSON file each, written whole or not at all, limited in number."""

import threading
from pathlib import Path

from app.schemas.base import ID
from dlocore.files import write_whole

MAX_STUDIES = 100  # beyond it the oldest are removed


class StudyStore:
    """The stored studies of a data directory; safe to call from any thread."""

    def __init__(self, data_dir: Path) -> None:
        self._root = data_dir / "studies"
        self._lock = threading.Lock()

    def save(self, id: str, document: bytes) -> None:
        """Store the document of a study."""
        with self._lock:
            self._root.mkdir(parents=True, exist_ok=True)
            write_whole(self._file(id), document)
            for file in sorted(self._files(), reverse=True)[MAX_STUDIES:]:
                file.unlink(missing_ok=True)

    def document(self, id: str) -> bytes | None:
        """Return the document of a study, or None if there is none."""
        if not ID.fullmatch(id):
            return None
        try:
            return self._file(id).read_bytes() or None  # a file that was emptied is as good as none
        except FileNotFoundError:
            return None

    def delete(self, id: str) -> bool:
        """Remove a study; return whether it was there."""
        if not ID.fullmatch(id):
            return False
        try:
            self._file(id).unlink()
        except FileNotFoundError:
            return False
        return True

    def sizes(self) -> dict[str, int]:
        """Return the bytes of each stored study by its id."""
        return {file.stem: file.stat().st_size for file in self._files()}

    def _file(self, id: str) -> Path:
        return self._root / f"{id}.json"

    def _files(self) -> list[Path]:
        return [file for file in self._root.glob("*.json") if ID.fullmatch(file.stem)]
