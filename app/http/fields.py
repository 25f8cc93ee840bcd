"""What is wrong with which field of a request: pydantic's errors in the words of the contract."""

import ast
import json
import re
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

from pydantic import BaseModel

from app.schemas.base import MAX_NAMES, MAX_REPORTED, RUN_ID
from app.schemas.request import PredictionRequest
from dlocore import SceneError
from dlocore.words import counted

_WHOLE = "body"
_SHAPE = re.compile(r"shape \(([0-9, ]+)\)")


@dataclass(frozen=True)
class BadField:
    """One wrong field.

    Attributes:
        field: its path, e.g. ``primitives[0].u``; ``body`` for the request as a whole.
        given: what was given, shortened to be readable.
        allowed: what would be accepted, in words.
        message: what is wrong, in words.
    """

    field: str
    given: str
    allowed: str
    message: str

    @staticmethod
    def from_scene_error(error: SceneError) -> "BadField":
        """Return the field that the solver refused."""
        reason = f"{error.reason}. " if error.reason else ""
        given = _written(_from_python(error.given))
        return BadField(error.field, given, error.allowed, f"{reason}Got {given}. Allowed: {error.allowed}.")

    @staticmethod
    def in_query(field: str, value: str | list[str], allowed: str, what: str) -> "BadField":
        """Return a wrong query parameter; the sentence `what` says what is wrong."""
        given = _shown(value, "")
        return BadField(field, given, allowed, f"{what} Got {given}. Allowed: {allowed}.")


def bad_fields(errors: Sequence[Any], body: Any, model: type[BaseModel] = PredictionRequest) -> list[BadField]:
    """Return pydantic's `errors` about the request `body`, at most `MAX_REPORTED` of them.

    Args:
        errors: the errors that pydantic found.
        body: the request.
        model: the model that it should have matched.
    """
    schema = _schema_of(model)
    return [_bad_field(error, body, schema) for error in errors[:MAX_REPORTED]]


_WHAT = {
    "missing": "It is missing. ",
    "union_tag_not_found": "It is missing. ",
    "extra_forbidden": "There is no such field. ",
}


def _bad_field(error: Any, body: Any, schema: "_Schema") -> BadField:
    loc = list(error["loc"])
    where = loc[0] if loc and loc[0] in ("path", "query", "header") else _WHOLE
    kind, context = error["type"], error.get("ctx", {})
    if kind == "json_invalid":
        at = loc[1] if len(loc) > 1 else 0
        given = str(body or "")[max(0, at - 30) : at + 30]
        allowed = f"JSON (RFC 8259) in UTF-8, with each name once in an object, and at most {MAX_NAMES} names"
        return BadField(_WHOLE, given, allowed, f"The body can't be read: {context['error']}. Allowed: {allowed}.")
    if kind == "two_forms":
        given, allowed = context["given"], context["allowed"]
        return BadField(_WHOLE, given, allowed, f"Got {given}. Allowed: {allowed}.")
    loc = loc[1:] if loc and loc[0] in ("body", "path", "query", "header") else loc
    tagged, steps = _steps(loc, body) if where == _WHOLE else (loc, loc)
    if kind == "union_tag_not_found":
        steps = [*steps, "kind"]
    given = "nothing" if kind in ("missing", "union_tag_not_found") else _shown(error["input"], kind)
    by_kind = not context.get("tag", "").startswith("~")  # otherwise by form, which has no field of its own
    if kind == "union_tag_invalid" and by_kind:
        steps, given = [*steps, "kind"], _shown(error["input"].get("kind"), kind)
    allowed = _allowed(kind, context, tagged, schema if where == _WHOLE else _NONE)
    return BadField(_text(steps), given, allowed, f"{_WHAT.get(kind, '')}Got {given}. Allowed: {allowed}.")


def _steps(loc: list[Any], body: Any) -> tuple[list[Any], list[Any]]:
    """Return the path of an error with the names of union branches, and without them.

    The name of a branch by form begins with "~". The name of a branch by `kind` is the `kind` of the object there.
    """
    steps: list[Any] = []
    value, fresh = body, True
    for item in loc:
        if isinstance(item, str) and item.startswith("~"):
            continue
        if fresh and isinstance(value, dict) and value.get("kind") == item:
            fresh = False
            continue
        steps.append(item)
        inside = isinstance(value, dict) or (isinstance(value, list) and isinstance(item, int) and item < len(value))
        value = value.get(item) if isinstance(value, dict) else value[item] if inside else None
        fresh = True
    return loc, steps


