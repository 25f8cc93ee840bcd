"""Failures as ``application/problem+json`` (RFC 9457), for every way a request can fail."""

import logging
from collections.abc import Mapping
from http import HTTPMethod, HTTPStatus
from typing import Any

import orjson
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import Response
from starlette.exceptions import HTTPException
from starlette.routing import Match, Mount

from app.http.fields import BadField, bad_fields
from app.schemas.request import PredictionRequest
from dlocore import SceneError

MEDIA_TYPE = "application/problem+json"
API = "/v1/"  # prefix of the addresses of the API
_log = logging.getLogger("dlo")

_DEFECT = "The service failed; this is a defect. Its log says where."
_DETAILS = {
    404: "There is nothing at this address.",
    405: "This address exists, but not for this method.",
}


class ProblemError(Exception):
    """A failure that is answered with a problem document.

    Args:
        status: HTTP status.
        kind: short name, the end of the problem's type URN.
        detail: what went wrong and what to do, in words.
        headers: response headers.
        extra: further members of the document.
    """

    def __init__(
        self, status: int, kind: str, detail: str, *, headers: Mapping[str, str] | None = None, **extra: Any
    ) -> None:
        super().__init__(detail)
        self.status = status
        self.kind = kind
        self.detail = detail
        self.headers = dict(headers or {})
        self.extra = extra


def no_such_run(id: str, field: str = "") -> ProblemError:
    """Return the problem of an id without a run (any more); `field`: where it was given, if not in the address."""
    place = f"{field}: " if field else ""
    return ProblemError(404, "no-such-run", f"{place}There is no run {id[:64]!r}; it may have been removed.")


def phrase_of(status: int) -> str:
    """Return the phrase of a status as in RFC 9110; Python before 3.13 has older ones."""
    return {413: "Content Too Large", 422: "Unprocessable Content"}.get(status, HTTPStatus(status).phrase)


def document_of(problem: ProblemError) -> dict[str, Any]:
    """Return the document of a problem."""
    return {
        "type": f"urn:dlo:problem:{problem.kind}",
        "title": phrase_of(problem.status),
        "status": problem.status,
        "detail": problem.detail,
        **problem.extra,
    }


def problem_response(problem: ProblemError) -> Response:
    """Return the problem as an HTTP response."""
    return Response(orjson.dumps(document_of(problem)), problem.status, problem.headers, MEDIA_TYPE)


def problem_of(error: Exception) -> ProblemError:
    """Return the problem to report for an error of a solve; an error not caused by input is reported as a defect."""
    if isinstance(error, ProblemError):
        return error
    if isinstance(error, SceneError):
        return bad_scene([BadField.from_scene_error(error)])
    return ProblemError(500, "internal-error", _DEFECT)


def not_written(what: str, error: OSError) -> ProblemError:
    """Return the problem that `what` can't be written, for example on a full disk."""
    return ProblemError(507, "not-written", f"{what} can't be written: {error.strerror or error}.")


def bad_scene(fields: list[BadField]) -> ProblemError:
    """Return the problem of a request whose `fields` are wrong."""
    first = f"{fields[0].field}: {fields[0].message}"
    more = f" (and {len(fields) - 1} more)" if len(fields) > 1 else ""
    return ProblemError(422, "bad-request", first + more, errors=[vars(field) for field in fields])


async def _on_known_error(request: Request, error: Exception) -> Response:
    return problem_response(problem_of(error))


async def _on_validation_error(request: Request, error: Exception) -> Response:
    assert isinstance(error, RequestValidationError)
    model = getattr(request.scope.get("route"), "body_model", None)
    return problem_response(bad_scene(bad_fields(error.errors(), error.body, model or PredictionRequest)))


async def _on_http_error(request: Request, error: Exception) -> Response:
    assert isinstance(error, HTTPException)
    kind = phrase_of(error.status_code).lower().replace(" ", "-")
    detail = _DETAILS.get(error.status_code, str(error.detail))
    headers = {**(error.headers or {}), **({"Allow": _allowed(request)} if error.status_code == 405 else {})}
    return problem_response(ProblemError(error.status_code, kind, detail, headers=headers))


def _allowed(request: Request) -> str:
    """Return the methods of this address: those of its routes, GET for files, and HEAD where `Heads` answers it."""
    routes = [route for route in request.app.routes if not isinstance(route, Mount)]

    def taken(method: str) -> bool:
        return any(route.matches({**request.scope, "method": method})[0] is Match.FULL for route in routes)

    methods = list(filter(taken, HTTPMethod)) or [HTTPMethod.GET]
    if HTTPMethod.GET in methods and not request.url.path.startswith(API):
        methods.append(HTTPMethod.HEAD)
    return ", ".join(sorted(methods))


async def _on_crash(request: Request, error: Exception) -> Response:
    _log.error("%s %s failed", request.method, request.url.path, exc_info=error)
    return problem_response(problem_of(error))


def install(app: FastAPI) -> None:
    """Make every failure of `app` a problem document."""
    app.add_exception_handler(ProblemError, _on_known_error)
    app.add_exception_handler(SceneError, _on_known_error)
    app.add_exception_handler(RequestValidationError, _on_validation_error)
    app.add_exception_handler(HTTPException, _on_http_error)
    app.add_exception_handler(Exception, _on_crash)
