"""Check the names in the query of an address: a misspelt name, or one given twice for one value, is refused."""

from typing import Any, get_args, get_origin

from fastapi import Request

from app.http.access import IN_QUERY
from app.http.fields import BadField
from app.http.problems import bad_scene


async def check_query(request: Request) -> None:
    """Raise a 422 problem if the query has names that the route doesn't know, or several values for one parameter.

    Any query may contain a token.
    """
    given = request.query_params
    parameters = request.scope["route"].dependant.query_params
    known = [parameter.alias for parameter in parameters]
    allowed = f"one of {', '.join(known)}" if known else "no query parameter"
    wrong = [
        BadField.in_query(name, given[name], allowed, "There is no such query parameter.")
        for name in given
        if name not in (*known, IN_QUERY)
    ]
    for parameter in parameters:
        values = given.getlist(parameter.alias)
        if len(values) > 1 and not _is_list(parameter.field_info.annotation):
            wrong.append(BadField.in_query(parameter.alias, values, "one value", "It is given more than once."))
    if wrong:
        raise bad_scene(wrong)


def _is_list(annotation: Any) -> bool:
    """Return whether a type is a list, or a list or None."""
    return any(get_origin(kind) is list for kind in (annotation, *get_args(annotation)))
