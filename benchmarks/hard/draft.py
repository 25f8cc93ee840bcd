"""A scene while it is drawn: its parts, still changeable."""

from dataclasses import dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from dlocore import Cable, Environment, Grasp, Load, Move, Quality, Scene
from dlocore.scene.scene import Shape, Switch

Floats = NDArray[np.float64]
Rng = np.random.Generator
Room = Literal["flat", "upright", "space"]  # the x-y plane, the x-z plane, or all directions

PEAK_SPEED = {"minimum_jerk": 1.875, "cubic": 1.5, "linear": 1.0}  # times distance/duration
PEAK_ACCELERATION = {"minimum_jerk": 5.8, "cubic": 6.0, "linear": 0.0}  # times distance/duration^2


@dataclass
class Draft:
    """The parts of a scene, and what its surroundings and its stiffness must suit.

    Attributes:
        length: of the cable [m].
        gravity: its magnitude [m/s^2].
        cable: fields of `Cable`.
        room: directions in which the motion goes.
        families: kinds of hardness, "group: kind".
        splined: whether smooth starts are given by control points.
        speed, acceleration, jump: the largest of the motion [m/s, m/s^2], and the largest jump of its velocity [m/s].
    """

    length: float
    cable: dict[str, Any]
    gravity: float
    shape: Shape | None = None
    grasps: list[Grasp] = field(default_factory=list)
    loads: list[Load] = field(default_factory=list)
    environment: dict[str, Any] = field(default_factory=dict)
    horizon: float = 0.0
    effects: dict[str, Switch] = field(default_factory=dict)
    quality: Quality = field(default_factory=Quality)
    room: Room = "flat"
    families: list[str] = field(default_factory=list)
    splined: bool = False
    speed: float = 0.0
    acceleration: float = 0.0
    jump: float = 0.0

    @property
    def time(self) -> float:
        """Return the unit of all durations [s]: about half the period of the cable's swing."""
        return float(np.sqrt(10.0 * self.length / max(self.gravity, 10.0)))

    @property
    def diameter(self) -> float:
        return float(self.cable["diameter"])

    def scene(self) -> Scene:
        """Return the scene.

        Raises:
            SceneError: the parts do not make a valid scene.
        """
        assert self.shape is not None
        return Scene(
            cable=Cable(length=self.length, **self.cable),
            shape=self.shape,
            grasps=tuple(self.grasps),
            loads=tuple(self.loads),
            environment=Environment(**self.environment),
            horizon=self.horizon,
            effects=self.effects,
            quality=self.quality,
        )

    def move(self, displacement: Floats, duration: float, **changes: Any) -> Move:
        """Return a move, and record how fast it is."""
        path = Move(displacement=displacement, duration=duration, **changes)
        turn = 0.0 if path.rotation is None else float(np.linalg.norm(path.rotation)) * 0.1 * self.length
        way = float(np.linalg.norm(displacement)) + turn
        self.speed = max(self.speed, PEAK_SPEED[path.profile] * way / duration)
        self.acceleration = max(self.acceleration, PEAK_ACCELERATION[path.profile] * way / duration**2)
        if path.profile == "linear":
            self.jump = max(self.jump, way / duration)
        return path

    def slower(self, factor: float) -> None:
        """Scale every displacement by a factor."""
        self.grasps = [
            replace(g, path=replace(g.path, displacement=factor * np.asarray(g.path.displacement)))
            if isinstance(g.path, Move)
            else g
            for g in self.grasps
        ]


def spread(r: Rng, low: float, high: float) -> float:
    """Draw from a range, evenly on a logarithmic scale."""
    return float(np.exp(r.uniform(np.log(low), np.log(high))))


def chance(r: Rng, share: float) -> bool:
    return bool(r.random() < share)


def pick(r: Rng, options: dict[str, float]) -> str:
    """Draw a key with the probability given by its weight."""
    weights = np.array(list(options.values()))
    return list(options)[int(np.searchsorted(np.cumsum(weights / weights.sum()), r.random(), side="right"))]


def in_room(r: Rng, room: Room) -> Floats:
    """Draw a unit vector (3,)."""
    x = r.normal(size=3) * {"flat": [1, 1, 0], "upright": [1, 0, 1], "space": [1, 1, 1]}[room]
    return np.asarray(x / np.linalg.norm(x))
