"""Names in the query of an address: one that is misspelt is refused instead of passed over."""

from fastapi import Request

from app.http.access import IN_QUERY
from app.http.fields import BadField
from app.http.problems import bad_scene


async def check_query(request: Request) -> None:
    """Raise a 422 problem where the query has names that the route doesn't know; a token may be in any."""
    known = [parameter.alias for parameter in request.scope["route"].dependant.query_params]
    unknown = [name for name in request.query_params if name not in (*known, IN_QUERY)]
    if unknown:
        allowed = f"one of {', '.join(known)}" if known else "no query parameter"
        raise bad_scene([BadField.unknown(name, request.query_params[name], allowed) for name in unknown])
