"""The viser server inside the service: it starts and stops with the service and has one session for each client."""

import asyncio
import contextlib
import hmac
import secrets
from collections.abc import AsyncIterator

import anyio
import anyio.to_thread
import viser
from fastapi import FastAPI
from viser import ClientHandle, _messages

from app.service.service import Service
from app.store.cables import KeptCables
from app.viewer.draft import Draft
from app.viewer.gateway import ADDRESS_HEADER, BEGIN_HEADER, KEY_HEADER, RUN, TAB_HEADER, Upstream
from app.viewer.quiet import quiet_console
from app.viewer.session import Session, Shared, Work, of_example, of_run
from app.viewer.solver import ServiceSolver

MOST_LEFT = 64  # most closed tabs whose scenes are kept


class SceneHost:
    """A viser server on the loopback address with a session for each client.

    Args:
        shared: what all sessions share.
        most: largest number of sessions that may be open at once.
    """

    def __init__(self, shared: Shared, most: int) -> None:
        self._shared = shared
        self._most = most
        self.key = secrets.token_urlsafe(32)
        self.era = secrets.token_hex(4)
        self.sessions: dict[int, Session] = {}
        self._left: dict[str, Work] = {}  # work of closed tabs by their names, the newest last
        with quiet_console():
            self._server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
        # otherwise any client could have viser publish itself on the internet
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
        with quiet_console():
            self._server.stop()

    async def _open(self, client: ClientHandle) -> None:
        live = self._server._websock_server._live_connections
        connection = live.get(client.client_id)
        if connection is None:
            return
        request = connection.request
        headers = {} if request is None else request.headers
        if not hmac.compare_digest(headers.get(KEY_HEADER, "").encode(), self.key.encode()):
            await connection.close()  # it did not come through the gateway, which is protected by a check of origins
            return
        tab = headers.get(TAB_HEADER, "")
        work, lost = self._found(tab), None
        if work is None:
            name = headers.get(BEGIN_HEADER, "")
            draft = await self._begin(name)
            work = Work.begun(draft)
            if draft is None and name.startswith(RUN):
                lost = (
                    "The run can't be opened",
                    "It was deleted, or the run that it continues was deleted. Here is the paper's case.",
                )
            elif tab and not tab.startswith(self.era):
                lost = ("The service was restarted", "This scene starts from the beginning; earlier edits are lost.")
        # the client may have left while the scene was read, or others may have taken the last places
        if client.client_id not in live or len(self.sessions) >= self._most:
            await connection.close()
            return
        self._left.pop(tab, None)
        self.sessions[client.client_id] = Session(client, self._shared, headers.get(ADDRESS_HEADER, ""), tab, work)
        if lost is not None:
            client.add_notification(*lost, color="yellow")

    async def _begin(self, name: str) -> Draft | None:
        """Return the scene with which a tab begins, by the name in its address."""
        if name.startswith(RUN):
            return await asyncio.to_thread(of_run, name.removeprefix(RUN), self._shared.runs)
        return of_example(name)

    def _found(self, tab: str) -> Work | None:
        """Return the earlier work of a tab that was reloaded or duplicated; None if there is none."""
        for session in self.sessions.values():
            if tab and session.tab == tab:
                return session.work()
        return self._left.get(tab)

    async def _close(self, client: ClientHandle) -> None:
        session = self.sessions.pop(client.client_id, None)
        if session is not None:
            session.close()
            if session.tab:
                self._left.pop(session.tab, None)
                self._left[session.tab] = session.work()
                for oldest in list(self._left)[:-MOST_LEFT]:
                    del self._left[oldest]


@contextlib.asynccontextmanager
async def hosting(app: FastAPI, service: Service) -> AsyncIterator[SceneHost]:
    """Run a viser server behind the gateway of `app` while the context lasts."""
    settings = service.settings
    solver = ServiceSolver(service, asyncio.get_running_loop())
    shared = Shared(service.runs, solver, KeptCables(settings.data_dir))
    host = await anyio.to_thread.run_sync(SceneHost, shared, settings.max_scenes)
    app.state.viewer_upstream = Upstream(
        port=host.port,
        key=host.key,
        open_scenes=lambda: len(host.sessions),
        most_scenes=settings.max_scenes,
        era=host.era,
        has_run=service.runs.__contains__,
    )
    try:
        yield host
    finally:
        app.state.viewer_upstream = None
        with anyio.CancelScope(shield=True):  # the service may be stopping because it was cancelled
            await anyio.to_thread.run_sync(host.stop)
