"""The interactive 3D scene under `/scene/`: a viser server inside the service, behind its one port."""

import contextlib
from collections.abc import AsyncIterator

from fastapi import FastAPI

from app.service.service import Service
from app.viewer.gateway import add_gateway
from app.viewer.host import SceneHost, hosting


def add_routes(app: FastAPI) -> None:
    """Add the page and the websocket of the scene; they serve it once `running` has started it."""
    add_gateway(app)


@contextlib.asynccontextmanager
async def running(app: FastAPI, service: Service) -> AsyncIterator[SceneHost]:
    """Run the scene while the context lasts. For the application's lifespan."""
    async with hosting(app, service) as host:
        yield host


__all__ = ["add_routes", "running"]