def _text(steps: list[Any]) -> str:
    text = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in steps).lstrip(".")
    return text or _WHOLE


def _shown(value: Any, kind: str) -> str:
    if kind in ("too_short", "too_long") and isinstance(value, list):
        return counted(len(value), "item")
    text = _written(_as_json(value))
    return text if len(text) <= 120 else text[:117] + "..."


def _from_python(text: str) -> str:
    """Return in JSON's notation what the solver shows in Python's: None, a bool, a tuple, the shape of an array."""
    try:
        value = ast.literal_eval(text)
    except (ValueError, SyntaxError, MemoryError, RecursionError):  # words, or a shortened value
        shape = _SHAPE.fullmatch(text)
        return text if shape is None else " x ".join(re.findall("[0-9]+", shape[1])) + " numbers"
    try:
        return json.dumps(value) if value is None or isinstance(value, bool | tuple | list) else text
    except TypeError:  # a text that only looks like a value
        return text


def _written(text: str) -> str:
    """Return a text with lone surrogates escaped: JSON can express them, but UTF-8 can't."""
    return text.encode(errors="backslashreplace").decode()


def _as_json(value: Any) -> str:
    """Return a value as JSON; a text has no quotes unless it is blank or reads like another value."""
    text = json.dumps(value, default=repr, ensure_ascii=False)
    if not isinstance(value, str) or not value.strip():
        return text
    try:
        json.loads(value)
    except (ValueError, RecursionError):
        return value
    return text


_FORMS = {
    "~text": "a text",
    "~list": "a list",
    "~object": "an object",
    "~one": "one vector",
    "~rows": "a list of vectors",
    "~scenes": "an object with scenes",
    "~primitives": "an object with scene and primitives",
}
_TIME = "a time in ISO 8601 with its offset from UTC, e.g. 2026-01-31T12:00:00Z"
_TYPES = {
    "float_type": "a finite number",
    "float_parsing": "a finite number",
    "finite_number": "a finite number",
    "int_type": "an integer",
    "int_from_float": "an integer",
    "int_parsing": "an integer",
    "bool_type": "true or false",
    "bool_parsing": "true or false",
    "datetime_type": _TIME,
    "datetime_parsing": _TIME,
    "datetime_from_date_parsing": _TIME,
    "datetime_object_invalid": _TIME,
    "timezone_naive": _TIME,
    "string_type": "a text",
    "list_type": "a list",
    "dict_type": "an object",
    "model_type": "an object",
    "model_attributes_type": "an object",
}


def _allowed(kind: str, context: dict[str, Any], loc: list[Any], whole: "_Schema") -> str:
    schema = whole.at(loc)
    if kind == "extra_forbidden":
        return "one of " + ", ".join(whole.names(loc[:-1]))
    if kind == "union_tag_invalid":
        tags = context["expected_tags"].replace("'", "").split(", ")
        return " or ".join(_FORMS[tag] for tag in tags) if tags[0] in _FORMS else "one of " + ", ".join(tags)
    if kind == "union_tag_not_found":
        return "the kind of object, one of " + ", ".join(schema.get("discriminator", {}).get("mapping", {}))
    if kind == "literal_error":
        values = "one of " + context["expected"].replace("'", "").replace(" or ", ", ")
        return " or ".join([values, *whole.other_forms(loc)])
    if kind == "string_pattern_mismatch":
        return RUN_ID
    if kind == "string_unicode":  # in a text, or in a name in an object
        return "texts and names in Unicode, which has surrogates in pairs only"
    if kind in ("too_short", "too_long"):
        return _bounds(context, "min_length", "max_length", "{} items")
    text = whole.form(schema) if kind == "missing" else _TYPES.get(kind, "")
    if kind in ("string_too_short", "string_too_long"):
        text = _bounds(context, "min_length", "max_length", "{} characters")
    if kind in ("greater_than", "greater_than_equal", "less_than", "less_than_equal"):
        text = _range(schema) or _bounds(context, "ge", "le", "{}")
    description = schema.get("description", "").split("\n")[0].split(". ")[0].rstrip(".")
    return f"{text} ({description})" if text and description else text or description or "a field of the contract"


