"""Scenes that no cable can follow, or that contradict themselves: sound scenes with one fault."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from benchmarks.hard.draft import Draft, Rng
from benchmarks.hard.motions import started
from dlocore import Grasp, Move, Points, Quality, Scene, Sphere, Straight, Table, Waypoints

Fault = Callable[[Rng, Draft], Callable[[], Scene]]


def pulled_apart(r: Rng, d: Draft) -> Callable[[], Scene]:
    length, u = d.length, (0.1 * d.length, 0.8 * d.length)
    d.shape = Straight()
    far = r.uniform(0.02, 0.5) * length
    path = Move(displacement=(far, 0, 0), duration=d.time)
    d.grasps = [Grasp(u=u[0]), Grasp(u=u[1], path=path)]
    d.horizon = None  # the horizon of the pull
    return d.scene


def pulled_apart_late(r: Rng, d: Draft) -> Callable[[], Scene]:
    """Close a second gripper in mid-motion and pull: only solving can tell how far."""
    d.shape, d.effects, d.environment = Straight(), {}, {"gravity": (0.0, 0.0, 0.0), "drag": 0.1}
    path = Move(displacement=(r.uniform(0.1, 0.6) * d.length, 0, 0), duration=d.time)
    d.grasps = [Grasp(u=0.1 * d.length), Grasp(u=0.8 * d.length, path=path, grasp_time=0.1 * d.time)]
    d.loads, d.horizon = [], 1.2 * d.time
    return d.scene


def starts_in_an_obstacle(r: Rng, d: Draft) -> Callable[[], Scene]:
    center = started(d)(r.uniform(0.2, 0.8) * d.length)[0]
    d.environment["obstacles"] = (Sphere(center=center, radius=0.05 * d.length),)
    return d.scene


def starts_under_the_table(r: Rng, d: Draft) -> Callable[[], Scene]:
    lowest = float(started(d)(np.linspace(0.0, d.length, 101))[:, 2].min())
    d.environment["table"] = Table(height=lowest + r.uniform(0.02, 0.5) * d.length)
    return d.scene


def moves_into_the_table(r: Rng, d: Draft) -> Callable[[], Scene]:
    d.shape, d.loads = Straight(), []
    down = Move(displacement=(0.0, 0.0, -r.uniform(0.05, 0.5) * d.length), duration=d.time)
    d.grasps, d.environment = [Grasp(u=0.3 * d.length, path=down)], {"table": Table()}
    return d.scene


def points_of_another_length(r: Rng, d: Draft) -> Callable[[], Scene]:
    points = started(d)(np.linspace(0.0, d.length, 41))
    d.shape = Points(points=points * r.choice([r.uniform(0.3, 0.8), r.uniform(1.25, 3.0)]))
    return d.scene


def waypoints_elsewhere(r: Rng, d: Draft) -> Callable[[], Scene]:
    at = started(d)(0.5 * d.length)[0]
    away = at + np.array([0.0, r.uniform(0.03, 1.0), 0.0])
    path = Waypoints(times=[0.0, 0.5, 1.0], positions=np.array([away, away, away]))
    d.grasps = [Grasp(u=0.5 * d.length, path=path)]
    return d.scene


def not_a_number(r: Rng, d: Draft) -> Callable[[], Scene]:
    field = str(r.choice(["linear_density", "bending_stiffness", "axial_stiffness", "diameter"]))
    d.cable[field] = float(r.choice([np.nan, np.inf, -1.0, 0.0]))
    return d.scene


def no_duration(r: Rng, d: Draft) -> Callable[[], Scene]:
    u = float(r.uniform(0.0, 1.0) * d.length)
    seconds = float(r.choice([0.0, -1.0, 1e-5]))

    def make() -> Scene:
        d.grasps = [Grasp(u=u, path=Move(displacement=(0.0, 0.1, 0.0), duration=seconds))]
        return d.scene()

    return make


def too_few_control_points(r: Rng, d: Draft) -> Callable[[], Scene]:
    d.shape, d.loads = Straight(), []
    count = int(r.integers(6, 12))
    path = Move(displacement=(0.0, 0.1 * d.length, 0.0), duration=d.time)
    d.grasps = [Grasp(u=d.length * (i + 1) / (count + 1), path=path) for i in range(count)]
    d.quality = Quality(n_u=5, n_t=13)
    return d.scene


def two_grasps_in_one_place(r: Rng, d: Draft) -> Callable[[], Scene]:
    u = float(r.uniform(0.1, 0.9) * d.length)

    def make() -> Scene:
        d.grasps = [Grasp(u=u), Grasp(u=u + 1e-6 * d.length)]
        return d.scene()

    return make


FAULTS: tuple[Fault, ...] = (
    pulled_apart,
    pulled_apart_late,
    starts_in_an_obstacle,
    starts_under_the_table,
    moves_into_the_table,
    points_of_another_length,
    waypoints_elsewhere,
    not_a_number,
    no_duration,
    too_few_control_points,
    two_grasps_in_one_place,
)


def spoil(r: Rng, d: Draft) -> Callable[[], Scene]:
    """Give a sound draft one fault; calling the result makes the scene, or raises an error."""
    d.effects = {name: value for name, value in d.effects.items() if name != "obstacles"}
    d.quality = replace(d.quality) if d.quality.method != "paper" else Quality()
    fault = FAULTS[int(r.integers(len(FAULTS)))]
    d.families = [f"impossible: {fault.__name__.replace('_', ' ')}"]
    return fault(r, d)
