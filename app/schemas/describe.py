"""Convert the solver's scene to the request that describes it."""

from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from app.schemas.convert import OBSTACLES
from app.schemas.request import MAX_LOADS
from dlocore import Cable, ControlPoints, Load, Move, Points, Scene, SceneError, Still, Straight, Waypoints

_KINDS: dict[type, str] = {
    Straight: "straight",
    Points: "points",
    ControlPoints: "control_points",
    Still: "still",
    Move: "move",
    Waypoints: "waypoints",
    **{obstacle: kind for kind, obstacle in OBSTACLES.items()},
}


def from_scene(scene: Scene) -> dict[str, Any]:
    """Return the request that describes a scene, ready for JSON; `to_scene` turns it back into the same scene.

    `POST /v1/predictions` and `dlo predict` take it, and the 3D scene opens it from a file.

    Raises:
        SceneError: the scene has what a request can't express: a `shape.material` (the service takes it from the stored
            prediction that a shape of kind "prediction" names), a `quality.estimate` of False, or more `loads` than a
            request may have.
    """
    if isinstance(scene.shape, ControlPoints) and scene.shape.material is not None:
        allowed = 'None; a shape of kind "prediction" continues a stored prediction with its material'
        raise SceneError("shape.material", "a material", allowed)
    if not scene.quality.estimate:
        raise SceneError("quality.estimate", False, "True: every answer of the service has an error estimate")
    if len(scene.loads) > MAX_LOADS:
        raise SceneError("loads", f"{len(scene.loads)} loads", f"at most {MAX_LOADS}")
    return {
        "cable": from_cable(scene.cable),
        "shape": _shape(scene.shape),
        "primitives": [_plain(grasp) for grasp in scene.grasps],
        "loads": [_load(load) for load in scene.loads],
        "environment": _plain(scene.environment),
        "horizon": scene.horizon,
        "effects": dict(scene.effects),
        "quality": {name: value for name, value in _plain(scene.quality).items() if name != "estimate"},
    }


def from_cable(cable: Cable) -> dict[str, Any]:
    """Return a cable in the form that requests use, ready for JSON."""
    described: dict[str, Any] = _plain(cable)
    return described


def _plain(value: Any) -> Any:
    """Return a part of a scene as numbers, words, lists and objects, without the fields that are None."""
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, tuple | list):
        return [_plain(part) for part in value]
    if not is_dataclass(value):
        return value
    named = {"kind": _KINDS[type(value)]} if type(value) in _KINDS else {}
    given = {field.name: getattr(value, field.name) for field in fields(value)}
    return {**named, **{name: _plain(part) for name, part in given.items() if part is not None}}


def _shape(shape: Straight | Points | ControlPoints) -> dict[str, Any]:
    """Return a shape; velocities that include the rate of an angle are written as control points."""
    described: dict[str, Any] = _plain(shape)
    if np.ndim(described.get("velocity", 0.0)) == 2 and len(described["velocity"][0]) == 4:
        described["velocity"] = {"kind": "control_points", "control_points": described["velocity"]}
    return described


def _load(load: Load) -> dict[str, Any]:
    force = _plain(load.force)
    over_time = {"times": _plain(load.times), "values": force}
    return {"u": load.u, "force": force if load.times is None else over_time}
