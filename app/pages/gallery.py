"""The ready scenes of the page and the API: files in ``static/gallery``, in the order of ``static/gallery.json``."""

from dataclasses import dataclass
from functools import cache

import orjson

from app.pages.assets import static_dir
from app.schemas import PredictionRequest


@dataclass(frozen=True, kw_only=True)
class Example:
    """A ready scene.

    Attributes:
        name: name in addresses, e.g. ``paper-25``.
        description: one sentence that says what the scene shows.
        document: the scene as JSON, unchanged from its file.
        request: the same scene, parsed.
    """

    name: str
    description: str
    document: bytes
    request: PredictionRequest

    @property
    def title(self) -> str:
        """The name of its runs in lists."""
        return self.request.name


@cache
def examples() -> dict[str, Example]:
    """Return the ready scenes by name, in the order of the gallery."""
    found = {}
    for entry in orjson.loads((static_dir() / "gallery.json").read_bytes()):
        document = (static_dir() / "gallery" / f"{entry['name']}.json").read_bytes()
        request = PredictionRequest.model_validate_json(document)
        found[entry["name"]] = Example(
            name=entry["name"], description=entry["description"], document=document, request=request
        )
    return found
