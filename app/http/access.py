"""Access control for every address but ``/health`` and ``/ready``: the optional bearer token, and pages of other sites.

A program sends ``Authorization: Bearer TOKEN``. A browser can't, so a page that is opened once with ``?token=TOKEN``
gets a cookie that stands for the token, and is redirected to the same address without the token.

A browser that can reach the service may have any page open. Pages of other sites can't read the answers, but without a
token they could make the service do things. A page whose host name resolves to 127.0.0.1 for a moment could also read.
"""

import hashlib
import hmac
import ipaddress
from collections.abc import Sequence
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qsl, quote, urlencode, urlsplit

from starlette.datastructures import Headers
from starlette.middleware.cors import CORSMiddleware
from starlette.responses import RedirectResponse, Response
from starlette.types import ASGIApp, Receive, Scope, Send

from app.http.problems import ProblemError, problem_response
from app.settings import Settings

OPEN = frozenset({"/health", "/ready"})
COOKIE = "dlo-session"
IN_QUERY = "token"  # name of the token in the query of a page
_POLICY_VIOLATION = 1008  # close code of a refused websocket
_SAFE = frozenset({"GET", "HEAD", "OPTIONS"})  # methods that change nothing
_MORE = "DLO_ALLOWED_ORIGINS allows others."


class Access:
    """Let in only clients that know the token, over HTTP and over websockets.

    Args:
        app: the application behind it.
        token: the token.
    """

    def __init__(self, app: ASGIApp, token: str) -> None:
        self.app = app
        self._token = token
        self._session = hmac.new(token.encode(), b"dlo session", hashlib.sha256).hexdigest()

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, or refuse it."""
        if scope["type"] not in ("http", "websocket") or scope["path"] in OPEN or self._knows(Headers(scope=scope)):
            await self.app(scope, receive, send)
        elif scope["type"] == "http" and scope["method"] == "GET" and self._in_query(scope):
            await self._welcome(scope)(scope, receive, send)
        else:
            detail = "Send `Authorization: Bearer` with the token of this service, or open a page with `?token=`."
            problem = ProblemError(401, "unauthorized", detail, headers={"WWW-Authenticate": 'Bearer realm="dlo"'})
            await _refuse(problem, scope, receive, send)

    def _knows(self, headers: Headers) -> bool:
        scheme, _, given = headers.get("authorization", "").partition(" ")
        if scheme.lower() == "bearer" and _same(given.strip(), self._token):
            return True
        try:
            cookie = SimpleCookie(headers.get("cookie", "")).get(COOKIE)
        except CookieError:
            return False
        return cookie is not None and _same(cookie.value, self._session)

    def _in_query(self, scope: Scope) -> bool:
        return any(name == IN_QUERY and _same(value, self._token) for name, value in _query(scope))

    def _welcome(self, scope: Scope) -> RedirectResponse:
        rest = urlencode([(name, value) for name, value in _query(scope) if name != IN_QUERY])
        path = "/" + quote(scope["path"]).lstrip("/")  # one slash: two would lead to another host
        response = RedirectResponse(path + (f"?{rest}" if rest else ""), 303)
        secure = scope.get("scheme") == "https"
        response.set_cookie(COOKIE, self._session, httponly=True, samesite="strict", secure=secure)
        return response


class AllowedSites(CORSMiddleware):
    """Let pages of some other origins call the API (CORS), and answer those of any other with a problem.

    Args:
        app: the application behind it.
        origins: the allowed origins.
    """

    def __init__(self, app: ASGIApp, origins: Sequence[str]) -> None:
        super().__init__(
            app,
            allow_origins=origins,
            allow_methods=["GET", "POST", "DELETE"],
            allow_headers=["Authorization", "Content-Type", "Last-Event-ID", "Prefer"],
            expose_headers=["Location", "Preference-Applied", "Retry-After"],
        )

    def preflight_response(self, request_headers: Headers) -> Response:
        """Return the permission, or the problem of a request that is not allowed."""
        answer = super().preflight_response(request_headers)
        if answer.status_code == 200:
            return answer
        detail = (
            f"{bytes(answer.body).decode()}. Allowed: origins {', '.join(self.allow_origins)}; methods "
            f"{', '.join(self.allow_methods)}; headers {', '.join(self.allow_headers)}."
        )
        headers = {name: value for name, value in answer.headers.items() if not name.startswith("content-")}
        return problem_response(ProblemError(400, "preflight-refused", detail, headers=headers))


class OtherSites:
    """Refuse requests from pages of other sites; programs, which send no origin, are let in.

    A websocket must come from the service's own pages or from an allowed origin. If the service has no token, this also
    holds for every request that changes something, and a client that connects to a service on a loopback address must
    use a known host name.

    Args:
        app: the application behind it.
        settings: the settings.
    """

    def __init__(self, app: ASGIApp, settings: Settings) -> None:
        self.app = app
        self._origins = settings.allowed_origins
        self._open = settings.token is None
        self._on_loopback = is_loopback(settings.host)
        self._names = sorted({_host_in(urlsplit(origin).netloc) for origin in self._origins} - {""})

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Pass the request on, or refuse it."""
        asked = scope["type"] in ("http", "websocket") and scope["path"] not in OPEN and "*" not in self._origins
        problem = self._problem(scope, Headers(scope=scope)) if asked else None
        if problem is None:
            await self.app(scope, receive, send)
        else:
            await _refuse(problem, scope, receive, send)

    def _problem(self, scope: Scope, headers: Headers) -> ProblemError | None:
        host, origin = headers.get("host", ""), headers.get("origin")
        if self._open and self._on_loopback and _came_in_on_loopback(scope) and not self._is_known(host):
            allowed = ", ".join(["localhost", "a loopback address", *self._names])
            return ProblemError(403, "unknown-host", f"Host: Got {host[:64]!r}. Allowed: {allowed}. {_MORE}")
        changes = scope["type"] == "websocket" or (self._open and scope["method"] not in _SAFE)
        if changes and origin is not None and not self._is_allowed(origin, host):
            allowed = ", ".join(["that of the service's own pages", *self._origins])
            return ProblemError(403, "other-origin", f"Origin: Got {origin[:64]!r}. Allowed: {allowed}. {_MORE}")
        return None

    def _is_known(self, host: str) -> bool:
        name = _host_in(host)
        return not host or is_loopback(name) or name in self._names  # no browser leaves the host out

    def _is_allowed(self, origin: str, host: str) -> bool:
        return origin in self._origins or (host != "" and origin.partition("://")[2] == host)


def _came_in_on_loopback(scope: Scope) -> bool:
    """Return whether the client has connected to a loopback address of this machine."""
    address, _ = scope.get("server") or ("", None)
    return is_loopback(address)


def is_loopback(host: str) -> bool:
    """Return whether `host`, an address or a name, is one that only this machine can reach."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


def _host_in(netloc: str) -> str:
    """Return the name or address in `netloc`, in lower case and without its port; "" if there is none."""
    try:
        return urlsplit(f"//{netloc}").hostname or ""
    except ValueError:
        return ""


async def _refuse(problem: ProblemError, scope: Scope, receive: Receive, send: Send) -> None:
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.close", "code": _POLICY_VIOLATION})
    else:
        await problem_response(problem)(scope, receive, send)


def _query(scope: Scope) -> list[tuple[str, str]]:
    return parse_qsl(scope["query_string"].decode("latin-1"), keep_blank_values=True)


def _same(given: str, expected: str) -> bool:
    return hmac.compare_digest(given.encode(), expected.encode())
