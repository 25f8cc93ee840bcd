"""The scene as a person edits it: plain numbers, valid or not, and the two forms made of them.

`scene()` raises `SceneError` where the numbers make no possible scene; the draft itself never does, so that a half
finished edit is kept on the panel while the last good prediction stays in the picture.
"""

import math
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from dlocore import (
    PRESETS,
    Box,
    Cable,
    Capsule,
    Cylinder,
    Environment,
    Grasp,
    Move,
    Quality,
    Scene,
    Sphere,
    Still,
    Straight,
    Table,
)
from dlocore.obstacles import Obstacle

REACH_SHARE = 0.9  # of the cable between two grippers, when the target is brought near
GRAVITY = (0.0, 0.0, -9.81)
PROFILE: Literal["minimum_jerk"] = "minimum_jerk"
QualityMode = Literal["automatic", "target error", "grid"]
ObstacleKind = Literal["none", "cylinder", "box", "sphere", "capsule"]
Vector = tuple[float, float, float]


@dataclass(frozen=True, kw_only=True)
class CableDraft:
    """The cable's values in SI units; EA and GJ are those of the preset, or follow from EI where it has none."""

    length: float
    diameter: float
    linear_density: float
    bending_stiffness: float
    axial_stiffness: float | None = None
    torsional_stiffness: float | None = None

    @staticmethod
    def preset(name: str) -> "CableDraft":
        """Return the values of the preset `name`."""
        return CableDraft(**PRESETS[name].values)

    def values(self) -> dict[str, float]:
        """Return the fields that are given, by their names in the contract."""
        return {name: value for name, value in vars(self).items() if value is not None}


@dataclass(frozen=True, kw_only=True)
class GraspDraft:
    """A gripper at material coordinate `u` [m] that moves by `displacement` [m], or stays where it is (None)."""

    u: float
    displacement: Vector | None = None


@dataclass(frozen=True, kw_only=True)
class ObstacleDraft:
    """An obstacle of a fixed size at (x, y) [m] on the table, or none.

    Round ones are sunk to half their height, so that the cable meets them where they are widest.
    """

    kind: ObstacleKind = "none"
    x: float = 0.55
    y: float = 0.2

    def json(self, height: float) -> dict[str, Any] | None:
        """Return it as in the contract, for a cable that lies at `height` [m]."""
        x, y = self.x, self.y
        bodies: dict[str, dict[str, Any]] = {
            "cylinder": {"center": [x, y, height + 0.05], "axis": [0.0, 0.0, 1.0], "radius": 0.03, "height": 0.12},
            "box": {"center": [x, y, height + 0.03], "size": [0.1, 0.06, 0.08]},
            "sphere": {"center": [x, y, height], "radius": 0.04},
            "capsule": {"start": [x - 0.08, y, height], "end": [x + 0.08, y, height], "radius": 0.025},
        }
        return {"kind": self.kind, **bodies[self.kind]} if self.kind in bodies else None

    def solid(self, height: float) -> Obstacle | None:
        """Return it for the solver, for a cable that lies at `height` [m]."""
        types: dict[str, type[Obstacle]] = {"cylinder": Cylinder, "box": Box, "sphere": Sphere, "capsule": Capsule}
        body = self.json(height)
        return None if body is None else types[body.pop("kind")](**body)


@dataclass(frozen=True, kw_only=True)
class QualityDraft:
    """The asked quality: automatic, an error [m] at the worst point, or a grid of control points."""

    mode: QualityMode = "automatic"
    target_error: float = 0.002
    n_u: int = 9
    n_t: int = 13
    delta: float = 1e-5

    def quality(self) -> Quality:
        """Return it for the solver."""
        if self.mode == "target error":
            return Quality(target_error=self.target_error)
        return Quality(n_u=self.n_u, n_t=self.n_t, delta=self.delta) if self.mode == "grid" else Quality()

    def json(self) -> Any:
        """Return it as in the contract."""
        if self.mode == "target error":
            return {"target_error": self.target_error}
        return {"n_u": self.n_u, "n_t": self.n_t, "delta": self.delta} if self.mode == "grid" else "auto"


