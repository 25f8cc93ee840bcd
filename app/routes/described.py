"""Descriptions of the routes' answers, for the OpenAPI document."""

from typing import Any

from app.http.formats import EVENTS, JSON, MSGPACK, NPZ
from app.schemas import problem_document

Responses = dict[int | str, dict[str, Any]]

PREFER = (
    "RFC 7240: `respond-async` answers 202 with the address of the prediction before it is done; with `wait=5` the "
    "service waits up to 5 s for the prediction first."
)
_BINARY = {"schema": {"type": "string", "format": "binary"}}
_PREDICTION = {"$ref": "#/components/schemas/PredictionResponse"}
_JOB = {"$ref": "#/components/schemas/JobResponse"}
_MEASUREMENT = {"$ref": "#/components/schemas/MeasurementResponse"}


def _course(item: str, example: str) -> dict[str, Any]:
    """Return the description of a stream of events whose items are called `item`; the schema describes each event."""
    return {
        "schema": {
            "type": "object",
            "description": "One event of the stream.",
            "properties": {
                "event": {"enum": ["state", item, "done", "error"]},
                "id": {"type": "string", "description": "Number of the event; absent for `state`.", "examples": ["0"]},
                "data": {"type": "string", "contentMediaType": JSON, "description": "JSON in one line."},
            },
            "required": ["event", "data"],
        },
        "example": {"id": "0", "event": item, "data": example},
    }


_EVENTS = _course("iteration", '{"number":0,"update":null,"residual":1.2e-9}')
_FAILURES = {
    401: "The service needs a bearer token.",
    404: "There is nothing at this address, or nothing yet.",
    406: "None of the accepted media types is available.",
    409: "The prediction has no answer (yet), or is not stored.",
    413: "The body is too large.",
    415: "The body is not declared as JSON, is in another charset than UTF-8, or is compressed.",
    422: "The request is wrong: `errors` names each field, what was given, and what is allowed.",
    429: "Too many solves are waiting; `Retry-After` says when to try again.",
    503: "The solver is not ready yet, the service is stopping, or the solve was cancelled.",
    504: "The time limit has passed; `prediction` is the address of the best iterate.",
    507: "The recording can't be written.",
}


def failures(*statuses: int) -> Responses:
    """Return the descriptions of failures."""
    return {status: problem_document(_FAILURES[status]) for status in statuses}


def _location(what: str) -> dict[str, Any]:
    return {"Location": {"description": f"Address of {what}.", "schema": {"type": "string"}}}


_FORMS = {JSON: {"schema": _PREDICTION}, NPZ: _BINARY, MSGPACK: _BINARY}
PREDICT: Responses = {
    200: {
        "description": "The prediction, if it is not stored (`store=false`, or storing failed); or its progress as "
        "events.",
        "content": {**_FORMS, EVENTS: _EVENTS},
    },
    201: {
        "description": "The prediction, stored: as JSON, .npz or MessagePack, by `Accept`.",
        "content": _FORMS,
        "headers": _location("the prediction"),
    },
    202: {
        "description": "The prediction is queued or running, with `Prefer: respond-async`.",
        "content": {JSON: {"schema": _JOB}},
        "headers": _location("its state and, later, the prediction"),
    },
    **failures(401, 404, 406, 409, 413, 415, 422, 429, 503, 504),
}
READ: Responses = {
    200: {
        "description": "The prediction (`state` is `done`), or its state and the iterations so far.",
        "content": {**_FORMS, JSON: {"schema": {"oneOf": [_PREDICTION, _JOB]}}},
    },
    **failures(401, 404, 406, 409),
}
DELETE: Responses = {
    200: {"description": "It was under way and is cancelled.", "content": {JSON: {"schema": _JOB}}},
    202: {"description": "It is cancelled and will stop soon.", "content": {JSON: {"schema": _JOB}}},
    204: {"description": "It is removed."},
    **failures(401, 404),
}
FOLLOW: Responses = {
    200: {"description": "The events.", "content": {EVENTS: _EVENTS}},
    204: {"description": "Nothing comes after the given event."},
    **failures(401, 404, 406),
}

_PROGRESS = _course("progress", '{"number":0,"done":0,"total":99,"what":"compiling"}')
MEASURE: Responses = {
    200: {"description": "Its progress as server-sent events.", "content": {EVENTS: _PROGRESS}},
    202: {
        "description": "The measurement is queued or running.",
        "content": {JSON: {"schema": _MEASUREMENT}},
        "headers": _location("the result, once it is measured"),
    },
    **failures(401, 406, 503),
}
STUDY: Responses = {**MEASURE, **failures(413, 415, 422, 429)}
READ_STUDY: Responses = {
    202: {
        "description": "It has no result: it is queued or running, has failed or was cancelled.",
        "content": {JSON: {"schema": _MEASUREMENT}},
    },
    **failures(401, 404, 406),
}
REMOVE_STUDY: Responses = {
    200: {"description": "It was under way and is cancelled.", "content": {JSON: {"schema": _MEASUREMENT}}},
    202: {"description": "It is cancelled and will stop soon.", "content": {JSON: {"schema": _MEASUREMENT}}},
    204: {"description": "It is removed."},
    **failures(401, 404),
}
STOP: Responses = {
    200: {"description": "It was under way and is cancelled.", "content": {JSON: {"schema": _MEASUREMENT}}},
    202: {"description": "It is cancelled and will stop soon.", "content": {JSON: {"schema": _MEASUREMENT}}},
    **failures(401, 404),
}
PROGRESS: Responses = {**FOLLOW, 200: {"description": "The events.", "content": {EVENTS: _PROGRESS}}}


def a_file(description: str, media: str) -> Responses:
    """Return the descriptions of a route that returns a part of a stored run."""
    schema = {"schema": {"type": "object"}} if media == JSON else _BINARY
    return {200: {"description": description, "content": {media: schema}}, **failures(401, 404, 409)}
