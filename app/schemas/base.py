"""Numbers, vectors and the base model of the contract."""

import re
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Discriminator, Field, Tag

from dlocore.scene.cable import MAX_LENGTH


def _whole(value: Any) -> Any:
    """Return a whole float as an integer, as JSON Schema counts it; return any other value unchanged."""
    return int(value) if isinstance(value, float) and value.is_integer() else value


# strict: otherwise a bool or a numeral in quotes would pass as a number
Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
_Integer = Annotated[int, Field(strict=True)]
Count = Annotated[_Integer, BeforeValidator(_whole)]
CountOrNone = Annotated[_Integer | None, BeforeValidator(_whole)]
Flag = Annotated[bool, Field(strict=True)]
Vector = Annotated[list[Number], Field(min_length=3, max_length=3)]
Point = Annotated[list[Number], Field(min_length=2, max_length=3)]
_Item = TypeVar("_Item")
# stops at the first fault: all those of a large body would fill the memory
Long = Annotated[list[_Item], Field(fail_fast=True)]
Coordinate = Annotated[
    Number,
    Field(ge=0.0, le=MAX_LENGTH, description="Material coordinate [m], 0 to the cable's length.", examples=[0.25]),
]
ID = re.compile("^[0-9a-f]{28}$")  # of runs and studies, made by app.schemas.ids.new_id
RunId = Annotated[str, Field(pattern=ID.pattern)]
RUN_ID = "the id of a run, 28 of the characters 0 to 9 and a to f"  # the only pattern of a text field, in words
MAX_NAMES = 200  # in one object of a request: each unknown one would be a fault, and all are collected first
MAX_REPORTED = 50  # largest number of faults of a request that an answer lists
LIKE = (
    "Id of a run of a similar scene, for example with a target moved by a few centimetres. Its grid and its error "
    "estimate are reused, which saves the search for them. If the two scenes differ too much, or the service no longer "
    "has the run in memory, the scene is solved from the beginning, and `message` says so."
)


class Model(BaseModel):
    """Base class of the parts of a request: unknown fields are refused, and the contract sets the defaults."""

    model_config = ConfigDict(extra="forbid", frozen=True, protected_namespaces=())


def _form(value: Any) -> str:
    if isinstance(value, str):
        return "~text"
    return "~object" if isinstance(value, dict | BaseModel) else "~list"


# For a field that may be a text, a list or an object: only the errors of the form that was given are reported. In the
# path of an error, the mark "~" distinguishes names of branches from names of fields.
BY_FORM = Discriminator(_form)
TEXT, LIST, OBJECT = Tag("~text"), Tag("~list"), Tag("~object")
