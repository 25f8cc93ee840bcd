"""The interactive 3D scene under `/scene/`: a viser server inside the service, behind its one port."""

import contextlib
from collections.abc import AsyncIterator

from fastapi import FastAPI

from app.settings import Settings
from app.viewer.gateway import add_gateway
from app.viewer.host import SceneHost, hosting
from app.viewer.session import Runs


def add_routes(app: FastAPI) -> None:
    """Add the page and the websocket of the scene; they wait until `running` has started it."""
    add_gateway(app)


@contextlib.asynccontextmanager
async def running(app: FastAPI, settings: Settings, runs: Runs) -> AsyncIterator[SceneHost]:
    """Run the scene while the context lasts; for the application's lifespan."""
    async with hosting(app, settings.allowed_origins, runs) as host:
        yield host


__all__ = ["add_routes", "running"]
