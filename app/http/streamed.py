"""A response that is written piece by piece until it ends or the client disconnects."""

from collections.abc import Awaitable, Callable, Mapping

import anyio
from starlette.responses import Response
from starlette.types import Receive, Scope, Send

Emit = Callable[[bytes], Awaitable[None]]


class Streamed(Response):
    """Send what `produce` emits; cancel it as soon as the client closes the connection.

    Unlike an iterator, `produce` may own tasks and places in a queue, because it always ends before the response does.

    Args:
        produce: called with the function that sends a piece.
        media_type: media type of the response.
        headers: response headers.
    """

    def __init__(
        self, produce: Callable[[Emit], Awaitable[None]], media_type: str, headers: Mapping[str, str] | None = None
    ) -> None:
        self._produce = produce
        self.status_code = 200
        self.media_type = media_type
        self.background = None
        self.init_headers(headers)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Send the response."""

        async def emit(piece: bytes) -> None:
            await send({"type": "http.response.body", "body": piece, "more_body": True})

        async with anyio.create_task_group() as tasks:

            async def watch() -> None:
                while (await receive())["type"] != "http.disconnect":
                    pass
                tasks.cancel_scope.cancel()

            tasks.start_soon(watch)
            await send({"type": "http.response.start", "status": self.status_code, "headers": self.raw_headers})
            await self._produce(emit)
            await send({"type": "http.response.body", "body": b"", "more_body": False})
            tasks.cancel_scope.cancel()
