"""The application: ``uvicorn app.main:app``, or ``dlo serve``."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from fastapi import Depends, FastAPI
from fastapi_offline import FastAPIOffline

from app import viewer
from app.http import openapi, problems
from app.http.access import Access, AllowedSites, OtherSites
from app.http.middleware import AccessLog, BodyLimit, Heads, PageHeaders
from app.http.query import check_query
from app.routes import (
    batch,
    cables,
    calibration,
    examples,
    files,
    health,
    identify,
    pages,
    predictions,
    rerun,
    scenes,
    shapes,
    studies,
)
from app.service.service import Service
from app.settings import Settings
from dlocore.machine import program_version

_ABOUT = """Predict how a cable moves when grippers move it: post a scene, get the whole motion as one bivariate spline.

All quantities are in SI units: metres, seconds, radians, newtons, kilograms. The world frame is right-handed, z up.
Errors are `application/problem+json` (RFC 9457); those of a request name the fields that are wrong."""


def create_app(settings: Settings | None = None) -> FastAPI:
    """Return the application with its middleware and routes.

    Args:
        settings: the settings; absent: those of the environment.
    """
    settings = settings or Settings()

    @asynccontextmanager
    async def lifespan(app: FastAPI) -> AsyncIterator[None]:
        service = Service.of(settings)
        app.state.service = service
        async with viewer.running(app, service), service.running():
            yield

    app = FastAPIOffline(
        title="dlo",
        version=program_version(),
        description=_ABOUT,
        lifespan=lifespan,
        redoc_url=None,
        generate_unique_id_function=openapi.operation_id,
    )
    app.state.settings = settings
    problems.install(app)
    openapi.install(app)
    app.add_middleware(Heads)
    app.add_middleware(BodyLimit, limit=settings.max_body_bytes)
    if settings.token is not None:
        app.add_middleware(Access, token=settings.token.get_secret_value())
    app.add_middleware(OtherSites, settings=settings)
    app.add_middleware(PageHeaders)
    if settings.allowed_origins:  # outside the token check: a browser's preflight request has no token
        app.add_middleware(AllowedSites, origins=settings.allowed_origins)
    app.add_middleware(AccessLog)
    for routes in (batch, predictions, files, scenes, examples, shapes, cables, calibration, studies, identify):
        app.include_router(routes.router, dependencies=[Depends(check_query)])
    for routes in (health, rerun):
        app.include_router(routes.router)
    viewer.add_routes(app)
    pages.add_pages(app)
    return app


app = create_app()
