"""The request of ``POST /v1/predictions:batch``, and the lines of its answer."""

from typing import Annotated, Any, Literal

from fastapi.openapi.models import Example
from pydantic import BaseModel, ConfigDict, Discriminator, Field, RootModel, Tag, model_validator
from pydantic_core import PydanticCustomError

from app.schemas.base import LIKE, Flag, Model, RunId
from app.schemas.request import PAPER, TWO_GRIPPERS
from app.schemas.response import OPTIONAL_FIELDS, OptionalField, PredictionResponse, ProblemDocument

_MOST = 100_000  # a service may allow less: DLO_MAX_BATCH


class _Batch(Model):
    store: Flag = Field(default=False, description="Whether to keep the runs.", examples=[False])
    like: RunId | None = Field(default=None, description=LIKE, examples=[None])
    order: Literal["index", "finished"] = Field(
        default="index",
        description="Order of the lines: `index`, that of the scenes, each line as soon as all before it are done; or "
        "`finished`, as the scenes finish.",
        examples=["index"],
    )
    fields: list[OptionalField] = Field(
        default=list(OPTIONAL_FIELDS),
        max_length=len(OPTIONAL_FIELDS),
        description="Parts of each result, in addition to `id`, `state`, `created`, `status`, `message`, `accuracy` "
        "and `links`; the other parts are not computed. A stored run has all of them.",
        examples=[["surface", "grasps"]],
    )


class ScenesBatch(_Batch):
    """Many scenes."""

    scenes: list[Any] = Field(
        min_length=1,
        max_length=_MOST,
        description="Requests as for `POST /v1/predictions`. An invalid one gives a line with a problem.",
        examples=[[PAPER]],
    )


class PrimitivesBatch(_Batch):
    """One scene with many lists of primitives, that is, many ways to move the cable."""

    scene: dict[str, Any] = Field(
        description="A request as for `POST /v1/predictions`; its `primitives` are replaced.",
        examples=[PAPER],
    )
    primitives: list[Any] = Field(
        min_length=1,
        max_length=_MOST,
        description="Lists of primitives, one for each prediction. An invalid one gives a line with a problem.",
        examples=[[PAPER["primitives"]]],
    )


def _form(value: Any) -> str:
    one = "scene" in value if isinstance(value, dict) else isinstance(value, PrimitivesBatch)
    return "~primitives" if one else "~scenes"


class BatchRequest(RootModel):
    """Many predictions in one request."""

    root: Annotated[
        Annotated[ScenesBatch, Tag("~scenes")] | Annotated[PrimitivesBatch, Tag("~primitives")], Discriminator(_form)
    ]

    @model_validator(mode="before")
    @classmethod
    def _one_form(cls, value: Any) -> Any:
        if isinstance(value, dict) and {"scene", "scenes"} <= value.keys():
            context = {"given": "scene and scenes", "allowed": "one of the two: scenes, or scene with primitives"}
            raise PydanticCustomError("two_forms", "Two forms at once", context)
        return value

    @property
    def field(self) -> Literal["scenes", "primitives"]:
        """The field whose entries are predicted."""
        return "scenes" if isinstance(self.root, ScenesBatch) else "primitives"

    def scenes(self) -> list[Any]:
        """Return the requests as data."""
        if isinstance(self.root, ScenesBatch):
            return self.root.scenes
        return [{**self.root.scene, "primitives": primitives} for primitives in self.root.primitives]


def _some_optional(schema: dict[str, Any]) -> None:
    schema["required"] = [name for name in schema["required"] if name not in OPTIONAL_FIELDS]


class BatchResult(PredictionResponse):
    """A predicted motion with the `fields` that the batch requests."""

    model_config = ConfigDict(json_schema_extra=_some_optional)


class BatchLine(BaseModel):
    """One line of the answer: `result` or `problem`."""

    index: int = Field(description="Index of the scene, from 0.", examples=[0])
    status: str = Field(
        description="Status of the prediction, e.g. `converged`; `failed` if there is none.", examples=["converged"]
    )
    result: BatchResult | None = Field(default=None, description="The prediction.")
    problem: ProblemDocument | None = Field(default=None, description="Why there is no prediction.")


def _swept(y: float) -> list[dict[str, Any]]:
    path = {"kind": "move", "displacement": [0, y, 0], "duration": 1.6, "profile": "minimum_jerk"}
    return [{"u": 0.25, "hold": "point", "path": path}]


_QUICK = {**PAPER, "quality": "auto"}
BATCH_EXAMPLES: dict[str, Example] = {
    "sweep": {
        "summary": "One scene, three moves of the gripper",
        "value": {"scene": _QUICK, "primitives": [_swept(y) for y in (0.3, 0.4, 0.5)]},
    },
    "scenes": {
        "summary": "Two scenes, stored",
        "value": {"scenes": [_QUICK, TWO_GRIPPERS], "store": True},
    },
}