@dataclass(frozen=True, kw_only=True)
class Draft:
    """A straight cable along x on a table, its grippers and its surroundings.

    Attributes:
        grasps: the first is the one whose target is dragged.
        duration: of every move [s].
        drag: linear, per unit length [N s/m^2].
        table_height: of the centreline of a cable lying on it [m].
        table_friction: coefficient of friction.
    """

    cable: CableDraft
    grasps: tuple[GraspDraft, ...]
    duration: float = 1.6
    drag: float = 0.05
    table_height: float = 0.0
    table_friction: float = 0.0
    obstacle: ObstacleDraft = field(default_factory=ObstacleDraft)
    quality: QualityDraft = field(default_factory=QualityDraft)

    @property
    def target(self) -> Vector:
        """Where the first grasp ends [m]."""
        grasp = self.grasps[0]
        dx, dy, dz = grasp.displacement or (0.0, 0.0, 0.0)
        return (grasp.u + dx, dy, self.table_height + dz)

    def with_target(self, x: float, y: float) -> "Draft":
        """Move the first grasp's target to (x, y) [m] on the table."""
        return self.with_grasp(displacement=(x - self.grasps[0].u, y, 0.0))

    def with_grasp(self, **changes: Any) -> "Draft":
        """Change fields of the first grasp."""
        return replace(self, grasps=(replace(self.grasps[0], **changes), *self.grasps[1:]))

    def with_held_end(self, held: bool) -> "Draft":
        """Hold the end u = L still by a second gripper, or let it go."""
        return replace(self, grasps=self.grasps[:1] + ((GraspDraft(u=self.cable.length),) if held else ()))

    def with_target_in_reach(self) -> "Draft":
        """Bring the target near enough to a held end that the cable between them can follow."""
        if not self.end_is_held:
            return self
        end, (x, y, _) = self.grasps[1].u, self.target
        reach = REACH_SHARE * (end - self.grasps[0].u)
        shrink = min(1.0, reach / max(math.hypot(x - end, y), 1e-9))
        return self.with_target(end + shrink * (x - end), shrink * y)

    def with_obstacle(self, **changes: Any) -> "Draft":
        """Change fields of the obstacle; a new one asks for automatic quality: few fixed grids resolve a contact."""
        obstacle = replace(self.obstacle, **changes)
        new = obstacle.kind not in ("none", self.obstacle.kind)
        return replace(
            self, obstacle=obstacle, quality=replace(self.quality, mode="automatic") if new else self.quality
        )

    @property
    def end_is_held(self) -> bool:
        """Whether a second gripper holds the end."""
        return len(self.grasps) > 1

    def with_cable(self, cable: CableDraft) -> "Draft":
        """Replace the cable; a held end stays the end."""
        return replace(self, cable=cable).with_held_end(self.end_is_held)

    def scene(self, quality: Quality | None = None) -> Scene:
        """Return the scene for the solver, with another `quality` where one is given.

        Raises:
            SceneError: the numbers make no possible scene.
        """
        return Scene(
            cable=Cable(**self.cable.values()),
            shape=Straight(start=(0.0, 0.0, self.table_height), direction=(1.0, 0.0, 0.0)),
            grasps=tuple(self._grasp(grasp) for grasp in self.grasps),
            environment=self._environment(),
            horizon=self.duration,
            quality=self.quality.quality() if quality is None else quality,
        )

    def _environment(self) -> Environment:
        obstacle = self.obstacle.solid(self.table_height)
        return Environment(
            gravity=GRAVITY,
            drag=self.drag,
            table=Table(height=self.table_height, friction=self.table_friction),
            obstacles=() if obstacle is None else (obstacle,),
        )

    def _grasp(self, grasp: GraspDraft) -> Grasp:
        if grasp.displacement is None:
            return Grasp(u=grasp.u, path=Still())
        return Grasp(u=grasp.u, path=Move(displacement=grasp.displacement, duration=self.duration, profile=PROFILE))

    def json(self) -> dict[str, Any]:
        """Return the scene as the JSON that `POST /v1/predictions` takes."""
        obstacle = self.obstacle.json(self.table_height)
        return {
            "cable": self.cable.values(),
            "shape": {"kind": "straight", "start": [0.0, 0.0, self.table_height], "direction": [1.0, 0.0, 0.0]},
            "primitives": [self._primitive(grasp) for grasp in self.grasps],
            "environment": {
                "gravity": list(GRAVITY),
                "drag": self.drag,
                "table": {"height": self.table_height, "friction": self.table_friction},
                "obstacles": [] if obstacle is None else [obstacle],
            },
            "horizon": self.duration,
            "quality": self.quality.json(),
        }

    def _primitive(self, grasp: GraspDraft) -> dict[str, Any]:
        if grasp.displacement is None:
            return {"u": grasp.u, "hold": "point", "path": {"kind": "still"}}
        path = {
            "kind": "move",
            "displacement": list(grasp.displacement),
            "duration": self.duration,
            "profile": PROFILE,
        }
        return {"u": grasp.u, "hold": "point", "path": path}


def start_draft() -> Draft:
    """Return the paper's case: a straight cable of 1 m, grasped at u = 0.25 m and moved 0.5 m sideways in 1.6 s."""
    return Draft(
        cable=CableDraft.preset("paper"),
        grasps=(GraspDraft(u=0.25, displacement=(0.0, 0.5, 0.0)),),
        quality=QualityDraft(mode="grid", n_u=9, n_t=13),
    )
