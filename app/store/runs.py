"""Stored runs: one directory each, written whole or not at all, limited in number and bytes."""

import contextlib
import logging
import os
import secrets
import shutil
import threading
import weakref
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import orjson

from app.archive import Run, pack, unpack, unpack_motion
from app.recording import write_recording
from app.schemas import Motion
from app.schemas.base import ID
from app.schemas.ids import new_id
from app.schemas.response import from_prediction
from app.settings import Settings
from app.store.leftovers import claim
from dlocore import Prediction

_log = logging.getLogger("dlo")
RUNS = "runs"  # directory of the runs in a data directory
REQUEST, DOCUMENT, NETS, SUMMARY, RECORDING = "scene.json", "prediction.json", "nets.npz", "summary.json", "run.rrd"


@dataclass
class _Entry:
    summary: dict[str, Any]
    size: int  # bytes of its files
    recording: int = 0  # bytes of its recording, part of `size`


class RunStore:
    """The stored runs of a data directory; safe to call from any thread.

    A run is written to a temporary directory, synced and renamed, so that a crash leaves a whole run or none. If there
    are more than `max_runs` runs, the oldest are removed. If they have more than `max_run_bytes` bytes, recordings are
    removed first, because they can be written again, and then the oldest runs.
    """

    def __init__(self, settings: Settings) -> None:
        self._root = settings.data_dir / RUNS
        self._max_runs = settings.max_runs
        self._max_bytes = settings.max_run_bytes
        self._lock = threading.Lock()
        self._recording = threading.Lock()
        self._entries: dict[str, _Entry] = {}
        self._root.mkdir(parents=True, exist_ok=True)
        weakref.finalize(self, os.close, claim(settings.data_dir))
        for path in sorted(self._root.iterdir()):
            summary = _summary(path) if ID.fullmatch(path.name) else None
            if summary is not None:
                recording = (path / RECORDING).stat().st_size if (path / RECORDING).is_file() else 0
                self._entries[path.name] = _Entry(summary, _size(path), recording)
        with self._lock:
            removed = self._evict()
        _delete(removed)

    def save(
        self,
        scene_json: dict[str, Any] | bytes,
        prediction: Prediction,
        *,
        samples_u: int = 101,
        samples_t: int = 33,
        id: str | None = None,
        name: str = "",
    ) -> tuple[str, bytes]:
        """Store a prediction and return its id and its document, which are valid even if the run is removed at once.

        Args:
            scene_json: the request, as data or as the bytes that were sent.
            prediction: what the solver returned.
            samples_u: samples along the cable in the stored document.
            samples_t: samples in time.
            id: id of the run, from `new_id`; absent: a new one.
            name: name of the run in lists.

        Raises:
            OSError: it can't be written.
        """
        id = id or new_id()
        request = scene_json if isinstance(scene_json, bytes) else orjson.dumps(scene_json)
        document = from_prediction(prediction, id, samples_u, samples_t)
        summary = {
            "id": id,
            "name": name,
            "created": document["created"],
            "status": prediction.status,
            "method": prediction.accuracy.method,
            "error_estimate": document["accuracy"]["error_estimate"],
            "wall_time": prediction.accuracy.wall_time,
            "links": document["links"],
        }
        files = {
            REQUEST: request,
            DOCUMENT: orjson.dumps(document, option=orjson.OPT_SERIALIZE_NUMPY),
            NETS: pack(prediction),
            SUMMARY: orjson.dumps(summary),
        }
        self._write(id, files)
        with self._lock:
            self._entries[id] = _Entry(summary, sum(map(len, files.values())))
            removed = self._evict()
        _delete(removed)
        return id, files[DOCUMENT]

    def _write(self, id: str, files: dict[str, bytes]) -> None:
        temporary = self._root / f".new-{id}"
        temporary.mkdir()
        try:
            for name, content in files.items():
                with (temporary / name).open("wb") as file:
                    file.write(content)
                    file.flush()
                    os.fsync(file.fileno())
            _sync(temporary)
            temporary.rename(self._root / id)
            _sync(self._root)
        except BaseException:
            shutil.rmtree(temporary, ignore_errors=True)
            raise

    def _evict(self) -> list[Path]:
        """Forget the oldest runs beyond the limits; return their directories, renamed so that no reader finds them."""
        ids = sorted(self._entries)
        beyond = ids[: max(0, len(ids) - self._max_runs)]
        removed = [self._forget(id) for id in beyond]
        ids = ids[len(beyond) :]
        total = sum(entry.size for entry in self._entries.values())
        for id in ids:
            if total > self._max_bytes and self._entries[id].recording:
                total -= self._drop_recording(id)
        while len(ids) > 1 and total > self._max_bytes:
            oldest = ids.pop(0)
            total -= self._entries[oldest].size
            removed.append(self._forget(oldest))
        return removed

    def _drop_recording(self, id: str) -> int:
        """Remove the recording of a run and return its size in bytes."""
        entry = self._entries[id]
        dropped, entry.recording = entry.recording, 0
        entry.size -= dropped
        with contextlib.suppress(OSError):  # then it is removed with its run
            (self._root / id / RECORDING).unlink(missing_ok=True)
        return dropped

    def _forget(self, id: str) -> Path:
        del self._entries[id]
        doomed = self._root / f".old-{id}"
        with contextlib.suppress(FileNotFoundError, NotADirectoryError):  # removed by someone else
            (self._root / id).rename(doomed)
        return doomed

    def delete(self, id: str) -> bool:
        """Remove a run; return whether it was there."""
        with self._lock:
            if id not in self._entries:
                return False
            doomed = self._forget(id)
        _delete([doomed])
        return True

    def __contains__(self, id: str) -> bool:
        return id in self._entries

    def page(
        self,
        limit: int,
        offset: int = 0,
        *,
        cursor: str | None = None,
        where: Callable[[dict[str, Any]], bool] | None = None,
    ) -> tuple[list[dict[str, Any]], int]:
        """Return the summaries of runs, newest first, and how many match in all.

        Args:
            limit: largest number of summaries.
            offset: number of newer runs to skip.
            cursor: only runs older than the one with this id, which need no longer exist.
            where: only runs for whose summary this is true.
        """
        with self._lock:
            entries = [(id, self._entries[id].summary) for id in sorted(self._entries, reverse=True)]
        matching = [(id, summary) for id, summary in entries if where is None or where(summary)]
        older = [summary for id, summary in matching if not cursor or id < cursor]
        return older[offset : offset + limit], len(matching)

    @property
    def size(self) -> tuple[int, int]:
        """Number of stored runs, and their bytes."""
        with self._lock:
            return len(self._entries), sum(entry.size for entry in self._entries.values())

    def request(self, id: str) -> bytes | None:
        """Return the request as it was sent, or None if there is no such run."""
        return self._read(id, REQUEST)

    def document(self, id: str) -> bytes | None:
        """Return the response as JSON, or None if there is no such run."""
        return self._read(id, DOCUMENT)

    def _read(self, id: str, name: str) -> bytes | None:
        return _content(self._root / id / name) if id in self._entries else None

    def load(self, id: str) -> Run | None:
        """Return a run with its surface and iterates, or None if there is no such run."""
        parts = [self._read(id, name) for name in (REQUEST, DOCUMENT, NETS)]
        if any(part is None for part in parts):
            return None
        request, document, nets = (part or b"" for part in parts)
        return unpack(orjson.loads(request), orjson.loads(document), nets)

    def motion(self, id: str) -> Motion | None:
        """Return the motion of a run, or None if there is no such run."""
        return motion_of(self._root.parent, id) if id in self._entries else None

    def recording(self, id: str) -> bytes | None:
        """Return the recording (.rrd) of a run, which is written at the first request; None if there is no such run.

        Raises:
            OSError: it can't be written.
        """
        content = self._read(id, RECORDING)
        if content is not None or id not in self:
            return content
        with self._recording:  # one at a time, so that several readers of a run write it only once
            content = self._read(id, RECORDING) or self._record(id)
        return content

    def _record(self, id: str) -> bytes | None:
        run = self.load(id)
        if run is None:
            return None
        temporary = self._root / f".rrd-{id}-{secrets.token_hex(4)}"
        try:
            write_recording(run, temporary)
            content = temporary.read_bytes()
            return content if self._keep(id, temporary, len(content)) else None
        finally:
            temporary.unlink(missing_ok=True)

    def _keep(self, id: str, recording: Path, size: int) -> bool:
        with self._lock:
            entry = self._entries.get(id)
            if entry is None:
                return False
            recording.replace(self._root / id / RECORDING)
            entry.size += size - entry.recording
            entry.recording = size
            removed = self._evict()
        _delete(removed)
        return True


def motion_of(data_dir: Path, id: str) -> Motion | None:
    """Return the motion of a run that is stored in a data directory, or None if there is none; change nothing there."""
    nets = _content(data_dir / RUNS / id / NETS)
    return None if nets is None else unpack_motion(nets)


def _content(file: Path) -> bytes | None:
    """Return what a file contains, or None if there is none; a file that was emptied is as good as none."""
    try:
        return file.read_bytes() or None
    except (FileNotFoundError, NotADirectoryError):
        return None


def _summary(directory: Path) -> dict[str, Any] | None:
    """Return the summary of a run, or None if there is none or it can't be read."""
    try:
        found: dict[str, Any] = orjson.loads((directory / SUMMARY).read_bytes())
    except FileNotFoundError:
        return None
    except (OSError, orjson.JSONDecodeError) as error:
        _log.warning("the run is not listed: its %s can't be read: %s", SUMMARY, error, extra={"run": directory.name})
        return None
    return found


def _sync(directory: Path) -> None:
    handle = os.open(directory, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def _size(directory: Path) -> int:
    return sum(file.stat().st_size for file in directory.iterdir())


def _delete(directories: list[Path]) -> None:
    for directory in directories:
        shutil.rmtree(directory, ignore_errors=True)
