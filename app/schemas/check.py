"""Everything that is wrong with a scene, where converting it would stop at the first fault."""

from collections.abc import Callable, Iterable
from functools import partial

from app.schemas import convert
from app.schemas.request import PredictionRequest
from dlocore import SceneError
from dlocore.errors import within


def scene_errors(request: PredictionRequest, stored: convert.StoredMotion) -> list[SceneError]:
    """Return what is wrong with each part of a request; faults of parts that contradict each other come last.

    Args:
        request: the valid request.
        stored: finds the motion that a shape of kind "prediction" continues from.
    """
    found: dict[str, SceneError] = {}
    parts: list[Callable[[], object]] = [*_parts(request, stored), partial(convert.to_scene, request, stored)]
    for part in parts:
        try:
            part()
        except SceneError as error:
            found.setdefault(error.field, error)
    return list(found.values())


def _parts(request: PredictionRequest, stored: convert.StoredMotion) -> Iterable[Callable[[], object]]:
    def cable() -> object:
        with within("cable"):
            return convert.cable_of(request.cable)

    def shape() -> object:
        try:
            known = convert.cable_of(request.cable)
        except SceneError:  # told by `cable`
            return None
        return convert.shape_of(request, known, stored)

    yield cable
    yield shape
    for i, primitive in enumerate(request.primitives):
        yield partial(convert.grasp_of, i, primitive)
    for i, load in enumerate(request.loads):
        yield partial(convert.load_of, i, load)
    for i, obstacle in enumerate(request.environment.obstacles):
        yield partial(convert.obstacle_of, i, obstacle)
    yield partial(convert.environment_of, request.environment)
    yield partial(convert.quality_of, request.quality)
