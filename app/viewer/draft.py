"""The scene as the user edits it: the JSON that the API takes, valid or not, and the selected gripper.

`scene()` raises `SceneError` if the document makes no possible scene. The draft itself never does, so that the panel
keeps a half finished edit while the picture keeps the last good prediction.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from app.http.fields import bad_fields
from app.schemas import PredictionRequest, to_scene
from app.schemas.convert import StoredMotion, cable_of, environment_of, shape_of
from app.schemas.request import PAPER
from dlocore import Cable, Scene, SceneError
from dlocore.errors import within
from dlocore.scene.obstacles import Obstacle
from dlocore.shape.shape import StartCurve, start_curve

Floats = NDArray[np.float64]
Path = Sequence[str | int]
LENGTH = 1.0  # m, of a cable whose document has no length yet


@dataclass(frozen=True, kw_only=True)
class Draft:
    """A scene being edited; every edit returns another draft.

    Attributes:
        document: the scene as `POST /v1/predictions` takes it; never changed in place.
        selected: index of the selected gripper in the document's `primitives`.
        in_space: whether the gripper's target is dragged in all three directions, or only at its height.
    """

    document: dict[str, Any]
    selected: int = 0
    in_space: bool = False

    @staticmethod
    def of(document: dict[str, Any]) -> "Draft":
        """Return the draft of a scene's document, with its first moving gripper selected."""
        primitives = document.get("primitives") or []
        moving = [k for k, primitive in enumerate(primitives) if primitive["path"]["kind"] != "still"]
        path = primitives[moving[0]]["path"] if moving else {}
        lifts = bool((path.get("displacement") or (0, 0, 0))[2]) or path.get("kind") == "waypoints"
        table = (document.get("environment") or {}).get("table")
        return Draft(document=document, selected=moving[0] if moving else 0, in_space=table is None or lifts)

    def get(self, path: Path, default: Any = None) -> Any:
        """Return the value at `path` of the document; `default` if it is absent or null."""
        node: Any = self.document
        for key in path:
            if isinstance(node, dict):
                node = node.get(key)
            elif isinstance(node, list) and isinstance(key, int) and key < len(node):
                node = node[key]
            else:
                return default
        return default if node is None else node

    def put(self, path: Path, value: Any) -> "Draft":
        """Set the value at `path` of the document; None removes it."""
        return replace(self, document=_put(self.document, path, value))

    @property
    def length(self) -> float:
        """Length of the cable [m]."""
        preset = self.get(("cable", "preset"))
        given = self.get(("cable", "length"))
        if given is None and preset is not None:
            return self.cable().length
        return float(LENGTH if given is None else given)

    @property
    def primitives(self) -> list[dict[str, Any]]:
        """The grippers of the document."""
        found: list[dict[str, Any]] = self.get(("primitives",), [])
        return found

    def request(self) -> PredictionRequest:
        """Return the document as a request, or raise SceneError for its first invalid field."""
        try:
            return PredictionRequest.model_validate(self.document)
        except ValidationError as error:
            bad = bad_fields(error.errors(), self.document)[0]
            raise SceneError(bad.field, bad.given, bad.allowed) from None

    def scene(self, stored: StoredMotion) -> Scene:
        """Return the scene for the solver.

        Args:
            stored: finds the motion that a shape of kind "prediction" continues.

        Raises:
            SceneError: the document makes no possible scene.
        """
        return to_scene(self.request(), stored)

    def cable(self) -> Cable:
        """Return the cable for the solver, or raise SceneError."""
        with within("cable"):
            return cable_of(self.request().cable)

    def obstacles(self) -> tuple[Obstacle, ...]:
        """Return the obstacles for the solver; none if the document is invalid."""
        try:
            return environment_of(self.request().environment).obstacles
        except SceneError:
            return ()

    def start(self, stored: StoredMotion) -> StartCurve:
        """Return the curve along which the cable lies at the start, or raise SceneError."""
        cable = self.cable()
        return start_curve(shape_of(self.request(), cable, stored), cable.length)

    def same_but_name(self, other: "Draft") -> bool:
        """Return whether another draft has the same scene, whatever its name."""
        return self.put(("name",), None).document == other.put(("name",), None).document

    def shape_key(self) -> tuple[Any, ...]:
        """Return what `start` depends on, to detect changes."""
        return (self.get(("shape",)), self.get(("cable", "length")), self.get(("cable", "preset")))


def _put(node: Any, path: Path, value: Any) -> Any:
    if not path:
        return value
    key, rest = path[0], path[1:]
    if isinstance(key, int):
        items = list(node)
        items[key] = _put(items[key], rest, value)
        return items
    found = dict(node) if isinstance(node, dict) else {}
    changed = _put(found.get(key), rest, value)
    if changed is None:
        found.pop(key, None)
    else:
        found[key] = changed
    return found


def start_draft() -> Draft:
    """Return the paper's case: a straight cable of 1 m, grasped at u = 0.25 m and moved 0.5 m sideways in 1.6 s."""
    return Draft.of({name: part for name, part in PAPER.items() if name != "output"})
