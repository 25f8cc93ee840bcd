"""Predict the motion of a manipulated cable as one bivariate spline over material coordinate and time."""

from typing import TYPE_CHECKING, Any

from dlocore.answer.parts import (
    Accuracy,
    ContactForce,
    EffectReport,
    GraspReaction,
    Iteration,
    MaterialMotion,
    StretchMotion,
)
from dlocore.errors import Cancelled, DloError, SceneError
from dlocore.prediction import Prediction, continued
from dlocore.recordings import Recording, load_recording, save_recording
from dlocore.scene.cable import PRESETS, Cable, PointMass
from dlocore.scene.obstacles import Box, Capsule, Cylinder, Sphere
from dlocore.scene.paths import Move, Still, Waypoints
from dlocore.scene.scene import (
    ControlPoints,
    Environment,
    Grasp,
    Load,
    Material,
    Points,
    Quality,
    Scene,
    Straight,
    Table,
)
from dlocore.spline import SplineSurface

if TYPE_CHECKING:
    from dlocore.balance import effect_forces, energies
    from dlocore.front import predict
    from dlocore.many import predict_many
    from dlocore.planning import Plan, plan
    from dlocore.sensitivity import Sensitivities, sensitivities
    from dlocore.statics.statics import Equilibrium, equilibrium
    from dlocore.warming import warm_up

__all__ = [
    "PRESETS",
    "Accuracy",
    "Box",
    "Cable",
    "Cancelled",
    "Capsule",
    "ContactForce",
    "ControlPoints",
    "Cylinder",
    "DloError",
    "EffectReport",
    "Environment",
    "Equilibrium",
    "Grasp",
    "GraspReaction",
    "Iteration",
    "Load",
    "Material",
    "MaterialMotion",
    "Move",
    "Plan",
    "PointMass",
    "Points",
    "Prediction",
    "Quality",
    "Recording",
    "Scene",
    "SceneError",
    "Sensitivities",
    "Sphere",
    "SplineSurface",
    "Still",
    "Straight",
    "StretchMotion",
    "Table",
    "Waypoints",
    "continued",
    "effect_forces",
    "energies",
    "equilibrium",
    "load_recording",
    "plan",
    "predict",
    "predict_many",
    "save_recording",
    "sensitivities",
    "warm_up",
]

# modules of the names that are imported on first use
_HOMES = {
    "Equilibrium": "statics.statics",
    "Plan": "planning",
    "Sensitivities": "sensitivity",
    "effect_forces": "balance",
    "energies": "balance",
    "equilibrium": "statics.statics",
    "plan": "planning",
    "predict": "front",
    "predict_many": "many",
    "sensitivities": "sensitivity",
    "warm_up": "warming",
}


def __getattr__(name: str) -> Any:
    """Import the solver on first use: its compiler takes longer to import than the rest of the package together."""
    if name not in _HOMES:
        raise AttributeError(name)
    import importlib

    found = getattr(importlib.import_module(f"dlocore.{_HOMES[name]}"), name)
    globals()[name] = found  # later look-ups do not come here
    return found


def __dir__() -> list[str]:
    """Return all public names, so that completion also offers those that are imported on first use."""
    return __all__
