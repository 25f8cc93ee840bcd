"""Ids of runs, studies and calibrations, which tell when these were asked for."""

import secrets
import time
from datetime import UTC, datetime

from app.schemas.base import ID


def new_id() -> str:
    """Return an id that sorts by time (12 hex digits of milliseconds) and can't be guessed (64 random bits)."""
    return f"{time.time_ns() // 1_000_000:012x}{secrets.token_hex(8)}"


def created_of(id: str) -> str:
    """Return when an id was given, ISO 8601 in UTC; now where it is none, as of what is not kept."""
    created = datetime.fromtimestamp(int(id[:12], 16) / 1e3, UTC) if ID.fullmatch(id) else datetime.now(UTC)
    return created.isoformat(timespec="milliseconds").replace("+00:00", "Z")
