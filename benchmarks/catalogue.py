"""Scenes of all kinds that cables are handled in, by name: what the choice of effects is measured on.

They are deterministic, small (mostly 3 s at most) and such as a robot meets them: sliding, lifting, hanging, threading
around pegs, laying down, unwinding. Units are SI, z is up.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
    Still,
    Straight,
    Table,
    Waypoints,
)

Floats = NDArray[np.float64]
Vector = tuple[float, float, float]

WEIGHTLESS: Vector = (0.0, 0.0, 0.0)
_scenes: dict[str, Callable[[], Scene]] = {}


def _scene(make: Callable[[], Scene]) -> Callable[[], Scene]:
    """Enter a scene into the catalogue under the name of its function."""
    _scenes[make.__name__.replace("_", " ")] = make
    return make


def catalogue() -> dict[str, Scene]:
    """Return every scene by name, in the order of this file."""
    return {name: make() for name, make in _scenes.items()}


# --- parts ---


def cord(**changes: Any) -> Cable:
    """Return a limp cord, 1 m long and 5 mm thick, with the given fields replaced."""
    values = {"length": 1.0, "diameter": 0.005, "linear_density": 0.05, "bending_stiffness": 1e-3}
    return Cable(**(values | changes))


def move(x: float, y: float, z: float = 0.0, *, time: float, **changes: Any) -> Move:
    return Move(displacement=(x, y, z), duration=time, **changes)


def on_table(friction: float, *, drag: float = 0.02, **changes: Any) -> Environment:
    return Environment(drag=drag, table=Table(friction=friction), **changes)


def hanging(*, drag: float = 0.05, **changes: Any) -> Environment:
    return Environment(drag=drag, **changes)


def wave(length: float, height: float, turns: float) -> Floats:
    """Return points (k, 2) [m] of a sine of the given number of turns whose arclength is `length` [m]."""
    width = length
    for _ in range(50):
        x = np.linspace(0.0, width, 201)
        y = height * np.sin(2 * np.pi * turns * x / width)
        width *= length / float(np.hypot(np.diff(x), np.diff(y)).sum())
    x = np.linspace(0.0, width, 61)
    return np.column_stack([x, height * np.sin(2 * np.pi * turns * x / width)])


def bow(length: float, angle: float) -> Floats:
    """Return points (61, 2) [m] of an arc from the origin that begins along x and turns left by `angle` [rad]."""
    phi = np.linspace(0.0, angle, 61)
    return length / angle * np.column_stack([np.sin(phi), 1.0 - np.cos(phi)])


def sagging(length: float, span: float) -> Floats:
    """Return points (61, 3) [m] of an arc in the x-z plane that hangs between two points of the x-axis."""
    low, high = 1e-3, np.pi - 1e-3  # half of the angle: sin(a)/a = span/length
    for _ in range(60):
        a = 0.5 * (low + high)
        low, high = (a, high) if np.sin(a) / a > span / length else (low, a)
    phi = np.linspace(-a, a, 61)
    radius = length / (2 * a)
    x, z = radius * np.sin(phi), radius * (np.cos(a) - np.cos(phi))
    return np.column_stack([x - x[0], 0 * x, z])


def pegs(*places: tuple[float, float], radius: float = 0.015, friction: float = 0.2) -> tuple[Cylinder, ...]:
    return tuple(Cylinder(center=(x, y, 0.0), radius=radius, height=0.1, friction=friction) for x, y in places)


# --- in the plane, on a smooth table or without weight ---


@_scene
def paper_case_at_a_quarter() -> Scene:
    grasp = Grasp(u=0.25, path=move(0.0, 0.5, time=1.6))
    return Scene(cable=cord(), shape=Straight(), grasps=(grasp,), environment=on_table(0.0, drag=0.05))


@_scene
def fast_sideways_on_a_smooth_table() -> Scene:
    grasp = Grasp(u=0.5, path=move(0.0, 0.4, time=0.5))
    return Scene(cable=cord(), shape=Straight(), grasps=(grasp,), environment=on_table(0.0), horizon=1.0)


@_scene
def slow_turn_of_a_gripper_on_a_smooth_table() -> Scene:
    grasp = Grasp(u=0.0, hold="tangent", path=move(0.1, 0.1, time=2.5, rotation=(0, 0, 1.2)))
    return Scene(cable=cord(), shape=Straight(), grasps=(grasp,), environment=on_table(0.0, drag=0.2))


@_scene
def two_grippers_bend_a_wire_in_the_plane() -> Scene:
    wire = Cable.preset("black-wire", length=0.6)
    grasps = (
        Grasp(u=0.0, hold="tangent"),
        Grasp(u=0.6, hold="tangent", path=move(-0.15, 0.1, time=1.5, rotation=(0, 0, 0.8))),
    )
    return Scene(cable=wire, shape=Points(points=bow(0.6, 0.6)), grasps=grasps, environment=on_table(0.0, drag=0.1))


@_scene
def weightless_swing_with_quadratic_drag() -> Scene:
    grasp = Grasp(u=0.0, path=move(0.0, 0.4, time=0.8))
    around = Environment(gravity=WEIGHTLESS, drag_quadratic=0.3)
    return Scene(cable=cord(), shape=Straight(), grasps=(grasp,), environment=around, horizon=1.5)


@_scene
def a_force_instead_of_a_gripper() -> Scene:
    pushes = Load(u=1.0, force=[[0, 0, 0], [0, 0.05, 0], [0, 0, 0]], times=[0.0, 0.5, 1.5])
    return Scene(
        cable=cord(),
        shape=Straight(),
        grasps=(Grasp(u=0.0, hold="tangent"),),
        loads=(pushes,),
        environment=on_table(0.0, drag=0.1),
    )


# --- on a rough table ---


@_scene
def short_cable_pulled_slowly_over_a_rough_table() -> Scene:
    cable = cord(length=0.2, bending_stiffness=2e-4, diameter=0.003, linear_density=0.02)
    grasp = Grasp(u=0.0, path=move(0.0, 0.15, time=2.0))
    return Scene(cable=cable, shape=Straight(), grasps=(grasp,), environment=on_table(0.4))


@_scene
def cable_dragged_along_itself() -> Scene:
    grasp = Grasp(u=0.0, path=move(-0.3, 0.0, time=2.0))
    return Scene(cable=cord(), shape=Straight(), grasps=(grasp,), environment=on_table(0.3))


@_scene
def seen_cable_moved_at_its_middle_and_released() -> Scene:
    cable = cord(length=0.8, diameter=0.006, linear_density=0.06, bending_stiffness=1.3e-3, rest_shape="initial")
    grasp = Grasp(u=0.4, hold="tangent", path=move(0.05, 0.2, time=1.5, rotation=(0, 0, 0.6)), release_time=1.5)
    shape = Points(points=wave(0.8, 0.05, 1.2))
    return Scene(cable=cable, shape=shape, grasps=(grasp,), environment=on_table(0.3), horizon=2.0)


@_scene
def fast_pull_over_a_slightly_rough_table() -> Scene:
    grasp = Grasp(u=0.1, path=move(-0.1, 0.5, time=0.6))
    return Scene(cable=cord(), shape=Straight(), grasps=(grasp,), environment=on_table(0.1), horizon=1.0)


@_scene
def two_grippers_straighten_a_wave_on_a_rough_table() -> Scene:
    points = wave(1.0, 0.06, 1.5)
    slack = 0.97 - float(np.linalg.norm(points[-1] - points[0]))
    grasps = (Grasp(u=0.0), Grasp(u=1.0, path=move(slack, 0.0, time=2.0)))
    return Scene(cable=cord(), shape=Points(points=points), grasps=grasps, environment=on_table(0.3))


@_scene
def long_heavy_cable_dragged_by_its_end() -> Scene:
    cable = Cable.preset("orange-electric-cable", length=5.0)
    grasp = Grasp(u=0.0, path=move(0.0, 0.8, time=3.0))
    return Scene(cable=cable, shape=Straight(), grasps=(grasp,), environment=on_table(0.5))


@_scene
def regrasp_on_a_rough_table() -> Scene:
    first = Grasp(u=0.2, path=move(0.0, 0.2, time=1.0), release_time=1.0)
    second = Grasp(u=0.8, path=move(0.0, 0.2, time=1.0), grasp_time=1.1)
    return Scene(cable=cord(), shape=Straight(), grasps=(first, second), environment=on_table(0.4), horizon=2.2)


@_scene
def three_grippers_lay_an_s_on_a_rough_table() -> Scene:
    grasps = (
        Grasp(u=0.0, path=move(0.1, 0.1, time=1.5)),
        Grasp(u=0.5),
        Grasp(u=1.0, path=move(-0.1, -0.1, time=1.5)),
    )
    shape = Points(points=wave(1.0, 0.02, 1.0))
    return Scene(cable=cord(), shape=shape, grasps=grasps, environment=on_table(0.25))


@_scene
def sloping_table_that_the_cable_slides_down() -> Scene:
    around = Environment(gravity=(2.5, 0.0, -9.5), table=Table(friction=0.15))
    grasp = Grasp(u=0.0)
    return Scene(cable=cord(), shape=Straight(direction=(0.2, 1, 0)), grasps=(grasp,), environment=around, horizon=1.5)


@_scene
def thrown_cable_that_friction_stops() -> Scene:
    start = Straight(velocity=(0.2, 0.8, 0.0))
    return Scene(cable=cord(), shape=start, environment=on_table(0.3), horizon=1.0)


# --- around pegs and along walls, on a table ---


@_scene
def dragged_against_a_peg() -> Scene:
    grasp = Grasp(u=0.0, path=move(0.2, 0.4, time=2.0))
    around = on_table(0.3, obstacles=pegs((0.5, 0.1)))
    return Scene(cable=cord(), shape=Straight(), grasps=(grasp,), environment=around)


@_scene
def threaded_between_two_pegs() -> Scene:
    grasp = Grasp(u=0.0, path=move(0.1, 0.35, time=2.0))
    around = on_table(0.2, obstacles=pegs((0.35, 0.06), (0.7, -0.04), friction=0.1))
    return Scene(cable=cord(), shape=Straight(), grasps=(grasp,), environment=around)


@_scene
def pulled_around_a_smooth_peg() -> Scene:
    points = np.array([[-0.3, 0.0], [-0.2, 0.0], [-0.1, 0.0], [0.0, 0.0]])
    phi = np.linspace(0.0, np.pi / 2, 12)[1:]
    corner = 0.05 * np.column_stack([np.sin(phi), 1 - np.cos(phi)])
    points = np.vstack([points, corner, [[0.05, y] for y in np.linspace(0.1, 0.3, 5)]])
    length = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    grasp = Grasp(u=0.0, path=move(-0.15, 0.0, time=2.0))
    around = on_table(0.1, obstacles=pegs((0.0, 0.05), radius=0.0475, friction=0.0))
    return Scene(
        cable=cord(length=length, bending_stiffness=3e-4),
        shape=Points(points=points),
        grasps=(grasp,),
        environment=around,
    )


@_scene
def pushed_sideways_into_a_wall() -> Scene:
    wall = Box(center=(0.5, 0.25, 0.0), size=(1.4, 0.1, 0.1), friction=0.2)
    grasps = (Grasp(u=0.1, path=move(0.0, 0.17, time=1.5)), Grasp(u=0.9, path=move(-0.05, 0.05, time=1.5)))
    shape = Points(points=bow(1.0, 0.3))
    return Scene(cable=cord(), shape=shape, grasps=grasps, environment=on_table(0.2, obstacles=(wall,)))


@_scene
def pegs_far_from_the_motion() -> Scene:
    grasp = Grasp(u=0.25, path=move(0.0, 0.2, time=1.5))
    around = on_table(0.2, obstacles=pegs((0.5, -0.8), (2.0, 0.3), (-0.9, 0.5)))
    return Scene(cable=cord(), shape=Straight(), grasps=(grasp,), environment=around)


@_scene
def stiff_rod_levered_around_a_peg() -> Scene:
    rod = Cable.preset("tent-pole", length=0.8)
    grasp = Grasp(u=0.0, path=move(0.0, -0.1, time=1.5))
    around = on_table(0.2, obstacles=pegs((0.3, -0.02)))
    return Scene(cable=rod, shape=Straight(), grasps=(grasp,), environment=around)


# --- hanging in space ---


@_scene
def hung_by_one_end_and_carried_sideways() -> Scene:
    grasp = Grasp(u=0.0, path=move(0.3, 0.0, 0.1, time=1.0))
    start = Straight(direction=(0, 0, -1))
    return Scene(cable=cord(), shape=start, grasps=(grasp,), environment=hanging(), horizon=1.5)


@_scene
def two_grippers_carry_a_hanging_cable() -> Scene:
    shape = Points(points=sagging(1.0, 0.7), settle=True)
    grasps = (Grasp(u=0.0, path=move(0.1, 0.2, 0.1, time=1.0)), Grasp(u=1.0, path=move(-0.1, 0.25, 0.0, time=1.0)))
    return Scene(cable=cord(), shape=shape, grasps=grasps, environment=hanging())


@_scene
def clamped_hanging_cable_with_one_end_moved() -> Scene:
    shape = Points(points=sagging(1.0, 0.7), settle=True)
    grasps = (Grasp(u=0.0, hold="clamp"), Grasp(u=1.0, hold="clamp", path=move(-0.2, 0.2, 0.1, time=1.0)))
    return Scene(cable=cord(), shape=shape, grasps=grasps, environment=hanging(drag=0.1))


@_scene
def cantilever_let_down() -> Scene:
    wire = Cable.preset("red-wire", length=0.3, bending_damping=5e-5)
    grasp = Grasp(u=0.0, hold="tangent", path=move(0.0, 0.0, 0.1, time=1.0, rotation=(0, 0.7, 0)))
    return Scene(cable=wire, shape=Straight(settle=True), grasps=(grasp,), environment=hanging(drag=0.05))


@_scene
def whip_of_a_hanging_cord() -> Scene:
    path = Waypoints(times=[0.0, 0.4, 0.8, 1.4], positions=[(0, 0, 0), (0.2, 0, 0.05), (-0.2, 0.05, 0.1), (0, 0, 0)])
    start = Straight(direction=(0, 0, -1))
    around = hanging(drag=0.02, drag_quadratic=0.05)
    cable = cord(bending_damping=3e-4)
    return Scene(cable=cable, shape=start, grasps=(Grasp(u=0.0, path=path),), environment=around)


@_scene
def released_from_two_grippers_and_caught_by_one() -> Scene:
    shape = Points(points=sagging(1.0, 0.6), settle=True)
    grasps = (Grasp(u=0.0, path=move(0.0, 0.1, 0.0, time=1.0)), Grasp(u=1.0, release_time=0.4))
    return Scene(cable=cord(), shape=shape, grasps=grasps, environment=hanging(drag=0.1), horizon=1.5)


@_scene
def late_grasp_of_a_swinging_end() -> Scene:
    start = Straight(direction=(0.3, 0, -1))
    grasps = (Grasp(u=0.0), Grasp(u=0.9, grasp_time=0.6, path=move(0.0, 0.1, 0.15, time=0.8)))
    return Scene(
        cable=cord(bending_damping=5e-4), shape=start, grasps=grasps, environment=hanging(drag=0.1), horizon=1.6
    )


@_scene
def white_wire_between_two_grippers_in_space() -> Scene:
    wire = Cable.preset("white-wire", bending_damping=1e-5)
    shape = Points(points=sagging(1.0, 0.5), settle=True)
    grasps = (
        Grasp(u=0.0, hold="tangent", path=move(0.0, 0.0, 0.0, time=1.2, rotation=(0, 0, 0.6))),
        Grasp(u=1.0, hold="tangent", path=move(0.2, 0.1, 0.1, time=1.2)),
    )
    return Scene(cable=wire, shape=shape, grasps=grasps, environment=hanging(drag=0.02))


@_scene
def long_cable_with_a_hanging_load() -> Scene:
    shape = Points(points=sagging(5.0, 4.2), settle=True)
    cable = cord(length=5.0, diameter=0.01, linear_density=0.15, bending_stiffness=0.02, axial_stiffness=5e4)
    grasps = (Grasp(u=0.0), Grasp(u=5.0, path=move(-0.3, 0.3, 0.2, time=2.0)))
    return Scene(
        cable=cable,
        shape=shape,
        grasps=grasps,
        loads=(Load(u=2.5, force=(0, 0, -3.0)),),
        environment=hanging(drag=0.2),
    )


@_scene
def heavy_electric_cable_held_at_three_places() -> Scene:
    cable = Cable.preset("black-electric-cable", length=2.0, bending_damping=0.005)
    shape = Points(points=sagging(2.0, 1.7), settle=True)
    grasps = (Grasp(u=0.0), Grasp(u=1.0, path=move(0.0, 0.1, 0.15, time=1.5)), Grasp(u=2.0))
    return Scene(cable=cable, shape=shape, grasps=grasps, environment=hanging(drag=0.2))


# --- twist ---


@_scene
def gripper_twists_a_straight_cable_by_a_turn() -> Scene:
    around = Environment(gravity=WEIGHTLESS, drag=0.2)
    turn = Grasp(u=0.5, hold="clamp", path=move(-0.02, 0.0, time=2.0, rotation=(3.0, 0, 0)))
    cable = cord(length=0.5, bending_stiffness=2e-3, torsional_stiffness=1.5e-3, torsional_damping=1e-4)
    shape = Points(points=bow(0.5, 0.3))
    return Scene(cable=cable, shape=shape, grasps=(Grasp(u=0.0, hold="clamp"), turn), environment=around)


@_scene
def wrist_rolls_a_hanging_bow() -> Scene:
    shape = Points(points=sagging(0.6, 0.35), settle=True)
    cable = Cable.preset("black-wire", length=0.6, torsional_damping=1e-4, bending_damping=1e-4)
    roll = move(0.0, 0.0, 0.0, time=1.5, rotation=(1.5, 0, 0))
    grasps = (Grasp(u=0.0, hold="clamp"), Grasp(u=0.6, hold="clamp", path=roll))
    return Scene(cable=cable, shape=shape, grasps=grasps, environment=hanging(drag=0.1))


@_scene
def clamped_bow_turned_out_of_its_plane() -> Scene:
    wire = Cable.preset("red-wire", length=0.6, bending_damping=5e-5)
    grasps = (
        Grasp(u=0.0, hold="clamp"),
        Grasp(u=0.6, hold="clamp", path=move(-0.05, 0.0, 0.1, time=1.5, rotation=(0, 0.8, 0.4))),
    )
    around = Environment(gravity=WEIGHTLESS, drag=0.1)
    return Scene(cable=wire, shape=Points(points=bow(0.6, 1.5)), grasps=grasps, environment=around)


# --- plastic and naturally bent ---


@_scene
def wire_bent_for_good_in_the_plane() -> Scene:
    wire = cord(
        length=0.4, diameter=0.003, bending_stiffness=4e-3, bending_damping=4e-4, yield_strain=0.004, memory_rate=30.0
    )
    turn = move(-0.1, 0.1, time=1.5, rotation=(0, 0, 1.6))
    grasps = (Grasp(u=0.0, hold="tangent"), Grasp(u=0.4, hold="tangent", path=turn, release_time=1.6))
    around = on_table(0.0, drag=0.2)
    return Scene(cable=wire, shape=Straight(), grasps=grasps, environment=around, horizon=2.2)


@_scene
def plastic_cable_laid_around_a_peg_on_a_rough_table() -> Scene:
    cable = cord(yield_strain=0.02, memory_rate=20.0)
    grasp = Grasp(u=0.0, path=move(0.3, 0.35, time=2.0), release_time=2.0)
    around = on_table(0.3, obstacles=pegs((0.4, 0.1), radius=0.03))
    return Scene(cable=cable, shape=Straight(), grasps=(grasp,), environment=around, horizon=2.5)


@_scene
def coil_memory_of_a_cable_in_space() -> Scene:
    cable = Cable.preset("black-wire", rest_shape="initial", bending_damping=1e-4)
    points = bow(1.0, 2.5)
    start = np.column_stack([points[:, 0], 0 * points[:, 0], -points[:, 1]])
    grasps = (Grasp(u=0.0, hold="clamp", path=move(0.0, 0.2, 0.1, time=1.2, rotation=(0, 0, 0.8))),)
    around = Environment(gravity=WEIGHTLESS, drag=0.1)
    return Scene(cable=cable, shape=Points(points=start), grasps=grasps, environment=around)


@_scene
def barely_stressed_plastic_cable() -> Scene:
    cable = cord(yield_strain=0.5, memory_rate=20.0)
    grasp = Grasp(u=0.25, path=move(0.0, 0.3, time=1.6))
    return Scene(cable=cable, shape=Straight(), grasps=(grasp,), environment=on_table(0.0, drag=0.05))


# --- onto and off the table ---


@_scene
def cable_dropped_onto_the_table() -> Scene:
    start = Straight(start=(0, 0, 0.06), direction=(1, 0, 0.05))
    cable = cord(bending_damping=2e-4)
    return Scene(cable=cable, shape=start, environment=on_table(0.3), horizon=0.8)


@_scene
def end_lifted_from_the_table() -> Scene:
    grasp = Grasp(u=0.0, path=move(0.15, 0.0, 0.25, time=2.0))
    return Scene(cable=cord(bending_damping=1e-4), shape=Straight(), grasps=(grasp,), environment=on_table(0.4))


@_scene
def middle_lifted_from_the_table() -> Scene:
    grasp = Grasp(u=0.5, path=move(0.0, 0.1, 0.2, time=1.5))
    cable = cord(bending_damping=1e-4)
    return Scene(cable=cable, shape=Straight(), grasps=(grasp,), environment=on_table(0.3))


@_scene
def hanging_cable_laid_down_on_the_table() -> Scene:
    path = Waypoints(times=[0.0, 1.0, 2.5], positions=[(0, 0, 0.9), (0.1, 0, 0.5), (0.5, 0, 0.15)])
    cable = cord(length=0.8, bending_damping=1e-4)
    start = Straight(start=(0, 0, 0.9), direction=(0, 0, -1))
    around = on_table(0.4, drag=0.05)
    return Scene(cable=cable, shape=start, grasps=(Grasp(u=0.0, path=path),), environment=around)


@_scene
def cable_carried_high_above_a_table() -> Scene:
    points = sagging(0.8, 0.6)
    points[:, 2] += 0.6
    grasps = (Grasp(u=0.0, path=move(0.0, 0.2, 0.1, time=1.2)), Grasp(u=0.8, path=move(0.0, 0.2, 0.1, time=1.2)))
    cable = cord(length=0.8)
    return Scene(cable=cable, shape=Points(points=points, settle=True), grasps=grasps, environment=on_table(0.3))


# --- over and along obstacles in space ---


@_scene
def lowered_over_a_bar() -> Scene:
    bar = Capsule(start=(0.5, -0.2, -0.1), end=(0.5, 0.2, -0.1), radius=0.03, friction=0.3)
    down = (Move(displacement=(0.1, 0, -0.2), duration=1.2), Move(displacement=(-0.1, 0, -0.2), duration=1.2))
    grasps = (Grasp(u=0.0, path=down[0]), Grasp(u=1.0, path=down[1]))
    around = hanging(obstacles=(bar,))
    return Scene(cable=cord(bending_damping=2e-4), shape=Straight(), grasps=grasps, environment=around)


@_scene
def pulled_over_the_edge_of_a_box() -> Scene:
    box = Box(center=(0.3, 0.0, -0.2), size=(0.6, 0.4, 0.395), friction=0.2)
    grasp = Grasp(u=0.0, path=move(-0.2, 0.0, -0.05, time=2.0))
    start = Straight(start=(-0.1, 0, 0.0), direction=(1, 0, 0))
    cable = cord(length=0.65, bending_damping=2e-4)
    around = hanging(obstacles=(box,))
    return Scene(cable=cable, shape=start, grasps=(grasp,), environment=around)


@_scene
def swung_against_a_ball() -> Scene:
    ball = Sphere(center=(0.2, 0.02, -0.6), radius=0.08, friction=0.2)
    grasp = Grasp(u=0.0, path=move(0.25, 0.0, 0.0, time=1.0))
    start = Straight(direction=(0, 0, -1))
    around = hanging(drag=0.1, obstacles=(ball,))
    return Scene(cable=cord(bending_damping=2e-4), shape=start, grasps=(grasp,), environment=around, horizon=1.5)


@_scene
def carried_past_a_distant_post() -> Scene:
    post = Cylinder(center=(0.5, 1.5, 0.0), radius=0.05, height=2.0)
    grasps = (Grasp(u=0.0, path=move(0.0, 0.3, 0.0, time=1.2)), Grasp(u=1.0, path=move(0.0, 0.3, 0.0, time=1.2)))
    shape = Points(points=sagging(1.0, 0.8), settle=True)
    return Scene(cable=cord(), shape=shape, grasps=grasps, environment=hanging(obstacles=(post,)))


@_scene
def laid_into_a_bin() -> Scene:
    walls = (
        Box(center=(-0.02, 0.0, 0.05), size=(0.04, 0.4, 0.1), friction=0.3),
        Box(center=(0.52, 0.0, 0.05), size=(0.04, 0.4, 0.1), friction=0.3),
    )
    grasps = (
        Grasp(u=0.0, path=move(0.05, 0.0, -0.15, time=1.5)),
        Grasp(u=0.6, path=move(-0.1, 0.05, -0.15, time=1.5)),
    )
    points = sagging(0.6, 0.4)
    points += [0.05, 0.0, 0.3]
    cable = cord(length=0.6, bending_damping=1e-4)
    around = on_table(0.3, drag=0.05, obstacles=walls)
    return Scene(cable=cable, shape=Points(points=points, settle=True), grasps=grasps, environment=around)


# --- loops ---


@_scene
def ends_brought_together_in_the_plane() -> Scene:
    wire = Cable.preset("black-wire", length=0.8)
    near = 0.04
    points = bow(0.8, 1.0)
    chord = points[-1] - points[0]
    closing = -chord * (1 - near / float(np.linalg.norm(chord)))
    path = move(float(closing[0]), float(closing[1]), time=2.0)
    grasps = (Grasp(u=0.0), Grasp(u=0.8, path=path))
    around = on_table(0.0, drag=0.1)
    return Scene(cable=wire, shape=Points(points=points), grasps=grasps, environment=around)


@_scene
def loop_pulled_smaller_in_space() -> Scene:
    phi = np.linspace(-0.6, 2 * np.pi + 0.6, 121)
    loop = 0.1 * np.column_stack([np.sin(phi), -np.cos(phi), 0.15 * (phi - np.pi)])
    length = float(np.linalg.norm(np.diff(loop, axis=0), axis=1).sum())
    cable = cord(length=length, bending_stiffness=5e-4, bending_damping=1e-4)
    way = 0.5 * (loop[-1] - loop[0]) / np.linalg.norm(loop[-1] - loop[0]) * 0.1
    grasps = (
        Grasp(u=0.0, path=Move(displacement=-way, duration=1.5)),
        Grasp(u=length, path=Move(displacement=way, duration=1.5)),
    )
    around = Environment(gravity=WEIGHTLESS, drag=0.2)
    return Scene(cable=cable, shape=Points(points=loop), grasps=grasps, environment=around)


@_scene
def pinched_hairpin_on_a_table() -> Scene:
    leg, radius = 0.3, 0.05
    s = np.linspace(0.0, np.pi * radius + 2 * leg, 121)
    phi = np.clip((s - leg) / radius, 0.0, np.pi)
    x = np.minimum(s - leg, 0.0) + radius * np.sin(phi) - np.maximum(s - leg - np.pi * radius, 0.0)
    points = np.column_stack([x, -radius * np.cos(phi)])
    length = float(s[-1])
    grasps = (
        Grasp(u=0.25, path=move(0.0, 0.035, time=1.5)),
        Grasp(u=length - 0.25, path=move(0.0, -0.035, time=1.5)),
    )
    cable = cord(length=length, bending_damping=2e-4)
    # the strands are to stay side by side: on a table one could else lie over the other
    return Scene(
        cable=cable,
        shape=Points(points=points),
        grasps=grasps,
        environment=on_table(0.2, drag=0.1),
        effects={"self_contact": "on"},
    )


@_scene
def gripper_waits_while_the_other_moves() -> Scene:
    grasps = (Grasp(u=0.0, path=Still()), Grasp(u=0.7, path=move(-0.1, 0.3, 0.0, time=1.5)))
    shape = Points(points=sagging(1.0, 0.6))
    around = Environment(gravity=WEIGHTLESS, drag=0.2)
    return Scene(cable=cord(), shape=shape, grasps=grasps, environment=around)
