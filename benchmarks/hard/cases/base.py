"""What a named hard case is, and the parts that many of them share."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from dlocore import Cable, Environment, Move, Prediction, Quality, Scene

Floats = NDArray[np.float64]
Group = Literal["geometry", "stiffness", "motion", "effects", "numbers"]
End = Literal["converged", "refused"]

WEIGHTLESS = Environment(gravity=(0.0, 0.0, 0.0))
TARGET = 0.005  # of the length: the target error of the cases


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
        end: "converged" or "refused".
    """

    name: str
    group: Group
    hard: str
    truth: str
    make: Callable[[], Scene]
    error: Callable[[Prediction], float] | None
    within: float
    end: End


CASES: dict[str, Case] = {}


def case(
    group: Group,
    truth: str,
    *,
    error: Callable[[Prediction], float] | None = None,
    within: float = TARGET,
    end: End = "converged",
) -> Callable[[Callable[[], Scene]], Callable[[], Scene]]:
    """Enter a scene into the cases under the name of its function; its docstring says what is hard."""

    def enter(make: Callable[[], Scene]) -> Callable[[], Scene]:
        name = make.__name__.replace("_", " ")
        hard = " ".join((make.__doc__ or "").split())
        CASES[name] = Case(
            name=name, group=group, hard=hard, truth=truth, make=make, error=error, within=within, end=end
        )
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
