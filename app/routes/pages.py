"""The landing page and its files, at every address that nothing else answers."""

import os

from fastapi import FastAPI
from fastapi.staticfiles import StaticFiles
from starlette.responses import Response
from starlette.routing import Match, Mount
from starlette.types import Scope

from app.pages.assets import static_dir

POLICY = "; ".join(
    [
        "default-src 'none'",
        "script-src 'self'",
        "style-src 'self'",
        "img-src 'self'",
        "connect-src 'self'",
        "frame-src 'self'",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'self'",
    ]
)


class _Files(StaticFiles):
    """The files with a content security policy of their own, stricter than what the API's documentation needs."""

    def file_response(
        self, full_path: str | os.PathLike[str], stat_result: os.stat_result, scope: Scope, status_code: int = 200
    ) -> Response:
        response = super().file_response(full_path, stat_result, scope, status_code)
        response.headers["Content-Security-Policy"] = POLICY
        response.headers["Cache-Control"] = "no-cache"  # asked anew by its tag: parts of two versions don't mix
        return response


class _Pages(Mount):
    """A mount at / that leaves the API's addresses alone, so that a wrong method there is answered with 405."""

    def matches(self, scope: Scope) -> tuple[Match, Scope]:
        if scope["type"] != "http" or scope["path"].startswith("/v1/"):
            return Match.NONE, {}
        return super().matches(scope)


def add_pages(app: FastAPI) -> None:
    """Serve the pages at /; to be called after every other route is there."""
    app.router.routes.append(_Pages("/", _Files(directory=static_dir(), html=True, check_dir=False), name="pages"))
