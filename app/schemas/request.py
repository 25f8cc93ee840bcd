"""The request of ``POST /v1/predictions``, with examples."""

from typing import Any

from fastapi.openapi.models import Example
from pydantic import Field

from app.schemas.base import Model, Number
from app.schemas.cable import CableModel
from app.schemas.primitives import LoadModel, PrimitiveModel
from app.schemas.shape import ShapeModel
from app.schemas.surroundings import Effects, EnvironmentModel, OutputModel, Quality
from dlocore.scene.scene import MAX_GRASPS

MAX_LOADS = 1000


class PredictionRequest(Model):
    """A scene and what to predict of it. SI units: metres, seconds, radians, newtons, kilograms."""

    name: str = Field(
        default="",
        max_length=200,
        description="Name of the run in lists; `GET /v1/predictions?name=` finds it.",
        examples=["Lay the cable along the wall"],
    )
    cable: CableModel = Field(description="The cable.")
    shape: ShapeModel = Field(description="Where the cable is at t = 0.")
    primitives: list[PrimitiveModel] = Field(
        default=[], max_length=MAX_GRASPS, description="The grippers, one for each grasp."
    )
    loads: list[LoadModel] = Field(default=[], max_length=MAX_LOADS, description="Known forces.")
    environment: EnvironmentModel = Field(default=EnvironmentModel(), description="Gravity, drag, table, obstacles.")
    horizon: Number | None = Field(
        default=None,
        gt=1e-4,
        le=1e4,
        description="Predicted time [s]; absent: until the last path ends, the last grasp opens and "
        "the last load is given.",
        examples=[2.5],
    )
    effects: Effects = Field(default="auto", description="Which effects to simulate.", examples=["auto"])
    quality: Quality = Field(default="auto", description="Requested accuracy, grid or time.", examples=["auto"])
    output: OutputModel = Field(default=OutputModel(), description="Sampling of the answer.")


_WIRE = {
    "length": 1.0,
    "diameter": 0.005,
    "linear_density": 0.05,
    "bending_stiffness": 1e-3,
    "axial_stiffness": 640.0,
    "torsional_stiffness": 1e-3,
}
PAPER: dict[str, Any] = {
    "cable": _WIRE,
    "shape": {"kind": "straight", "start": [0, 0, 0], "direction": [1, 0, 0]},
    "primitives": [
        {
            "u": 0.25,
            "hold": "point",
            "path": {"kind": "move", "displacement": [0, 0.5, 0], "duration": 1.6, "profile": "minimum_jerk"},
        }
    ],
    "environment": {"gravity": [0, 0, -9.81], "drag": 0.05, "table": {"height": 0.0, "friction": 0.0}},
    "quality": {"n_u": 9, "n_t": 13, "delta": 1e-5},
    "output": {"samples_u": 101, "samples_t": 33},
}
_HANGING: dict[str, Any] = {
    "cable": _WIRE,
    "shape": {
        "kind": "points",
        "settle": True,
        "points": [
            [0.0, 0.0, 0.0],
            [0.067, 0.0, -0.039],
            [0.115, 0.0, -0.115],
            [0.153, 0.0, -0.185],
            [0.201, 0.0, -0.249],
            [0.273, 0.0, -0.303],
            [0.35, 0.0, -0.32],
            [0.427, 0.0, -0.303],
            [0.499, 0.0, -0.249],
            [0.547, 0.0, -0.185],
            [0.585, 0.0, -0.115],
            [0.633, 0.0, -0.039],
            [0.7, 0.0, 0.0],
        ],
    },
    "primitives": [
        {"u": 0.0, "hold": "clamp", "path": {"kind": "still"}},
        {
            "u": 1.0,
            "hold": "clamp",
            "path": {"kind": "move", "displacement": [-0.2, 0.2, 0.1], "duration": 1.0, "profile": "minimum_jerk"},
        },
    ],
    "environment": {"gravity": [0, 0, -9.81], "drag": 0.1, "table": None},
    "quality": {"target_error": 0.002},
}
_FRICTION: dict[str, Any] = {
    "cable": {
        "length": 0.8,
        "diameter": 0.006,
        "linear_density": 0.06,
        "youngs_modulus": 2.0e7,
        "shear_modulus": 7.0e6,
        "yield_strain": 0.01,
        "memory_rate": 50.0,
        "rest_shape": "initial",
    },
    "shape": {
        "kind": "points",
        "points": [
            [0.02, 0.01],
            [0.13, 0.06],
            [0.24, 0.05],
            [0.36, -0.01],
            [0.47, -0.03],
            [0.58, 0.02],
            [0.68, 0.09],
            [0.74, 0.13],
        ],
    },
    "primitives": [
        {
            "u": 0.4,
            "hold": "tangent",
            "path": {
                "kind": "move",
                "displacement": [0.05, 0.25, 0],
                "rotation": [0, 0, 0.8],
                "duration": 2.0,
                "profile": "minimum_jerk",
            },
            "release_time": 2.0,
        }
    ],
    "environment": {
        "gravity": [0, 0, -9.81],
        "drag": 0.0,
        "table": {"height": 0.0, "friction": 0.3},
        "obstacles": [{"kind": "cylinder", "center": [0.55, 0.2, 0], "axis": [0, 0, 1], "radius": 0.02, "height": 0.1}],
    },
    "horizon": 2.5,
}


TWO_GRIPPERS = {**_HANGING, "primitives": [{**grasp, "hold": "tangent"} for grasp in _HANGING["primitives"]]}
EXAMPLES: dict[str, Example] = {
    "paper": {"summary": "The paper's Fig. 1: a straight cable on a table, one grasp", "value": PAPER},
    "two-grippers": {"summary": "A hanging cable between two grippers", "value": TWO_GRIPPERS},
    "two-clamps": {"summary": "The same with clamps, which hold the twist too", "value": _HANGING},
    "friction": {
        "summary": "A bent cable on a table with friction, an obstacle and plasticity",
        "value": _FRICTION,
    },
}
