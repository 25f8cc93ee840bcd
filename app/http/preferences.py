"""The ``Prefer`` header (RFC 7240): what a client prefers, where the service leaves a choice."""

import re
from dataclasses import dataclass

_PREFERENCE = re.compile(r"\s*([!#$%&'*+.^_`|~0-9a-z-]+)\s*(?:=\s*\"?([^\";,]*)\"?)?[^,]*")
LONGEST_WAIT = 3600.0  # s


@dataclass(frozen=True)
class Preferences:
    """What a client prefers.

    Attributes:
        respond_async: answer before the solve is done.
        wait: how long to wait for the solve first [s].
        applied: the preferences that were understood, for ``Preference-Applied``.
    """

    respond_async: bool = False
    wait: float = 0.0
    applied: str = ""


def preferences(header: str | None) -> Preferences:
    """Return what a ``Prefer`` header says; all but ``respond-async`` and ``wait`` is ignored."""
    found: dict[str, str] = {}
    for part in (header or "").lower().split(","):
        match = _PREFERENCE.match(part)
        if match:
            found.setdefault(match[1], (match[2] or "").strip())  # the first one counts
    if "respond-async" not in found:
        return Preferences()
    wait = found.get("wait", "")
    if not (wait.isascii() and wait.isdigit()):
        return Preferences(respond_async=True, applied="respond-async")
    seconds = min(float(wait), LONGEST_WAIT)
    return Preferences(respond_async=True, wait=seconds, applied=f"respond-async, wait={seconds:.0f}")
