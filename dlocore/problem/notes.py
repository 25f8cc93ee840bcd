"""What is to be known of a scene as it was given, whatever its motion."""

import math
from typing import cast

from dlocore.scene.scene import Points, Scene
from dlocore.shape.shape import start_curve
from dlocore.words import in_mm

LIGHTEST = 0.1  # [kg/m^3] of a cable: a tenth of air
SAME_LENGTH = 5e-3  # of the cable's: lengths of points that differ by less are as good as the same
SAME_ENDS = 1e-3  # of the length: and so are ends, as those of noisy points, which the cable's length decides about


def scene_notes(scene: Scene) -> list[str]:
    """Return what is to be known of a scene as it was given, in words."""
    return [*cable_notes(scene), *_of_times(scene)]


def cable_notes(scene: Scene) -> list[str]:
    """Return what is to be known of a scene's cable and how it lies, in words."""
    return [*_of_units(scene), *_of_lengths(scene)]


def _of_units(scene: Scene) -> list[str]:
    """Return what is told of a cable that is lighter than air, as one with its lengths in millimetres is."""
    cable = scene.cable
    density = cable.linear_density / (0.25 * math.pi * cable.diameter**2)
    if density >= LIGHTEST:
        return []
    thick = f"{cable.diameter:g} m thick and weighs {cable.linear_density:g} kg/m"
    return [f"the cable is {thick}, which is less than air does: are its length and diameter in millimetres?"]


def _of_lengths(scene: Scene) -> list[str]:
    """Return what is told of points that were made as long as the cable."""
    if not isinstance(scene.shape, Points):
        return []
    length = scene.cable.length
    start = start_curve(scene.shape, length)
    differ = abs(start.length_given - length) > SAME_LENGTH * length
    if not (differ and start.ends_moved > SAME_ENDS * length):
        return []
    return [
        f"the points of the shape are {start.length_given:.4g} m long and the cable {length:.4g} m: they are scaled "
        f"to it about their middle, which moves an end by up to {in_mm(start.ends_moved)}, and a gripper that holds it"
    ]


def _of_times(scene: Scene) -> list[str]:
    """Return what is told of grippers that would close when the motion is over."""
    horizon = cast(float, scene.horizon)
    return [
        f"primitives[{i}] never holds the cable: it closes at {grasp.start:g} s and the horizon is {horizon:g} s"
        for i, grasp in enumerate(scene.grasps)
        if grasp.start >= horizon
    ]
