"""What a named hard case is, and the parts that many of them share."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from benchmarks.premises import Premise, strands_apart
from dlocore import Cable, Environment, Move, Prediction, Quality, Scene
from dlocore.answer.clearance import least_distance

Floats = NDArray[np.float64]
Group = Literal["geometry", "stiffness", "motion", "effects", "numbers"]

WEIGHTLESS = Environment(gravity=(0.0, 0.0, 0.0))
TARGET = 0.005  # of the length: the target error of the cases
DEEPEST = 0.25 * 0.005  # [m]: a quarter of the diameter of a cord


@dataclass(frozen=True, kw_only=True)
class Case:
    """A named hard case.

    Attributes:
        name: in words.
        group: what of it is hard.
        hard: why, in words.
        truth: the true answer, or the laws it must keep, in words.
        make: returns the scene, or raises SceneError where it has to be refused.
        error: distance of a prediction from the true answer, of the length; None where only the laws tell.
        within: that distance at most.
        premise: whether a prediction does what the name promises; None where the scene as given is all of it.
        refused: field that the SceneError names, "" where the case has to converge.
    """

    name: str
    group: Group
    hard: str
    truth: str
    make: Callable[[], Scene]
    error: Callable[[Prediction], float] | None
    within: float
    premise: Premise | None
    refused: str


CASES: dict[str, Case] = {}


def case(
    group: Group,
    truth: str,
    *,
    error: Callable[[Prediction], float] | None = None,
    within: float = TARGET,
    premise: Premise | None = None,
    refused: str = "",
) -> Callable[[Callable[[], Scene]], Callable[[], Scene]]:
    """Enter a scene into the cases under the name of its function; its docstring says what is hard."""

    def enter(make: Callable[[], Scene]) -> Callable[[], Scene]:
        name = make.__name__.replace("_", " ")
        hard = " ".join((make.__doc__ or "").split())
        CASES[name] = Case(
            name=name, group=group, hard=hard, truth=truth, make=make, error=error, within=within, premise=premise,
            refused=refused,
        )  # fmt: skip
        return make

    return enter


def cord(**changes: Any) -> Cable:
    """Return a cord 1 m long and 5 mm thick, with the given fields replaced."""
    values = {"length": 1.0, "diameter": 0.005, "linear_density": 0.05, "bending_stiffness": 1e-3}
    return Cable(**(values | changes))


def move(x: float, y: float, z: float = 0.0, *, time: float = 1.0, **changes: Any) -> Move:
    return Move(displacement=(x, y, z), duration=time, **changes)


def posed(given: Case) -> Scene:
    """Return the scene of a case, with the target error of the cases where it asks for nothing.

    Raises:
        SceneError: the case is one that has to be refused.
    """
    scene = given.make()
    if scene.quality == Quality():
        scene = replace(scene, quality=Quality(target_error=TARGET * scene.cable.length))
    return scene


def at_end(prediction: Prediction, u: Any) -> Floats:
    """Return the positions (k, 3) at the end of the motion."""
    return np.asarray(prediction.surface.positions(u, prediction.surface.horizon)[0])


def samples(prediction: Prediction) -> tuple[Floats, Floats]:
    surface = prediction.surface
    return np.linspace(0.0, surface.length, 65), np.linspace(0.0, surface.horizon, 33)


def depth(prediction: Prediction) -> float:
    """Return how deep the cable is in the table or in an obstacle [m], at the worst; 0 where it is in none."""
    surface, around, radius = prediction.surface, prediction.scene.environment, 0.5 * prediction.scene.cable.diameter
    gaps = [0.0]
    if around.obstacles:
        rows = np.array([obstacle.row() for obstacle in around.obstacles])
        gaps.append(least_distance(surface, rows, 1e-3 * radius) - radius)
    if around.table is not None:
        gaps.append(float(surface.sample(401, 401)[2][..., 2].min()) - around.table.height)  # of the middle
    return -min(gaps)


def overlap(prediction: Prediction) -> float:
    """Return how deep strands are in each other [m], at the worst; 0 where they are apart."""
    return max(0.0, 1.0 - strands_apart(prediction)) * prediction.scene.cable.diameter


def apart(a: Prediction, b: Prediction) -> float:
    """Return the largest distance of two motions of the same cable and horizon [m]."""
    u, t = samples(a)
    return float(np.linalg.norm(a.surface.positions(u, t) - b.surface.positions(u, t), axis=-1).max())
