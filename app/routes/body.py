"""JSON request bodies: check the content type and that each name comes once, and keep NaN for the schema to refuse."""

import asyncio
import json
import re
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import asynccontextmanager
from typing import Any

import anyio.to_thread
import orjson
from fastapi import Request, Response
from fastapi.routing import APIRoute
from pydantic import BaseModel

from app.http.problems import ProblemError
from app.schemas.base import MAX_NAMES

_SMALL = 100_000  # bytes of a body that is parsed within a millisecond or two; a larger one is parsed in a thread
_BUT_BRACES = bytes(set(range(256)) - set(b"{}"))


class JsonRequest(Request):
    """A request whose body is strict JSON."""

    async def json(self) -> Any:
        """Return the body as data; NaN and infinities stay in it, so that the schema can refuse them by field."""
        body = await self.body()
        return _parsed(body) if len(body) <= _SMALL else await anyio.to_thread.run_sync(_parsed, body)


def _parsed(body: bytes) -> Any:
    """Return the data of a body; raise JSONDecodeError if it is not strict JSON or is nested too deep."""
    try:
        data = orjson.loads(body)
    except orjson.JSONDecodeError as error:
        try:
            data = json.loads(body.decode())  # text, because json.loads also takes bytes in UTF-16
        except (ValueError, RecursionError):
            raise error from None
    _check_names(body)
    return data


def _check_names(body: bytes) -> None:
    """Raise JSONDecodeError if an object has a name twice (a parser would take the last), or too many names.

    The numbers of long lists are skipped as a whole, which takes a fifteenth of the time of a parser's hook.
    """
    objects: list[set[bytes]] = []  # the names in each open object
    pieces = re.sub(rb"\\.", b"__", body).split(b'"')  # every second piece is a text; no field's name has an escape
    for i, piece in enumerate(pieces[::2]):
        if i and piece.lstrip().startswith(b":"):
            name = pieces[2 * i - 1]
            is_twice = name in objects[-1]
            if is_twice or len(objects[-1]) == MAX_NAMES:
                text, before = (part.decode(errors="replace") for part in (body, b'"'.join(pieces[: 2 * i - 1])))
                shown = name.decode(errors="replace")
                what = f'"{shown}" appears twice in one object' if is_twice else "an object has too many names"
                raise json.JSONDecodeError(what, text, len(before))
            objects[-1].add(name)
        for brace in piece.translate(None, _BUT_BRACES):
            if brace == ord("{"):
                objects.append(set())
            else:
                objects.pop()


class JsonRoute(APIRoute):
    """A route that takes JSON only."""

    @property
    def body_model(self) -> type[BaseModel] | None:
        """The model of the body, for messages about a body that doesn't match it."""
        model = None if self.body_field is None else self.body_field.field_info.annotation
        return model if isinstance(model, type) and issubclass(model, BaseModel) else None

    def get_route_handler(self) -> Callable[[Request], Coroutine[Any, Any, Response]]:
        """Return the handler, preceded by the checks."""
        handle = super().get_route_handler()
        takes_body = self.body_field is not None

        async def checked(request: Request) -> Response:
            if takes_body:
                check_content(request)
            return await handle(JsonRequest(request.scope, request.receive))

        return checked


def check_content(request: Request) -> None:
    """Raise a 415 problem unless the body is declared as JSON in UTF-8 without a content encoding."""
    given = request.headers.get("content-type", "")
    media, *parameters = (part.strip().lower() for part in given.split(";"))
    if media != "application/json" and not (media.startswith("application/") and media.endswith("+json")):
        raise ProblemError(
            415, "unsupported-media-type", f"Send the body as application/json, not as {given or 'nothing'!r}."
        )
    charsets = [text.removeprefix("charset=").strip('"') for text in parameters if text.startswith("charset=")]
    for charset in charsets:
        if charset != "utf-8":
            detail = f"Send the body in the charset utf-8, as JSON requires, not in {charset[:120]!r}."
            raise ProblemError(415, "unsupported-media-type", detail)
    encoding = request.headers.get("content-encoding", "identity")
    if encoding.strip().lower() not in ("", "identity"):
        detail = f"Send the body uncompressed, not in the encoding {encoding[:120]!r}: no encoding is accepted."
        raise ProblemError(415, "unsupported-content-encoding", detail, headers={"Accept-Encoding": "identity"})


@asynccontextmanager
async def calling_when_gone(request: Request, call: Callable[[], None]) -> AsyncIterator[None]:
    """Call back if, inside the context, the client closes the connection or the server abandons the request.

    The body must have been read.
    """

    async def watch() -> None:
        while (await request.receive())["type"] != "http.disconnect":
            pass
        call()

    watcher = asyncio.create_task(watch())
    try:
        yield
    except BaseException:
        call()
        raise
    finally:
        watcher.cancel()
