"""The viser server inside the service: started with it, stopped with it, one session a connected client."""

import contextlib
import hmac
import secrets
from collections.abc import AsyncIterator, Collection, Iterator

import anyio
import anyio.to_thread
import rich
import viser
from fastapi import FastAPI
from viser import ClientHandle, _messages

from app.viewer.gateway import ADDRESS_HEADER, KEY_HEADER, Upstream
from app.viewer.session import Runs, Session


@contextlib.contextmanager
def _quiet_console() -> Iterator[None]:
    """Keep viser from announcing its inner port, which is not for people to open."""
    console = rich.get_console()
    before, console.quiet = console.quiet, True
    try:
        yield
    finally:
        console.quiet = before


class SceneHost:
    """A viser server on the loopback address with a session for each client.

    Args:
        runs: where sessions store runs.
    """

    def __init__(self, runs: Runs) -> None:
        self._runs = runs
        self.key = secrets.token_urlsafe(32)
        self.sessions: dict[int, Session] = {}
        with _quiet_console():
            self._server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
        # any client could otherwise ask viser to publish itself on the internet
        for message in (_messages.ShareUrlRequest, _messages.ShareUrlDisconnect):
            self._server._websock_server.unregister_handler(message)
        self._server.on_client_connect(self._open)
        self._server.on_client_disconnect(self._close)

    @property
    def port(self) -> int:
        """The port it listens on."""
        return self._server.get_port()

    def stop(self) -> None:
        """Close all sessions and stop listening."""
        for session in list(self.sessions.values()):
            session.close()
        self.sessions.clear()
        with _quiet_console():
            self._server.stop()

    async def _open(self, client: ClientHandle) -> None:
        connection = self._server._websock_server._live_connections.get(client.client_id)
        if connection is None:
            return
        request = connection.request
        headers = {} if request is None else request.headers
        if not hmac.compare_digest(headers.get(KEY_HEADER, "").encode(), self.key.encode()):
            await connection.close()  # not through the gateway, which checks origins
            return
        self.sessions[client.client_id] = Session(client, self._runs, headers.get(ADDRESS_HEADER, ""))

    async def _close(self, client: ClientHandle) -> None:
        session = self.sessions.pop(client.client_id, None)
        if session is not None:
            session.close()


@contextlib.asynccontextmanager
async def hosting(app: FastAPI, allowed_origins: Collection[str], runs: Runs) -> AsyncIterator[SceneHost]:
    """Run a viser server behind the gateway of `app` while the context lasts."""
    host = await anyio.to_thread.run_sync(SceneHost, runs)
    app.state.viewer_upstream = Upstream(port=host.port, key=host.key, allowed_origins=frozenset(allowed_origins))
    try:
        yield host
    finally:
        app.state.viewer_upstream = None
        with anyio.CancelScope(shield=True):  # the service may be stopping because it was cancelled
            await anyio.to_thread.run_sync(host.stop)
