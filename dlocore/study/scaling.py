"""Cost against the size of a problem: control points, horizon, grasps; and cost by effect."""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from dlocore.scene.obstacles import Cylinder
from dlocore.scene.paths import Move, Waypoints
from dlocore.scene.scene import Environment, Grasp, Method, Points, Quality, Scene, Straight, Switch, Table
from dlocore.study.scenes import hanging, paper_case, plain_cord

N_U: dict[Method, tuple[int, ...]] = {
    "march": (9, 13, 17, 25, 33, 49, 65, 97, 129),
    "spacetime": (9, 13, 17, 25, 33, 49, 65),  # beyond, a solve takes minutes
}
N_T = (13, 25, 49, 97, 193, 385)
HORIZONS = (2.0, 4.0, 8.0, 16.0, 32.0)  # [s]
GRASPS = (1, 2, 4, 8, 16)
_EFFECT_GRID = {"n_u": 17, "n_t": 25}


class Size(NamedTuple):
    """A scene of one size: what is varied, its value, and the scene with method and grid."""

    variable: str
    value: float
    scene: Scene


def _swung(horizon: float) -> Scene:
    """Return a cable on a table that a gripper at 0.25 m swings back and forth, once in 2 s."""
    times = np.arange(0.0, horizon + 0.25, 0.5)
    swing = 0.1 * np.sin(np.pi * times)
    positions = np.column_stack([0.25 + 0 * times, swing, 0 * times])
    grasp = Grasp(u=0.25, path=Waypoints(times=times, positions=positions))
    around = Environment(drag=0.5, table=Table())  # so that each swing forgets the one before
    return Scene(cable=plain_cord(), shape=Straight(), grasps=(grasp,), environment=around, horizon=horizon)


def _held(count: int) -> Scene:
    """Return a bent cable on a table that `count` grippers, evenly spaced, move sideways together."""
    angle = np.linspace(0.0, 1.0, 41)  # [rad]: bent, so that each part between two grippers is slack
    arc = np.column_stack([np.sin(angle), 1.0 - np.cos(angle)])
    path = Move(displacement=(0.0, 0.3, 0.0), duration=1.6)
    grasps = tuple(Grasp(u=float(u), path=path) for u in np.linspace(0.0, 1.0, count))
    around = Environment(drag=0.05, table=Table())
    return Scene(cable=plain_cord(), shape=Points(points=arc), grasps=grasps, environment=around)


def sizes() -> Iterator[Size]:
    """Yield every size at which the cost is measured, for both methods."""

    def asked(scene: Scene, method: Method, n_u: int, n_t: int) -> Scene:
        return replace(scene, quality=Quality(n_u=n_u, n_t=n_t, method=method, estimate=False))

    methods: tuple[Method, ...] = ("march", "spacetime")
    for method in methods:
        for n_u in N_U[method]:
            yield Size("n_u", n_u, asked(paper_case(0.25), method, n_u, 25))
        for n_u in N_U[method]:
            yield Size("n_u in space", n_u, asked(hanging("clamp"), method, n_u, 25))
        for n_t in N_T:
            yield Size("n_t", n_t, asked(paper_case(0.25), method, 13, n_t))
        for horizon in HORIZONS:
            yield Size("horizon", horizon, asked(_swung(horizon), method, 13, round(12 * horizon) + 3))
        for count in GRASPS:
            yield Size("grasps", count, asked(_held(count), method, 33, 25))


def effect_pairs() -> Iterator[tuple[str, Scene, Scene]]:
    """Yield for each effect that can be left out a scene with it and the same without it."""
    grid = Quality(method="march", estimate=False, **_EFFECT_GRID)  # type: ignore[arg-type]
    plane = replace(paper_case(0.25), quality=grid)
    space = replace(hanging(), quality=grid)
    peg = Cylinder(center=(0.8, 0.12, 0.0), radius=0.02, height=0.1)
    made = {
        "inertia": plane,
        "drag": plane,
        "damping": replace(plane, cable=plain_cord(bending_damping=1e-4)),
        "gravity": space,
        "bend": plane,
        "twist": replace(hanging("clamp"), quality=grid),
        "plasticity": replace(plane, cable=plain_cord(yield_strain=0.004, memory_rate=50.0)),
        "table": replace(space, environment=replace(space.environment, table=Table(height=-0.6))),
        "friction": replace(plane, environment=replace(plane.environment, table=Table(friction=0.1))),
        "obstacles": replace(plane, environment=replace(plane.environment, obstacles=(peg,))),
        "self_contact": plane,
    }
    for effect, scene in made.items():
        switches: tuple[dict[str, Switch], dict[str, Switch]] = ({effect: "on"}, {effect: "off"})
        yield effect, replace(scene, effects=switches[0]), replace(scene, effects=switches[1])
