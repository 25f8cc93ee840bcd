"""Random scenes of a cable that grippers lift, lay down, carry or bring together among obstacles on a table."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from benchmarks.catalogue.parts import bow, wave
from benchmarks.pairs import Drawn
from benchmarks.robot_scenes import HOLDS
from dlocore import (
    Box,
    Cable,
    Capsule,
    Cylinder,
    Environment,
    Grasp,
    Load,
    Move,
    Points,
    Scene,
    Sphere,
    Straight,
    Table,
    Waypoints,
)
from dlocore.effects.distance import distances
from dlocore.scene.obstacles import Obstacle
from dlocore.shape.shape import StartCurve, start_curve

Floats = NDArray[np.float64]


def draw(seed: int, index: int) -> Drawn:
    """Return the scene of a seed and an index, with its kind of motion, shape, stress-free shape and obstacles.

    Some of them no cable can follow: a path may lead into an obstacle.

    Raises:
        SceneError: it is no scene at all.
    """
    r = np.random.default_rng([seed, index])
    length = r.uniform(0.4, 2.0)
    lies = str(r.choice(["straight", "bow", "wave"]))
    shape = _shape(r, lies, length)
    at = start_curve(shape, length)
    cable, rest = _cable(r, length)
    duration = r.uniform(0.8, 2.5)
    kind = str(r.choice(["lift", "carry", "two"]))
    grasps = _together(r, length, at, duration) if kind == "two" else [_one(r, kind, length, at, duration)]
    obstacles = _obstacles(r, length, cable.diameter, at(np.linspace(0.0, length, 101)))
    loads = []
    if r.random() < 0.15:
        weight = cable.linear_density * 9.81 * length
        loads = [Load(u=r.uniform(0.0, length), force=tuple(r.normal(0.0, 0.1 * weight, 3)))]
    table = Table(friction=float(r.choice([0.0, 0.1, 0.3, 0.6])))
    environment = Environment(drag=cable.linear_density / r.uniform(0.1, 3.0), table=table, obstacles=obstacles)
    scene = Scene(
        cable=cable, shape=shape, grasps=grasps, loads=loads, environment=environment,
        horizon=duration * r.uniform(1.0, 1.4), effects={"self_contact": "off"},
    )  # fmt: skip
    return Drawn(index, (kind, lies, f"rests {rest}", f"{len(obstacles)} obstacles"), scene)


def _shape(r: np.random.Generator, lies: str, length: float) -> Straight | Points:
    if lies == "straight":
        return Straight(direction=(1.0, 0.0, 0.0))
    if lies == "bow":
        return Points(points=bow(length, r.uniform(0.3, 2.5)))
    return Points(points=wave(length, r.uniform(0.02, 0.12) * length, r.uniform(0.5, 1.5)))


def _cable(r: np.random.Generator, length: float) -> tuple[Cable, str]:
    density, diameter = 10 ** r.uniform(-2.0, -0.5), r.uniform(0.003, 0.012) * length**0.5
    stiffness = 9.81 * density * length**3 * 10 ** r.uniform(-3.5, -0.7)
    rest = str(r.choice(["straight", "initial", "bent"], p=[0.5, 0.35, 0.15]))
    yields: dict[str, Any] = {}
    if r.random() < 0.25:
        strain = 0.5 * diameter * r.uniform(1.0, 6.0) / length
        yields = {"yield_strain": strain, "memory_rate": 10 ** r.uniform(0.0, 2.0), "hardening": r.uniform(0.05, 1.0)}
        if r.random() < 0.3:
            yields["yield_twist"] = strain
    cable = Cable(
        length=length,
        diameter=diameter,
        linear_density=density,
        bending_stiffness=stiffness,
        bending_damping=float(stiffness * 10 ** r.uniform(-3.5, -1.5) * (r.random() < 0.7)),
        torsional_stiffness=stiffness * 10 ** r.uniform(-0.7, 0.5),
        rest_shape=bow(length, r.uniform(0.3, 3.0)) if rest == "bent" else rest,
        **yields,
    )
    return cable, rest


def _one(r: np.random.Generator, kind: str, length: float, at: StartCurve, duration: float) -> Grasp:
    """Return a grasp that lifts the cable, or carries it in an arc back to the table."""
    u, hold = float(r.choice([0.0, length, r.uniform(0.0, length)])), HOLDS[r.integers(3)]
    aside, up = r.normal(0.0, 0.17 * length, 2), r.uniform(0.1, 0.4) * length
    if kind == "lift":
        turn = None if hold == "point" or r.random() < 0.5 else tuple(r.normal(0.0, 0.5, 3))
        return Grasp(u=u, hold=hold, path=Move(displacement=(*aside, up), rotation=turn, duration=duration))
    s = np.linspace(0.0, 1.0, 9)[:, None]
    way = at(u)[0] + s * np.append(aside, 0.0) + np.sin(np.pi * s) * [0.0, 0.0, up]
    return Grasp(u=u, hold=hold, path=Waypoints(times=np.linspace(0.0, duration, 9), positions=way))


def _together(r: np.random.Generator, length: float, at: StartCurve, duration: float) -> list[Grasp]:
    """Return two grasps that lift the cable and come nearer to each other."""
    first, second = sorted(r.uniform(0.0, length, 2))
    if second - first < 0.2 * length:
        first, second = 0.0, length
    by = np.append(r.normal(0.0, 0.15 * length, 2), r.uniform(0.1, 0.4) * length)
    places = at(np.array([first, second]))
    nearer = (r.uniform(0.6, 0.95) - 1.0) * (places - places.mean(axis=0))
    lifts = np.array([1.0, r.uniform(0.3, 1.0)])[:, None] * [0.0, 0.0, by[2]]
    moves = nearer + lifts + [by[0], by[1], 0.0]
    times = duration, duration * r.uniform(0.6, 1.0)
    return [
        Grasp(u=u, hold=HOLDS[r.integers(3)], path=Move(displacement=tuple(by), duration=time))
        for u, by, time in zip((first, second), moves, times, strict=True)
    ]


def _obstacles(r: np.random.Generator, length: float, diameter: float, cable: Floats) -> list[Obstacle]:
    """Return up to three obstacles on or above the table that a cable through these points (n, 3) [m] is clear of."""
    found: list[Obstacle] = []
    for _ in range(int(r.choice([0, 0, 1, 2, 3]))):
        at = cable[r.integers(len(cable))] + np.append(r.normal(0.0, 0.2 * length, 2), 0.0)
        one = _obstacle(r, at, r.uniform(0.03, 0.1) * length, length)
        if distances(one.row()[None], np.ascontiguousarray(cable)).min() > 2.0 * diameter:
            found.append(one)
    return found


def _obstacle(r: np.random.Generator, at: Floats, size: float, length: float) -> Obstacle:
    """Return a leaning post, a turned box, a bar above the table or a ball."""
    kind, friction = r.choice(["post", "box", "bar", "ball"]), float(r.choice([0.0, 0.3]))
    up = np.array([0.0, 0.0, 1.0])
    if kind == "post":
        axis = tuple(up + r.normal(0.0, 0.3, 3))
        return Cylinder(center=at + 0.1 * length * up, axis=axis, radius=size, height=0.3 * length, friction=friction)
    if kind == "box":
        turn = r.normal(0.0, 1.0, 4)
        edges = tuple(size * r.uniform(1.0, 3.0, 3))
        return Box(center=at + size * up, size=edges, orientation=tuple(turn / np.linalg.norm(turn)), friction=friction)
    if kind == "bar":
        along = np.append(r.normal(0.0, 1.0, 2), 0.0)
        along *= 0.3 * length / np.linalg.norm(along)
        middle = at + r.uniform(0.08, 0.25) * length * up
        return Capsule(start=middle - along, end=middle + along, radius=0.5 * size, friction=friction)
    return Sphere(center=at, radius=size, friction=friction)
