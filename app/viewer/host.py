"""The viser server inside the service: started with it, stopped with it, one session a connected client."""

import asyncio
import contextlib
import hmac
import secrets
from collections.abc import AsyncIterator, Collection

import viser
from fastapi import FastAPI
from viser import ClientHandle, _messages

from app.viewer.gateway import KEY_HEADER, Upstream
from app.viewer.session import Runs, Session


class SceneHost:
    """A viser server on the loopback address with a session for each client.

    Args:
        runs: where sessions store runs.
    """

    def __init__(self, runs: Runs) -> None:
        self._runs = runs
        self.key = secrets.token_urlsafe(32)
        self.sessions: dict[int, Session] = {}
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
        self._server.stop()

    async def _open(self, client: ClientHandle) -> None:
        connection = self._server._websock_server._live_connections.get(client.client_id)
        if connection is None:
            return
        request = connection.request
        given = "" if request is None else request.headers.get(KEY_HEADER, "")
        if not hmac.compare_digest(given.encode(), self.key.encode()):  # not through the gateway, which checks origins
            await connection.close()
            return
        self.sessions[client.client_id] = Session(client, self._runs)

    async def _close(self, client: ClientHandle) -> None:
        session = self.sessions.pop(client.client_id, None)
        if session is not None:
            session.close()


@contextlib.asynccontextmanager
async def hosting(app: FastAPI, allowed_origins: Collection[str], runs: Runs) -> AsyncIterator[SceneHost]:
    """Run a viser server behind the gateway of `app` while the context lasts."""
    host = await asyncio.to_thread(SceneHost, runs)
    app.state.viewer_upstream = Upstream(port=host.port, key=host.key, allowed_origins=frozenset(allowed_origins))
    try:
        yield host
    finally:
        app.state.viewer_upstream = None
        await asyncio.to_thread(host.stop)
