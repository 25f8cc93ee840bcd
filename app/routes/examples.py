"""``/v1/examples``: ready scenes to send, to open in the 3D scene, or to use as a starting point."""

import anyio.to_thread
from fastapi import APIRouter
from fastapi.responses import Response
from pydantic import BaseModel, Field

from app.http.formats import JSON
from app.http.problems import ProblemError
from app.pages.gallery import Example, examples
from app.routes import described
from app.schemas import PredictionRequest, problem_document

router = APIRouter(prefix="/v1/examples", tags=["scenes"])


class ExampleLinks(BaseModel):
    """Addresses, relative to the service."""

    self: str = Field(description="The scene as JSON.", examples=["/v1/examples/paper-25"])
    scene: str = Field(description="The 3D scene that shows it.", examples=["/scene/?example=paper-25"])
    picture: str = Field(description="A small picture of its prediction.", examples=["/gallery/paper-25.svg"])


class ExampleSummary(BaseModel):
    """A ready scene, as an item of the list."""

    name: str = Field(description="Its name in addresses.", examples=["paper-25"])
    title: str = Field(description="What it is, in a few words.", examples=["Grasped at a quarter"])
    description: str = Field(description="What it shows.", examples=["A straight cable is pulled sideways."])
    links: ExampleLinks = Field(description="Addresses, relative to the service.")


class ExampleList(BaseModel):
    """The ready scenes."""

    examples: list[ExampleSummary] = Field(description="The scenes, in the order of the gallery.")


def _summary(example: Example) -> ExampleSummary:
    links = ExampleLinks(
        self=f"/v1/examples/{example.name}",
        scene=f"/scene/?example={example.name}",
        picture=f"/gallery/{example.name}.svg",
    )
    return ExampleSummary(name=example.name, title=example.title, description=example.description, links=links)


@router.get("", summary="List the ready scenes", responses=described.failures(401))
async def listed() -> ExampleList:
    """Return the ready scenes; each is a request for `POST /v1/predictions`."""
    found = await anyio.to_thread.run_sync(examples)
    return ExampleList(examples=[_summary(example) for example in found.values()])


@router.get(
    "/{name}",
    response_model=PredictionRequest,
    summary="Read a ready scene",
    responses={**described.failures(401), 404: problem_document("There is no such example.")},
)
async def example(name: str) -> Response:
    """Return the scene; it can be sent to `POST /v1/predictions` as it is."""
    found = await anyio.to_thread.run_sync(examples)
    if name not in found:
        names = ", ".join(found)
        raise ProblemError(404, "no-such-example", f"There is no example {name[:64]!r}. There are {names}.")
    return Response(found[name].document, media_type=JSON)
