"""What the predictions' routes answer, for the OpenAPI document."""

from typing import Any

from app.http.formats import EVENTS, JSON, MSGPACK, NPZ
from app.schemas import problem_document

Responses = dict[int | str, dict[str, Any]]

PREFER = (
    "RFC 7240: `respond-async` answers 202 with the address of the prediction before it is done; with `wait=5` it "
    "waits so many seconds for it first."
)
_BINARY = {"schema": {"type": "string", "format": "binary"}}
_PREDICTION = {"$ref": "#/components/schemas/PredictionResponse"}
_JOB = {"$ref": "#/components/schemas/JobResponse"}
_MEASUREMENT = {"$ref": "#/components/schemas/MeasurementResponse"}


def _course(item: str, example: str) -> dict[str, Any]:
    """Return the description of a course of events whose items are called `item`: the schema is that of each event."""
    return {
        "schema": {
            "type": "object",
            "description": "One event of the stream.",
            "properties": {
                "event": {"enum": ["state", item, "done", "error"]},
                "id": {"type": "string", "description": "Number of the event, but for `state`.", "examples": ["0"]},
                "data": {"type": "string", "contentMediaType": JSON, "description": "JSON in one line."},
            },
            "required": ["event", "data"],
        },
        "example": {"id": "0", "event": item, "data": example},
    }


_EVENTS = _course("iteration", '{"number":0,"update":null,"residual":1.2e-9}')
_FAILURES = {
    401: "The service needs a bearer token.",
    404: "There is no such thing here, or not yet.",
    406: "None of the accepted media types is there.",
    409: "The prediction has no answer (yet), or is not stored.",
    413: "The body is too large.",
    415: "The body is not declared as JSON, is in another charset than UTF-8, or is compressed.",
    422: "The request is wrong: `errors` names each field, what was given, and what is allowed.",
    429: "Too many solves are waiting; `Retry-After` says when to try again.",
    503: "The solver is not ready yet, the service stops, or the solve was cancelled.",
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
        "description": "The prediction, not stored (`store=false`, or it can't be); or its course as events.",
        "content": {**_FORMS, EVENTS: _EVENTS},
    },
    201: {
        "description": "The prediction, stored: as JSON, .npz or MessagePack, by `Accept`.",
        "content": _FORMS,
        "headers": _location("the prediction"),
    },
    202: {
        "description": "Taken up, with `Prefer: respond-async`.",
        "content": {JSON: {"schema": _JOB}},
        "headers": _location("its state and, later, the prediction"),
    },
    **failures(401, 404, 406, 413, 415, 422, 429, 503, 504),
}
READ: Responses = {
    200: {
        "description": "The prediction (`state` is `done`), or how far it is.",
        "content": {**_FORMS, JSON: {"schema": {"oneOf": [_PREDICTION, _JOB]}}},
    },
    **failures(401, 404, 406, 409),
}
DELETE: Responses = {
    200: {"description": "It was under way and is cancelled.", "content": {JSON: {"schema": _JOB}}},
    202: {"description": "It stops after its current iteration.", "content": {JSON: {"schema": _JOB}}},
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
        "description": "Taken up.",
        "content": {JSON: {"schema": _MEASUREMENT}},
        "headers": _location("the result, once it is measured"),
    },
    **failures(401, 406, 503),
}
STUDY: Responses = {**MEASURE, **failures(413, 415, 422, 429)}
READ_STUDY: Responses = {
    202: {"description": "It has no result: not yet, or not any more.", "content": {JSON: {"schema": _MEASUREMENT}}},
    **failures(401, 404, 406),
}
REMOVE_STUDY: Responses = {
    200: {"description": "It was under way and is cancelled.", "content": {JSON: {"schema": _MEASUREMENT}}},
    202: {"description": "It stops soon.", "content": {JSON: {"schema": _MEASUREMENT}}},
    204: {"description": "It is removed."},
    **failures(401, 404),
}
STOP: Responses = {
    200: {"description": "It was under way and is cancelled.", "content": {JSON: {"schema": _MEASUREMENT}}},
    202: {"description": "It stops soon.", "content": {JSON: {"schema": _MEASUREMENT}}},
    **failures(401, 404),
}
PROGRESS: Responses = {**FOLLOW, 200: {"description": "The events.", "content": {EVENTS: _PROGRESS}}}


def a_file(description: str, media: str) -> Responses:
    """Return the descriptions of a route that gives a part of a stored run."""
    schema = {"schema": {"type": "object"}} if media == JSON else _BINARY
    return {200: {"description": description, "content": {media: schema}}, **failures(401, 404, 409)}
