"""Find everything that is wrong with a scene; its conversion alone would stop at the first fault."""

import re
from collections.abc import Callable, Iterable
from functools import partial
from typing import Any

from app.schemas import convert
from app.schemas.base import MAX_REPORTED
from app.schemas.request import PredictionRequest
from dlocore import SceneError, plan
from dlocore.errors import within
from dlocore.shape.shape import start_curve

_NUMBERED = re.compile(r"(primitives|loads|obstacles)\[(\d+)\]")
_STILL = 1.0  # s: the horizon where that of the request is left out; grasps that stay still have none of their own


def scene_errors(request: PredictionRequest, stored: convert.StoredMotion) -> list[SceneError]:
    """Return what is wrong with a request, at most `MAX_REPORTED` faults.

    The faults that each part has by itself come first. If the cable, the shape, the quality and the numbers of the
    environment have none, the valid parts are put together. A grasp, load, obstacle or table that contradicts the rest
    is then reported and left out, until nothing contradicts. Any other fault of the whole is reported only if it is the
    only fault.

    Args:
        request: the valid request.
        stored: finds the motion that a shape of kind "prediction" continues from.
    """
    found: dict[str, SceneError] = {}
    rest = _Rest(request)
    whole = True
    for part in _parts(request, stored):
        try:
            part()
        except SceneError as error:
            found[error.field] = error
            whole &= rest.leave_out(error.field)
    while whole and len(found) < MAX_REPORTED:
        try:
            plan(convert.to_scene(rest.request(), stored))
            break
        except SceneError as error:
            told = rest.in_first_numbers(error)
            whole = rest.leave_out(told.field)
            if not found or (whole and told.field != "horizon"):  # the horizon of the rest is not that of the request
                found[told.field] = told
    return list(found.values())[:MAX_REPORTED]


def _parts(request: PredictionRequest, stored: convert.StoredMotion) -> Iterable[Callable[[], object]]:
    def cable() -> object:
        with within("cable"):
            return convert.cable_of(request.cable)

    def shape() -> object:
        try:
            known = convert.cable_of(request.cable)
        except SceneError:  # reported by `cable`
            return None
        return start_curve(convert.shape_of(request, known, stored), known.length)

    yield cable
    yield shape
    for i, primitive in enumerate(request.primitives):
        yield partial(convert.grasp_of, i, primitive)
    for i, load in enumerate(request.loads):
        yield partial(convert.load_of, i, load)
    for i, obstacle in enumerate(request.environment.obstacles):
        yield partial(convert.obstacle_of, i, obstacle)
    yield partial(convert.environment_of, request.environment.model_copy(update={"obstacles": []}))
    yield partial(convert.quality_of, request.quality)


class _Rest:
    """A request whose grasps, loads, obstacles, table and horizon can be left out one by one."""

    def __init__(self, request: PredictionRequest) -> None:
        around = request.environment
        self._first = request
        self._parts: dict[str, Any] = {
            **{f"primitives[{i}]": primitive for i, primitive in enumerate(request.primitives)},
            **{f"loads[{i}]": load for i, load in enumerate(request.loads)},
            **{f"environment.obstacles[{i}]": obstacle for i, obstacle in enumerate(around.obstacles)},
            "environment.table": around.table,
            "horizon": request.horizon,
        }

    def leave_out(self, field: str) -> bool:
        """Leave out the part that contains a field, and return whether there is such a part."""
        path = next((path for path in self._parts if field.startswith(path)), "")
        return self._parts.pop(path, self) is not self

    def request(self) -> PredictionRequest:
        """Return the request without what was left out."""
        around = {"table": self._parts.get("environment.table"), "obstacles": self._those("environment.obstacles")}
        return self._first.model_copy(
            update={
                "primitives": self._those("primitives"),
                "loads": self._those("loads"),
                "environment": self._first.environment.model_copy(update=around),
                "horizon": self._parts.get("horizon", _STILL),
            }
        )

    def in_first_numbers(self, error: SceneError) -> SceneError:
        """Return a fault of `request()` with the parts numbered as in the original request."""

        def number(found: re.Match[str]) -> str:
            left = [path.removeprefix("environment.") for path in self._parts if found[1] in path]
            return left[int(found[2])]

        texts = (error.field, error.given, error.allowed, error.reason)
        return SceneError(*(_NUMBERED.sub(number, text) for text in texts))

    def _those(self, kind: str) -> list[Any]:
        return [part for path, part in self._parts.items() if path.startswith(kind)]
