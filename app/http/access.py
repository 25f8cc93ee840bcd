"""The optional bearer token: every address but ``/health`` and ``/ready`` asks for it.

A program sends ``Authorization: Bearer TOKEN``. A browser can't, so a page opened once with ``?token=TOKEN`` gets a
cookie that stands for the token, and is sent on to the same address without it.
"""

import hashlib
import hmac
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qsl, quote, urlencode

from starlette.datastructures import Headers
from starlette.responses import RedirectResponse
from starlette.types import ASGIApp, Receive, Scope, Send

from app.http.problems import ProblemError, problem_response

OPEN = frozenset({"/health", "/ready"})
COOKIE = "dlo-session"
IN_QUERY = "token"  # name in the query of a page that is opened with it
_POLICY_VIOLATION = 1008


class Access:
    """Let in only those who know the token, over HTTP and over websockets.

    Args:
        app: what they are let in to.
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
        elif scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": _POLICY_VIOLATION})
        elif scope["method"] == "GET" and self._in_query(scope):
            await self._welcome(scope)(scope, receive, send)
        else:
            detail = "Send `Authorization: Bearer` with the token of this service, or open a page with `?token=`."
            problem = ProblemError(401, "unauthorized", detail, headers={"WWW-Authenticate": 'Bearer realm="dlo"'})
            await problem_response(problem)(scope, receive, send)

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


def _query(scope: Scope) -> list[tuple[str, str]]:
    return parse_qsl(scope["query_string"].decode("latin-1"), keep_blank_values=True)


def _same(given: str, expected: str) -> bool:
    return hmac.compare_digest(given.encode(), expected.encode())
