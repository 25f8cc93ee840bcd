"""Convert a valid request to the solver's scene."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any, NamedTuple

from app.schemas.cable import CableModel
from app.schemas.primitives import ForceOverTime, LoadModel, MovePath, PrimitiveModel, StillPath, WaypointsPath
from app.schemas.request import PredictionRequest
from app.schemas.shape import (
    ControlVelocities,
    PointsShape,
    PointVelocities,
    PredictionShape,
    StraightShape,
)
from app.schemas.surroundings import EnvironmentModel, ObstacleModel, QualityModel
from dlocore import (
    Box,
    Cable,
    Capsule,
    ControlPoints,
    Cylinder,
    Environment,
    Grasp,
    Load,
    MaterialMotion,
    Move,
    PointMass,
    Points,
    Quality,
    Scene,
    SceneError,
    Sphere,
    SplineSurface,
    Still,
    Straight,
    StretchMotion,
    Table,
    Waypoints,
    continued,
)
from dlocore.errors import within
from dlocore.scene.obstacles import Obstacle
from dlocore.scene.paths import Path
from dlocore.scene.scene import Shape, load_times
from dlocore.words import counted


class Motion(NamedTuple):
    """A predicted motion: its surface, what the sections of the cable remember (None: nothing), and its stretch.

    The stretch is None for a run that was stored before stretch was recorded.
    """

    surface: SplineSurface
    material: MaterialMotion | None
    stretch: StretchMotion | None


# Finds the motion of a stored prediction by its id; None if there is no such prediction.
StoredMotion = Callable[[str], Motion | None]


def to_scene(request: PredictionRequest, stored: StoredMotion) -> Scene:
    """Return the scene that `request` describes.

    Args:
        request: the valid request.
        stored: finds the motion that a shape of kind "prediction" continues from.

    Raises:
        SceneError: the scene is impossible; its field is the path in the request.
    """
    with within("cable"):
        cable = cable_of(request.cable)
    effects = request.effects if isinstance(request.effects, str) else request.effects.model_dump()
    return Scene(
        cable=cable,
        shape=shape_of(request, cable, stored),
        grasps=tuple(grasp_of(i, primitive) for i, primitive in enumerate(request.primitives)),
        loads=tuple(load_of(i, load) for i, load in enumerate(request.loads)),
        environment=environment_of(request.environment),
        horizon=request.horizon,
        effects={} if isinstance(effects, str) else effects,
        quality=quality_of(request.quality),
    )


def cable_of(model: CableModel) -> Cable:
    """Return the cable of the solver, or raise SceneError."""
    values = model.model_dump(exclude={"preset", "point_masses"}, exclude_none=True, exclude_unset=True)
    values["point_masses"] = [PointMass(u=one.u, mass=one.mass) for one in model.point_masses]
    if isinstance(model.rest_shape, list):
        check_columns("rest_shape", model.rest_shape)
    if model.preset is not None:
        return Cable.preset(model.preset, **values)
    for name in ("length", "diameter", "linear_density"):
        if name not in values:
            raise SceneError(name, None, f"{CableModel.model_fields[name].description} Or a preset", "It is missing")
    return Cable(**values)


def shape_of(request: PredictionRequest, cable: Cable, stored: StoredMotion) -> Shape:
    """Return the start shape of the solver, or raise SceneError."""
    model = request.shape
    if isinstance(model, PredictionShape):
        return _continued(model, cable, stored)
    with within("shape"):
        if isinstance(model, StraightShape):
            velocity = _velocity(model.velocity, "points")
            return Straight(start=model.start, direction=model.direction, settle=model.settle, velocity=velocity)
        if isinstance(model, PointsShape):
            check_columns("points", model.points)
            return Points(points=model.points, settle=model.settle, velocity=_velocity(model.velocity, "points"))
        check_columns("control_points", model.control_points)
        return ControlPoints(
            control_points=model.control_points,
            knots=model.knots,
            settle=model.settle,
            velocity=_velocity(model.velocity, "control_points"),
            strain=model.strain,
        )


def check_columns(name: str, rows: list[list[float]]) -> None:
    """Raise SceneError for the first row of the field `name` whose length differs from that of row 0."""
    columns = len(rows[0])
    for i, row in enumerate(rows):
        if len(row) != columns:
            raise SceneError(f"{name}[{i}]", row, f"{columns} numbers, as in the first one")


def _velocity(value: Any, kind: str) -> Any:
    """Return the velocity as one vector or as rows; `kind` is the kind of velocities that the shape takes."""
    if not isinstance(value, PointVelocities | ControlVelocities):
        return value
    if value.kind != kind:
        raise SceneError("velocity.kind", value.kind, f'"{kind}" with this shape')
    if isinstance(value, PointVelocities):
        return value.points
    check_columns("velocity.control_points", value.control_points)
    return value.control_points


def _continued(model: PredictionShape, cable: Cable, stored: StoredMotion) -> ControlPoints:
    motion = stored(model.id)
    if motion is None:
        raise SceneError("shape.id", model.id, "the id of a stored prediction", "There is no such prediction")
    surface = motion.surface
    if not abs(surface.length - cable.length) <= 1e-9 * cable.length:
        reason = "A continued cable keeps its length"
        raise SceneError("cable.length", cable.length, f"{surface.length:g} [m], as in that prediction", reason)
    if model.t is not None and not model.t <= surface.horizon:
        raise SceneError("shape.t", model.t, f"0 to the end of that prediction, {surface.horizon:g} [s]")
    with within("shape"):
        start = continued(surface, motion.material, model.t, stretch=motion.stretch)
        return replace(start, settle=model.settle)


def grasp_of(i: int, model: PrimitiveModel) -> Grasp:
    """Return the grasp `i` of the solver, or raise SceneError."""
    with within(f"primitives[{i}]"):
        with within("path"):
            path = _path(model.path)
        return Grasp(
            u=model.u, path=path, hold=model.hold, grasp_time=model.grasp_time, release_time=model.release_time
        )


def _path(model: StillPath | MovePath | WaypointsPath) -> Path:
    if isinstance(model, StillPath):
        return Still()
    if isinstance(model, MovePath):
        return Move(
            displacement=model.displacement, duration=model.duration, rotation=model.rotation, profile=model.profile
        )
    return Waypoints(
        times=model.times, positions=model.positions, orientations=model.orientations, start=model.start,
        profile=model.profile,
    )  # fmt: skip


def load_of(i: int, model: LoadModel) -> Load:
    """Return the load `i` of the solver, or raise SceneError."""
    prefix = f"loads[{i}]"
    if not isinstance(model.force, ForceOverTime):
        with within(prefix):
            return Load(u=model.u, force=model.force)
    count, values = len(model.force.times), model.force.values
    if count != len(values):
        raise SceneError(f"{prefix}.force.values", counted(len(values), "force"), f"as many as times ({count})")
    times = load_times(f"{prefix}.force.times", model.force.times)
    with within(prefix):
        return Load(u=model.u, force=values, times=times)


def environment_of(model: EnvironmentModel) -> Environment:
    """Return the environment of the solver, or raise SceneError."""
    table = None
    if model.table is not None:
        with within("environment.table"):
            table = Table(height=model.table.height, friction=model.table.friction)
    obstacles = tuple(obstacle_of(i, obstacle) for i, obstacle in enumerate(model.obstacles))
    with within("environment"):
        return Environment(
            gravity=model.gravity,
            drag=model.drag,
            drag_quadratic=model.drag_quadratic,
            table=table,
            obstacles=obstacles,
        )


OBSTACLES: dict[str, type[Obstacle]] = {"sphere": Sphere, "capsule": Capsule, "cylinder": Cylinder, "box": Box}


def obstacle_of(i: int, model: ObstacleModel) -> Obstacle:
    """Return the obstacle `i` of the solver, or raise SceneError."""
    with within(f"environment.obstacles[{i}]"):
        return OBSTACLES[model.kind](**model.model_dump(exclude={"kind"}))


def quality_of(model: str | QualityModel) -> Quality:
    """Return the requested quality of the solver, or raise SceneError."""
    if isinstance(model, str):
        return Quality()
    with within("quality"):
        return Quality(**model.model_dump())
