"""The landing page and its files, at every address without another route; and redirects to addresses with a slash."""

import os

from fastapi import FastAPI, Request
from fastapi.staticfiles import StaticFiles
from starlette.datastructures import Headers
from starlette.exceptions import HTTPException
from starlette.responses import RedirectResponse, Response
from starlette.routing import Match, Mount
from starlette.types import Scope

from app.http.formats import HTML, JSON, prefers
from app.http.problems import API
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
    """The files, with a content security policy that is stricter than what the API's documentation needs.

    If there is no such file, a browser gets ``404.html``, and a client that does not prefer HTML a problem document.
    """

    async def get_response(self, path: str, scope: Scope) -> Response:
        response = await super().get_response(path, scope)
        if response.status_code == 404:
            vary = {"Vary": "Accept"}
            if not prefers(Headers(scope=scope).get("accept"), HTML, JSON):
                raise HTTPException(404, headers=vary)
            response.headers.update(vary)
        return response

    def file_response(
        self, full_path: str | os.PathLike[str], stat_result: os.stat_result, scope: Scope, status_code: int = 200
    ) -> Response:
        response = super().file_response(full_path, stat_result, scope, status_code)
        response.headers["Content-Security-Policy"] = POLICY
        response.headers["Cache-Control"] = "no-cache"  # revalidated by tag: files of two versions don't mix
        return response


class _Pages(Mount):
    """A mount at / that leaves the API's addresses alone, so that a wrong method there is answered with 405."""

    def matches(self, scope: Scope) -> tuple[Match, Scope]:
        if scope["type"] != "http" or scope["path"].startswith(API):
            return Match.NONE, {}
        return super().matches(scope)


async def _with_slash(request: Request) -> Response:
    """Redirect to the address with a slash, which the relative links of the scene's page need."""
    query = request.url.query
    return RedirectResponse(f"{request.url.path}/" + (f"?{query}" if query else ""), 307)


def add_pages(app: FastAPI) -> None:
    """Serve the pages at /; call this after all other routes are added."""
    for path in ("/scene", "/scene/{name}"):
        app.get(path, include_in_schema=False)(_with_slash)
    app.router.routes.append(_Pages("/", _Files(directory=static_dir(), html=True, check_dir=False), name="pages"))
