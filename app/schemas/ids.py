"""Ids of runs, studies and calibrations; an id contains the time of its request."""

import secrets
import time
from datetime import UTC, datetime

from app.schemas.base import ID


def new_id() -> str:
    """Return an id that sorts by time (12 hex digits of milliseconds) and can't be guessed (64 random bits)."""
    return f"{time.time_ns() // 1_000_000:012x}{secrets.token_hex(8)}"


def created_of(id: str) -> str:
    """Return when an id was made, ISO 8601 in UTC; the present time if it is no id, as for what is not kept."""
    created = datetime.fromtimestamp(int(id[:12], 16) / 1e3, UTC) if ID.fullmatch(id) else datetime.now(UTC)
    return created.isoformat(timespec="milliseconds").replace("+00:00", "Z")
