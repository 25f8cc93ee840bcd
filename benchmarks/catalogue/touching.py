"""Onto and off the table, over and along obstacles in space, and loops."""

import numpy as np

from benchmarks.catalogue.entries import Entries
from benchmarks.catalogue.parts import WEIGHTLESS, bow, cord, hanging, move, on_table, sagging
from benchmarks.premises import ends_on, strands_meet, tightens, touches, untouched
from dlocore import (
    Box,
    Cable,
    Capsule,
    Cylinder,
    Environment,
    Grasp,
    Move,
    Points,
    Scene,
    Sphere,
    Still,
    Straight,
    Waypoints,
)

entry = Entries()

# --- onto and off the table ---


@entry.where(ends_on("table"))
def cable_dropped_onto_the_table() -> Scene:
    start = Straight(start=(0, 0, 0.06), direction=(1, 0, 0.05))
    cable = cord(bending_damping=2e-4)
    return Scene(cable=cable, shape=start, environment=on_table(0.3), horizon=0.8)


@entry
def end_lifted_from_the_table() -> Scene:
    grasp = Grasp(u=0.0, path=move(0.15, 0.0, 0.25, time=2.0))
    return Scene(cable=cord(bending_damping=1e-4), shape=Straight(), grasps=(grasp,), environment=on_table(0.4))


@entry
def middle_lifted_from_the_table() -> Scene:
    grasp = Grasp(u=0.5, path=move(0.0, 0.1, 0.2, time=1.5))
    cable = cord(bending_damping=1e-4)
    return Scene(cable=cable, shape=Straight(), grasps=(grasp,), environment=on_table(0.3))


@entry.where(ends_on("table"))
def hanging_cable_laid_down_on_the_table() -> Scene:
    path = Waypoints(times=[0.0, 1.0, 2.5], positions=[(0, 0, 0.9), (0.1, 0, 0.5), (0.5, 0, 0.15)])
    cable = cord(length=0.8, bending_damping=1e-4)
    start = Straight(start=(0, 0, 0.9), direction=(0, 0, -1))
    around = on_table(0.4, drag=0.05)
    return Scene(cable=cable, shape=start, grasps=(Grasp(u=0.0, path=path),), environment=around)


@entry.where(untouched("table"))
def cable_carried_high_above_a_table() -> Scene:
    points = sagging(0.8, 0.6)
    points[:, 2] += 0.6
    grasps = (Grasp(u=0.0, path=move(0.0, 0.2, 0.1, time=1.2)), Grasp(u=0.8, path=move(0.0, 0.2, 0.1, time=1.2)))
    cable = cord(length=0.8)
    return Scene(cable=cable, shape=Points(points=points, settle=True), grasps=grasps, environment=on_table(0.3))


# --- over and along obstacles in space ---


@entry.where(ends_on("obstacles[0]"))
def lowered_over_a_bar() -> Scene:
    bar = Capsule(start=(0.5, -0.2, -0.1), end=(0.5, 0.2, -0.1), radius=0.03, friction=0.3)
    down = (Move(displacement=(0.1, 0, -0.2), duration=1.2), Move(displacement=(-0.1, 0, -0.2), duration=1.2))
    grasps = (Grasp(u=0.0, path=down[0]), Grasp(u=1.0, path=down[1]))
    around = hanging(obstacles=(bar,))
    return Scene(cable=cord(bending_damping=2e-4), shape=Straight(), grasps=grasps, environment=around)


@entry.where(ends_on("obstacles[0]"))
def pulled_over_the_edge_of_a_box() -> Scene:
    box = Box(center=(0.3, 0.0, -0.2), size=(0.6, 0.4, 0.395), friction=0.2)
    grasp = Grasp(u=0.0, path=move(-0.2, 0.0, -0.05, time=2.0))
    start = Straight(start=(-0.1, 0, 0.0), direction=(1, 0, 0))
    cable = cord(length=0.65, bending_damping=2e-4)
    around = hanging(obstacles=(box,))
    return Scene(cable=cable, shape=start, grasps=(grasp,), environment=around)


@entry.where(touches("obstacles[0]"))
def swung_against_a_ball() -> Scene:
    ball = Sphere(center=(0.2, 0.02, -0.6), radius=0.08, friction=0.2)
    grasp = Grasp(u=0.0, path=move(0.25, 0.0, 0.0, time=1.0))
    start = Straight(direction=(0, 0, -1))
    around = hanging(drag=0.1, obstacles=(ball,))
    return Scene(cable=cord(bending_damping=2e-4), shape=start, grasps=(grasp,), environment=around, horizon=1.5)


@entry.where(untouched("obstacles[0]"))
def carried_past_a_distant_post() -> Scene:
    post = Cylinder(center=(0.5, 1.5, 0.0), radius=0.05, height=2.0)
    grasps = (Grasp(u=0.0, path=move(0.0, 0.3, 0.0, time=1.2)), Grasp(u=1.0, path=move(0.0, 0.3, 0.0, time=1.2)))
    shape = Points(points=sagging(1.0, 0.8), settle=True)
    return Scene(cable=cord(), shape=shape, grasps=grasps, environment=hanging(obstacles=(post,)))


@entry.where(ends_on("table", "obstacles[0]", "obstacles[1]"))
def laid_into_a_bin() -> Scene:
    walls = (
        Box(center=(0.08, 0.0, 0.05), size=(0.04, 0.4, 0.1), friction=0.3),
        Box(center=(0.42, 0.0, 0.05), size=(0.04, 0.4, 0.1), friction=0.3),
    )
    grasps = (
        Grasp(u=0.0, path=move(0.13, 0.0, -0.18, time=1.5)),
        Grasp(u=0.6, path=move(-0.13, 0.03, -0.18, time=1.5)),
    )
    points = sagging(0.6, 0.4)
    points += [0.05, 0.0, 0.3]
    cable = cord(length=0.6, bending_damping=1e-4)
    around = on_table(0.3, drag=0.05, obstacles=walls)
    return Scene(cable=cable, shape=Points(points=points, settle=True), grasps=grasps, environment=around)


# --- loops ---


@entry
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


@entry.where(tightens(0.7))
def loop_pulled_smaller_in_space() -> Scene:
    # the clamps keep its twist, which takes more than to bend: else it would open
    phi = np.linspace(-0.6, 2 * np.pi + 0.6, 121)
    loop = 0.1 * np.column_stack([np.sin(phi), -np.cos(phi), 0.06 * (phi - np.pi)])
    length = float(np.linalg.norm(np.diff(loop, axis=0), axis=1).sum())
    cable = cord(length=length, bending_stiffness=5e-4, bending_damping=1e-4, torsional_stiffness=2.5e-3)
    grasps = (
        Grasp(u=0.0, hold="clamp", path=move(-0.1, 0.0, time=1.5)),
        Grasp(u=length, hold="clamp", path=move(0.1, 0.0, time=1.5)),
    )
    around = Environment(gravity=WEIGHTLESS, drag=0.2)
    return Scene(cable=cable, shape=Points(points=loop), grasps=grasps, environment=around)


@entry.where(strands_meet)
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


@entry
def gripper_waits_while_the_other_moves() -> Scene:
    grasps = (Grasp(u=0.0, path=Still()), Grasp(u=0.7, path=move(-0.1, 0.3, 0.0, time=1.5)))
    shape = Points(points=sagging(1.0, 0.6))
    around = Environment(gravity=WEIGHTLESS, drag=0.2)
    return Scene(cable=cord(), shape=shape, grasps=grasps, environment=around)
