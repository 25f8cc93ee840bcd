"""Serve the scene on the service's own port: its single page, and its websocket, which is relayed to the viser server.

viser listens only on the loopback address and does not check origins. The gateway is the only way to reach it, and
`app.http.access` refuses pages of other sites before a request gets to the gateway.
"""

import asyncio
import contextlib
import re
import secrets
from collections.abc import Callable
from dataclasses import dataclass
from html import escape
from urllib.parse import quote, urlencode

from fastapi import FastAPI, Request, Response, WebSocket
from starlette.responses import RedirectResponse
from starlette.websockets import WebSocketDisconnect
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import ConnectionClosed, InvalidHandshake
from websockets.typing import Subprotocol

from app.pages.gallery import examples
from app.schemas.base import ID
from app.viewer.client_page import client_page

CONTENT_SECURITY_POLICY = "; ".join(
    [
        "default-src 'self'",
        # the client creates the bindings of its WebAssembly modules by eval, even if they are not used
        "script-src 'self' 'unsafe-inline' 'unsafe-eval' blob:",
        "worker-src 'self' blob:",
        "style-src 'self' 'unsafe-inline'",
        "img-src 'self' data: blob:",
        "font-src 'self' data:",
        "connect-src 'self' data: blob:",
        "object-src 'none'",
        "base-uri 'none'",
        "frame-ancestors 'self'",
    ]
)
PAGE_HEADERS = {
    "Content-Security-Policy": CONTENT_SECURITY_POLICY,
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cache-Control": "no-cache",
}
TRY_AGAIN_LATER = 1013
GOING_AWAY = 1001


KEY_HEADER = "X-Scene-Key"
ADDRESS_HEADER = "X-Scene-Address"
BEGIN_HEADER = "X-Scene-Begin"
TAB_HEADER = "X-Scene-Tab"
PLAIN = "new"  # stands in an address for the name of a ready scene if there is none
RUN = "run-"  # prefix of the id of a stored run in an address
_HOST = re.compile(r"[A-Za-z0-9.\-_]+(:[0-9]{1,5})?|\[[0-9a-fA-F:.]+\](:[0-9]{1,5})?")


@dataclass(frozen=True, kw_only=True)
class Upstream:
    """The viser server behind the gateway.

    Attributes:
        port: port on which it listens on the loopback address.
        key: proves to it that a connection came through the gateway.
        open_scenes: returns the number of open scenes.
        most_scenes: largest allowed number of open scenes.
        era: prefix of the names of its tabs. It changes with every restart, so that older tabs can be recognised.
        has_run: returns whether a run is stored.
    """

    port: int
    key: str
    open_scenes: Callable[[], int]
    most_scenes: int
    era: str
    has_run: Callable[[str], bool]

    @property
    def is_full(self) -> bool:
        """Whether no further scene may be opened."""
        return self.open_scenes() >= self.most_scenes


def address(socket: WebSocket) -> str:
    """Return the service's address as the client sees it, e.g. ``http://127.0.0.1:8000``; "" if it is malformed."""
    host = socket.headers.get("host", "")
    scheme = "https" if socket.url.scheme == "wss" else "http"
    return f"{scheme}://{host}" if _HOST.fullmatch(host) else ""


