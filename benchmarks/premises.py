"""What the name of a scene promises, as a premise: whether it happens in the motion that is predicted."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from dlocore import Prediction
from dlocore.problem.strands import nearest_strands

Floats = NDArray[np.float64]
Premise = Callable[[Prediction], bool]

LOOKS = 101  # times at which a motion is looked at
TOUCHING = 1.05  # diameters between the middles of strands that touch
SLIDING = 0.01  # of the largest speed: what is slower sticks


def pressed(prediction: Prediction, name: str) -> Floats:
    """Return how hard the table or an obstacle presses over time (k,) [N]; nothing where it was not simulated."""
    return next((contact.pressed for contact in prediction.contacts if contact.name == name), np.zeros(1))


def touches(*names: str) -> Premise:
    """Return whether each of these presses on the cable at some time: "table" or "obstacles[i]"."""
    return lambda p: all(pressed(p, name).max() > 0.0 for name in names)


def ends_on(*names: str) -> Premise:
    """Return whether each of these presses on the cable at the end."""
    return lambda p: all(pressed(p, name)[-1] > 0.0 for name in names)


def untouched(*names: str) -> Premise:
    """Return whether none of these ever presses on the cable."""
    return lambda p: not any(pressed(p, name).any() for name in names)


def touches_again(name: str) -> Premise:
    """Return whether this presses on the cable, lets go of it and presses again."""
    return lambda p: int((np.diff(pressed(p, name) > 0.0, prepend=False) & (pressed(p, name) > 0.0)).sum()) > 1


def strands_apart(prediction: Prediction) -> float:
    """Return the smallest distance of two strands in the motion, infinite above two diameters [diameters]."""
    surface, diameter = prediction.surface, prediction.scene.cable.diameter
    states = surface.states(np.linspace(0.0, surface.horizon, LOOKS))[..., :3]
    return nearest_strands(surface.knots_u, np.ascontiguousarray(states), 3, diameter, 2.0 * diameter) / diameter


def strands_meet(prediction: Prediction) -> bool:
    """Return whether strands touch, or cross where they may lie over each other."""
    return strands_apart(prediction) < TOUCHING


def largest_bends(prediction: Prediction) -> Floats:
    """Return the largest curvature at each of the times (LOOKS,) [1/m]."""
    u, t, _ = prediction.surface.sample(401, LOOKS)
    return np.asarray(prediction.surface.curvature(u, t).max(axis=1))


def tightens(to: float) -> Premise:
    """Return whether the smallest radius at the end is less than this share of that at the start."""
    return lambda p: bool(largest_bends(p)[0] < to * largest_bends(p)[-1])


def snaps(prediction: Prediction) -> bool:
    """Return whether the cable is ten times as fast at its fastest moment as it mostly is."""
    fastest = _speeds(prediction).max(axis=1)
    return bool(fastest.max() > 10.0 * np.median(fastest))


def yields(prediction: Prediction) -> bool:
    """Return whether sections are bent for good."""
    return prediction.material is not None and bool(prediction.material.memory.any())


def stays_elastic(prediction: Prediction) -> bool:
    """Return whether no section is bent for good."""
    return not yields(prediction)


def _speeds(prediction: Prediction) -> Floats:
    """Return the speeds of points along the cable at each time (LOOKS, 65) [m/s]."""
    surface = prediction.surface
    u, t = np.linspace(0.0, surface.length, 65), np.linspace(0.0, surface.horizon, LOOKS)
    return np.asarray(np.linalg.norm(surface(u, t, dt=1)[..., :3], axis=-1))


def _slides(prediction: Prediction) -> NDArray[np.bool_]:
    """Return which points slide at each time (LOOKS, 65)."""
    speeds = _speeds(prediction)
    return np.asarray(speeds > SLIDING * speeds.max())


def sticks_and_slips(prediction: Prediction) -> bool:
    """Return whether some stick while others slide, for most of the time, and some slide, stick and slide again."""
    slides = _slides(prediction)
    both = slides.any(axis=1) & ~slides.all(axis=1)
    starts = (np.diff(slides.astype(int), axis=0) == 1).sum(axis=0)
    return bool(both.mean() > 0.5 and (starts > 1).any())


def slides_on(prediction: Prediction) -> bool:
    """Return whether some point still slides at the end."""
    return bool(_slides(prediction)[-1].any())


def comes_to_rest(prediction: Prediction) -> bool:
    """Return whether every point has stopped at the end."""
    return not slides_on(prediction)
