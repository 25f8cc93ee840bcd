"""Scenes in which no cable follows its grippers, as it is too short to go around an obstacle."""

from dataclasses import replace
from typing import cast

import numpy as np

from dlocore import Prediction, Quality, Scene, SceneError, predict

TOO_SHORT = 0.01  # mean strain of a cable that hardly anything else stretches
_SOFT = 20.0  # times all other forces is what stretches it so: a span that is nearly straight bears some of them


def words_if_too_short(prediction: Prediction, scene: Scene, deadline: float) -> str:
    """Return how much too short the cable is for the way that its grippers give it, "" where it is not.

    A cable as soft along itself as twenty times its weight, drag, inertia and bending forces stretch by TOO_SHORT
    gives way where it has to. What is stretched by more, as a mean over its length, has no other way to go: one that is
    stiff tears, or goes through what it is pulled against. Only stalled motions with obstacles are asked.
    """
    if prediction.status != "stalled" or not scene.environment.obstacles or len(scene.grasps) < 2:
        return ""
    cable = scene.cable
    stiffness = _SOFT / TOO_SHORT * _forces(scene)
    if not stiffness < cast(float, cable.axial_stiffness):
        return ""
    soft = replace(cable, axial_stiffness=stiffness, axial_damping=None)
    quality = Quality(target_error=0.01 * cable.length)
    try:
        found = predict(replace(scene, cable=soft, quality=quality), deadline=deadline)
    except SceneError:
        return ""
    if found.status != "converged":
        return ""
    u, t = np.linspace(0.0, cable.length, 401), np.linspace(0.0, found.surface.horizon, 257)
    lengths = np.linalg.norm(np.diff(found.surface.positions(u, t), axis=1), axis=2).sum(axis=1)
    strain = float(lengths.max()) / cable.length - 1.0
    return f"a cable {stiffness:.2g} N stiff along itself is stretched by {strain:.1%}" if strain > TOO_SHORT else ""


def _forces(scene: Scene) -> float:
    """Return what the forces on a cable add up to, but for those of its grippers [N], about."""
    cable, around = scene.cable, scene.environment
    length, time = cable.length, cast(float, scene.horizon)
    t = np.linspace(0.0, time, 257)
    steps = [np.linalg.norm(np.diff(g.path.at(t, np.zeros(3)), axis=0), axis=1).max() for g in scene.grasps]
    speed = 2.0 * max(length / time, float(max(steps)) / float(t[1]))
    gravity = float(np.linalg.norm(np.asarray(around.gravity)))
    drag = (around.drag + around.drag_quadratic * speed) * speed
    spread = cable.linear_density * (gravity + 2.0 * speed / time) + drag
    return length * spread + cast(float, cable.bending_stiffness) / length**2
