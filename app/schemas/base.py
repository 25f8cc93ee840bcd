"""Numbers, vectors and the base model of the contract."""

import re
from typing import Annotated, Any, TypeVar

from pydantic import BaseModel, BeforeValidator, ConfigDict, Discriminator, Field, Tag

from dlocore.scene.cable import MAX_LENGTH


def _whole(value: Any) -> Any:
    """Return a float that is whole as an integer, which JSON Schema counts it as; any other value as it is."""
    return int(value) if isinstance(value, float) and value.is_integer() else value


# strict, since a bool or a numeral in quotes would pass as a number otherwise
Number = Annotated[float, Field(strict=True, allow_inf_nan=False)]
_Integer = Annotated[int, Field(strict=True)]
Count = Annotated[_Integer, BeforeValidator(_whole)]
CountOrNone = Annotated[_Integer | None, BeforeValidator(_whole)]
Flag = Annotated[bool, Field(strict=True)]
Vector = Annotated[list[Number], Field(min_length=3, max_length=3)]
Point = Annotated[list[Number], Field(min_length=2, max_length=3)]
_Item = TypeVar("_Item")
Long = Annotated[list[_Item], Field(fail_fast=True)]  # its first fault is told: all of a large body fill the memory
Coordinate = Annotated[
    Number,
    Field(ge=0.0, le=MAX_LENGTH, description="Material coordinate [m], 0 to the cable's length.", examples=[0.25]),
]
ID = re.compile("^[0-9a-f]{28}$")  # of a run or a study, app.schemas.ids.new_id
RunId = Annotated[str, Field(pattern=ID.pattern)]
RUN_ID = "the id of a run, 28 of the characters 0 to 9 and a to f"  # the one pattern of a text, in words
MAX_NAMES = 200  # of one object of a request: each that is no field would be a fault, and all are found first
MAX_REPORTED = 50  # faults of a request that an answer names at most
LIKE = (
    "Id of a run of a scene much like this one, a target moved by centimetres say: its grid and its error estimate are "
    "taken on, which saves the search for them. Where the two differ too much for that, or the service has forgotten "
    "it, the scene is solved from the beginning, and `message` says so."
)


class Model(BaseModel):
    """A part of the request: unknown fields are refused, defaults are those of the contract."""

    model_config = ConfigDict(extra="forbid", frozen=True, protected_namespaces=())


def _form(value: Any) -> str:
    if isinstance(value, str):
        return "~text"
    return "~object" if isinstance(value, dict | BaseModel) else "~list"


# For a field that may be a text, a list or an object: only the errors of the given form are reported. The mark "~"
# tells the branch names from field names in the path of an error.
BY_FORM = Discriminator(_form)
TEXT, LIST, OBJECT = Tag("~text"), Tag("~list"), Tag("~object")
