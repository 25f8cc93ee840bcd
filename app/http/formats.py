"""Content negotiation (RFC 9110, 12.5.1), and the forms of a prediction: JSON, .npz, MessagePack."""

from collections.abc import Callable, Sequence
from typing import Any

import anyio.to_thread
import msgpack
import orjson
from fastapi import Response

from app.archive import surface_npz
from app.http.problems import ProblemError
from dlocore import MaterialMotion

JSON = "application/json"
HTML = "text/html"
NPZ = "application/x-npz"
MSGPACK = "application/vnd.msgpack"
EVENTS = "text/event-stream"
LINES = "application/jsonl"

# other names under which clients request a form
_SYNONYMS = {
    MSGPACK: (MSGPACK, "application/msgpack", "application/x-msgpack"),
    LINES: (LINES, "application/x-ndjson", "application/x-jsonlines", "application/jsonlines"),
}
FORMS = (JSON, NPZ, MSGPACK)


def negotiated(accept: str | None, offers: Sequence[str]) -> str:
    """Return which of `offers` an ``Accept`` header ranks highest; of equals, the first.

    Args:
        accept: the header; if it is absent or empty, anything is accepted.
        offers: media types, the preferred one first.

    Raises:
        ProblemError: 406, none of them is accepted.
    """
    ranges = _ranges(accept or "*/*")
    ranked = [(max(_quality(name, ranges) for name in _SYNONYMS.get(offer, (offer,))), offer) for offer in offers]
    best = max(quality for quality, _ in ranked)
    if not best > 0.0:
        detail = f"This address answers with {', '.join(offers)}; the request accepts {(accept or '')[:120]!r}."
        raise ProblemError(406, "not-acceptable", detail)
    return next(offer for quality, offer in ranked if quality == best)


def prefers(accept: str | None, form: str, other: str) -> bool:
    """Return whether an ``Accept`` header ranks `form` above `other`; one that is absent or empty ranks neither."""
    ranges = _ranges(accept or "*/*")
    return _quality(form, ranges) > _quality(other, ranges)


def _ranges(accept: str) -> dict[str, float]:
    """Return the quality of each media range; parameters other than ``q`` make no difference to our forms."""
    ranges: dict[str, float] = {}
    for part in accept.lower().split(","):
        media, *parameters = (word.strip() for word in part.split(";"))
        given = next((p[2:] for p in parameters if p.startswith("q=")), "1")
        try:
            quality = float(given)
        except ValueError:
            quality = 0.0
        ranges[media] = max(ranges.get(media, 0.0), quality if 0.0 <= quality <= 1.0 else 0.0)
    return ranges


def _quality(media: str, ranges: dict[str, float]) -> float:
    """Return the quality that the most specific range gives to a media type."""
    kind = media.split("/")[0]
    return next((ranges[name] for name in (media, f"{kind}/*", "*/*") if name in ranges), 0.0)


def as_msgpack(document: bytes) -> bytes:
    """Return a JSON document as MessagePack with the same names and nesting; all numbers of a surface are float64."""
    packed: bytes = msgpack.packb(orjson.loads(document))
    return packed


def as_npz(document: bytes, material: MaterialMotion | None) -> bytes:
    """Return the arrays of a prediction's JSON document, and of its material, as .npz."""
    return surface_npz(orjson.loads(document), material)


def json_response(document: Any, status: int = 200) -> Response:
    """Return a document as a JSON response."""
    return Response(orjson.dumps(document), status, media_type=JSON)


async def prediction_response(
    document: bytes, form: str, material: Callable[[], MaterialMotion | None], status: int = 200
) -> Response:
    """Return a prediction as a response of the media type `form`, one of `FORMS`.

    Args:
        document: the prediction as a JSON document.
        form: the media type.
        material: finds what the sections of the cable remember; called in a thread if the form contains it.
        status: status of the response.
    """

    def encoded() -> bytes:
        return as_npz(document, material()) if form == NPZ else as_msgpack(document)

    content = document if form == JSON else await anyio.to_thread.run_sync(encoded)
    return Response(content, status, {"Vary": "Accept"}, form)