def add_gateway(app: FastAPI) -> None:
    """Add `GET /scene/` and the websocket `/scene`, each alone and followed by the names of a scene and a tab.

    The client derives the address of its websocket from the path of its page, without the query. So the path contains
    the name of the scene (a ready scene or a run), and a name of the tab, by which a page that reloads or reconnects
    finds its scene again. `/scene/`, `?example=` and `?run=` redirect to such a path. The pages say so if there is no
    viser server, if no further scene may be opened, or if a run is gone.
    """
    client = client_page()

    def found(request: Request, name: str) -> Upstream | Response:
        """Return the server that shows a scene, or a page that says why none does."""
        upstream = _upstream(request.app)
        if not _named(name):
            return _unknown()
        if upstream is None:
            return _notice("The scene is not running", "The service is stopping, or has not started yet.", 503)
        if upstream.is_full:
            words = "This service allows no more open scenes. Close another tab, or try again later."
            return _notice("All scenes are taken", words, 503)
        return upstream

    def new_tab(request: Request, name: str, query: dict[str, str]) -> Response:
        upstream = found(request, name)
        if isinstance(upstream, Response):
            return upstream
        if name.startswith(RUN) and not upstream.has_run(name.removeprefix(RUN)):
            return _gone()
        path = f"/scene/{name}/{upstream.era}{secrets.token_urlsafe(12)}/"
        return RedirectResponse(path + (f"?{urlencode(query)}" if query else ""))

    @app.get("/scene/", include_in_schema=False)
    async def scene_page(request: Request) -> Response:
        query = dict(request.query_params)
        name, run = query.pop("example", PLAIN), query.pop("run", None)
        if run is not None and not ID.fullmatch(run):
            return _gone()
        return new_tab(request, name if run is None else f"{RUN}{run}", query)

    @app.get("/scene/{name}/", include_in_schema=False)
    async def example_page(name: str, request: Request) -> Response:
        return new_tab(request, name, dict(request.query_params))

    @app.get("/scene/{name}/{tab}/", include_in_schema=False)
    async def tab_page(name: str, tab: str, request: Request) -> Response:
        upstream = found(request, name)
        page = Response(client, media_type="text/html; charset=utf-8", headers=PAGE_HEADERS)
        return upstream if isinstance(upstream, Response) else page

    @app.websocket("/scene")
    async def scene_socket(socket: WebSocket) -> None:
        await serve(socket, PLAIN, "")

    @app.websocket("/scene/{name}/{tab}")
    async def tab_socket(socket: WebSocket, name: str, tab: str) -> None:
        await serve(socket, name, tab)

    async def serve(socket: WebSocket, name: str, tab: str) -> None:
        upstream = _upstream(socket.app)
        if upstream is None or upstream.is_full or not _named(name):
            await socket.close(TRY_AGAIN_LATER)
            return
        await _pass_on(socket, upstream, {BEGIN_HEADER: name, TAB_HEADER: quote(tab)})


def _named(name: str) -> bool:
    """Return whether a scene can have this name."""
    return name == PLAIN or name in examples() or bool(name.startswith(RUN) and ID.fullmatch(name.removeprefix(RUN)))


def _gone() -> Response:
    return _notice(
        "There is no such run", "It was deleted, was removed to make room for newer runs, or never existed.", 404
    )


def _unknown() -> Response:
    return _notice("There is no such scene", f"The ready scenes are: {', '.join(examples())}.", 404)


def _notice(title: str, words: str, status: int) -> Response:
    """Return a page that says why there is no scene."""
    text = (
        '<!doctype html><html lang="en"><meta charset="utf-8"><meta name="color-scheme" content="light dark">'
        f"<title>{escape(title)}</title><body style='font: 1rem/1.5 system-ui; max-width: 32rem; margin: 4rem auto; "
        f"padding: 0 1rem'><h1 style='font-size: 1.3rem'>{escape(title)}</h1><p>{escape(words)}</p>"
        "<p><a href='/scene/'>Open the scene</a> · <a href='/' target='_top'>Start page</a></p></body></html>"
    )
    return Response(text, status_code=status, media_type="text/html; charset=utf-8", headers=PAGE_HEADERS)


def _upstream(app: FastAPI) -> Upstream | None:
    return getattr(app.state, "viewer_upstream", None)


async def _pass_on(socket: WebSocket, upstream: Upstream, asked: dict[str, str]) -> None:
    """Relay `socket` to the viser server until either side closes; the headers `asked` name the scene."""
    protocols = [Subprotocol(name) for name in socket.scope.get("subprotocols", [])]
    try:
        inner = await connect(
            f"ws://127.0.0.1:{upstream.port}",
            subprotocols=protocols or None,
            additional_headers={KEY_HEADER: upstream.key, ADDRESS_HEADER: address(socket), **asked},
            compression=None,
            max_size=None,
            proxy=None,
        )
    except (OSError, InvalidHandshake):
        await socket.close(TRY_AGAIN_LATER)
        return
    try:
        await socket.accept(subprotocol=inner.subprotocol)
        directions = {asyncio.create_task(_inwards(socket, inner)), asyncio.create_task(_outwards(inner, socket))}
        try:
            await asyncio.wait(directions, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in directions:
                task.cancel()
            await asyncio.gather(*directions, return_exceptions=True)
    finally:
        await inner.close()
        with contextlib.suppress(RuntimeError, WebSocketDisconnect):
            await socket.close(GOING_AWAY)


async def _inwards(socket: WebSocket, inner: ClientConnection) -> None:
    with contextlib.suppress(ConnectionClosed, WebSocketDisconnect):
        while True:
            message = await socket.receive()
            if message["type"] == "websocket.disconnect":
                return
            data = message.get("bytes")
            await inner.send(message["text"] if data is None else data)


async def _outwards(inner: ClientConnection, socket: WebSocket) -> None:
    with contextlib.suppress(ConnectionClosed, WebSocketDisconnect, RuntimeError):
        async for message in inner:
            if isinstance(message, bytes):
                await socket.send_bytes(message)
            else:
                await socket.send_text(message)
