"""The landing page and its files, at every address that nothing else answers."""

from fastapi import FastAPI
from fastapi.staticfiles import StaticFiles
from starlette.routing import Match, Mount
from starlette.types import Scope

from app.assets import static_dir


class _Pages(Mount):
    """A mount at / that leaves the API's addresses alone, so that a wrong method there is answered with 405."""

    def matches(self, scope: Scope) -> tuple[Match, Scope]:
        if scope["type"] != "http" or scope["path"].startswith("/v1/"):
            return Match.NONE, {}
        return super().matches(scope)


def add_pages(app: FastAPI) -> None:
    """Serve the pages at /; to be called after every other route is there."""
    app.router.routes.append(_Pages("/", StaticFiles(directory=static_dir(), html=True, check_dir=False), name="pages"))