def _bounds(context: dict[str, Any], least: str, most: str, form: str) -> str:
    low, high = context.get(least), context.get(most)
    if (high if low is None else low) == 1:
        form = form.removesuffix("s")
    if low is not None and low == high:
        return form.format(low)
    return form.format(f"at least {low}" if low is not None else f"at most {high}")


def _range(schema: dict[str, Any]) -> str:
    for option in [schema, *_options(schema)]:
        words = [
            f"{word} {option[key]:g}"
            for key, word in (
                ("exclusiveMinimum", "above"),
                ("minimum", "at least"),
                ("exclusiveMaximum", "below"),
                ("maximum", "at most"),
            )
            if key in option
        ]
        if words:
            number = "an integer" if option.get("type") == "integer" else "a finite number"
            return " ".join([number, *words])
    return ""


class _Schema:
    """The JSON schema of a request, read field by field."""

    def __init__(self, document: dict[str, Any]) -> None:
        self._document = document

    def at(self, loc: list[Any]) -> dict[str, Any]:
        """Return the schema of the field at `loc`, with union branches as pydantic names them; {} if unknown."""
        node = self._document
        for item in loc:
            if isinstance(item, str) and item.startswith("~"):
                continue
            node = self._child(self._resolved(node), item)
            if not node:
                return {}
        description = node.get("description")
        resolved = self._resolved(node)
        return {**resolved, "description": description} if description else resolved

    def names(self, loc: list[Any]) -> list[str]:
        """Return the field names of the object at `loc`, or of the object among the forms that it may have."""
        node = self.at(loc)
        options = [node, *map(self._resolved, _options(node))]
        return next((list(option["properties"]) for option in options if "properties" in option), [])

    def other_forms(self, loc: list[Any]) -> list[str]:
        """Return in words what the field at `loc` may be other than a text."""
        options = [self._resolved(option) for option in _options(self.at(loc))]
        words = {"array": "a list", "object": "an object with some of " + ", ".join(self.names(loc))}
        return [words[option["type"]] for option in options if option.get("type") in words]

    def form(self, node: dict[str, Any]) -> str:
        """Return in words what a value of the schema `node` is; "" if the schema does not say."""
        node = self._resolved(node)
        kinds = node.get("discriminator", {}).get("mapping")
        if kinds:
            return "an object whose kind is one of " + ", ".join(kinds)
        options = _options(node)
        if options:
            return " or ".join(filter(None, map(self.form, options)))
        kind = node.get("type", "")
        if kind == "object":
            needed = node.get("required") or ["some of " + ", ".join(node.get("properties", {}))]
            return "an object with " + ", ".join(needed)
        if kind == "array":
            least, most = node.get("minItems"), node.get("maxItems")
            return f"a list of {least} items" if least == most is not None else "a list"
        if kind == "string":
            return RUN_ID if "pattern" in node else "a text"
        return _range(node) or {"number": "a finite number", "integer": "an integer"}.get(kind, "")

    def _resolved(self, node: dict[str, Any]) -> dict[str, Any]:
        while "$ref" in node:
            node = self._document["$defs"][node["$ref"].rsplit("/", 1)[1]]
        return node

    def _child(self, node: dict[str, Any], item: Any) -> dict[str, Any]:
        mapping = node.get("discriminator", {}).get("mapping", {})
        if item in mapping:
            return {"$ref": mapping[item]}
        if isinstance(item, str) and item in node.get("properties", {}):
            return node["properties"][item]
        if isinstance(item, int) and "items" in node:
            return node["items"]
        if isinstance(item, str) and isinstance(node.get("additionalProperties"), dict):
            return node["additionalProperties"]
        for option in _options(node):
            found = self._child(self._resolved(option), item)
            if found:
                return found
        return {}


_NONE = _Schema({})  # for what is not a field of the body


@cache
def _schema_of(model: type[BaseModel]) -> _Schema:
    return _Schema(model.model_json_schema())


def _options(node: dict[str, Any]) -> list[dict[str, Any]]:
    return [*node.get("anyOf", []), *node.get("oneOf", [])]
