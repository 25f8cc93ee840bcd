"""Hanging in space, twisted, plastic and naturally bent."""

import numpy as np

from benchmarks.catalogue.entries import Entries
from benchmarks.catalogue.parts import WEIGHTLESS, bow, cord, hanging, move, on_table, pegs, sagging
from benchmarks.premises import ends_on, stays_elastic, yields
from dlocore import (
    Cable,
    Environment,
    Grasp,
    Load,
    Points,
    Scene,
    Straight,
    Waypoints,
)

entry = Entries()

# --- hanging in space ---


@entry
def hung_by_one_end_and_carried_sideways() -> Scene:
    grasp = Grasp(u=0.0, path=move(0.3, 0.0, 0.1, time=1.0))
    start = Straight(direction=(0, 0, -1))
    return Scene(cable=cord(), shape=start, grasps=(grasp,), environment=hanging(), horizon=1.5)


@entry
def two_grippers_carry_a_hanging_cable() -> Scene:
    shape = Points(points=sagging(1.0, 0.7), settle=True)
    grasps = (Grasp(u=0.0, path=move(0.1, 0.2, 0.1, time=1.0)), Grasp(u=1.0, path=move(-0.1, 0.25, 0.0, time=1.0)))
    return Scene(cable=cord(), shape=shape, grasps=grasps, environment=hanging())


@entry
def clamped_hanging_cable_with_one_end_moved() -> Scene:
    shape = Points(points=sagging(1.0, 0.7), settle=True)
    grasps = (Grasp(u=0.0, hold="clamp"), Grasp(u=1.0, hold="clamp", path=move(-0.2, 0.2, 0.1, time=1.0)))
    return Scene(cable=cord(), shape=shape, grasps=grasps, environment=hanging(drag=0.1))


@entry
def cantilever_lifted_and_turned_down() -> Scene:
    wire = Cable.preset("red-wire", length=0.3, bending_damping=5e-5)
    grasp = Grasp(u=0.0, hold="tangent", path=move(0.0, 0.0, 0.1, time=1.0, rotation=(0, 0.7, 0)))
    return Scene(cable=wire, shape=Straight(settle=True), grasps=(grasp,), environment=hanging(drag=0.05))


@entry
def whip_of_a_hanging_cord() -> Scene:
    path = Waypoints(times=[0.0, 0.4, 0.8, 1.4], positions=[(0, 0, 0), (0.2, 0, 0.05), (-0.2, 0.05, 0.1), (0, 0, 0)])
    start = Straight(direction=(0, 0, -1))
    around = hanging(drag=0.02, drag_quadratic=0.05)
    cable = cord(bending_damping=3e-4)
    return Scene(cable=cable, shape=start, grasps=(Grasp(u=0.0, path=path),), environment=around)


@entry
def released_by_one_of_two_grippers() -> Scene:
    shape = Points(points=sagging(1.0, 0.6), settle=True)
    grasps = (Grasp(u=0.0, path=move(0.0, 0.1, 0.0, time=1.0)), Grasp(u=1.0, release_time=0.4))
    return Scene(cable=cord(), shape=shape, grasps=grasps, environment=hanging(drag=0.1), horizon=1.5)


@entry
def late_grasp_of_a_swinging_end() -> Scene:
    start = Straight(direction=(0.3, 0, -1))
    grasps = (Grasp(u=0.0), Grasp(u=0.9, grasp_time=0.6, path=move(0.0, 0.1, 0.15, time=0.8)))
    return Scene(
        cable=cord(bending_damping=5e-4), shape=start, grasps=grasps, environment=hanging(drag=0.1), horizon=1.6
    )


@entry
def white_wire_between_two_grippers_in_space() -> Scene:
    wire = Cable.preset("white-wire", bending_damping=1e-5)
    shape = Points(points=sagging(1.0, 0.5), settle=True)
    grasps = (
        Grasp(u=0.0, hold="tangent", path=move(0.0, 0.0, 0.0, time=1.2, rotation=(0, 0, 0.6))),
        Grasp(u=1.0, hold="tangent", path=move(0.2, 0.1, 0.1, time=1.2)),
    )
    return Scene(cable=wire, shape=shape, grasps=grasps, environment=hanging(drag=0.02))


@entry
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


@entry
def heavy_electric_cable_held_at_three_places() -> Scene:
    cable = Cable.preset("black-electric-cable", length=2.0, bending_damping=0.005)
    shape = Points(points=sagging(2.0, 1.7), settle=True)
    grasps = (Grasp(u=0.0), Grasp(u=1.0, path=move(0.0, 0.1, 0.15, time=1.5)), Grasp(u=2.0))
    return Scene(cable=cable, shape=shape, grasps=grasps, environment=hanging(drag=0.2))


# --- twist ---


@entry
def gripper_twists_a_bowed_cable_by_half_a_turn() -> Scene:
    around = Environment(gravity=WEIGHTLESS, drag=0.2)
    turn = Grasp(u=0.5, hold="clamp", path=move(-0.02, 0.0, time=2.0, rotation=(3.0, 0, 0)))
    cable = cord(length=0.5, bending_stiffness=2e-3, torsional_stiffness=1.5e-3, torsional_damping=1e-4)
    shape = Points(points=bow(0.5, 0.3))
    return Scene(cable=cable, shape=shape, grasps=(Grasp(u=0.0, hold="clamp"), turn), environment=around)


@entry
def wrist_rolls_a_hanging_bow() -> Scene:
    shape = Points(points=sagging(0.6, 0.35), settle=True)
    cable = Cable.preset("black-wire", length=0.6, torsional_damping=1e-4, bending_damping=1e-4)
    roll = move(0.0, 0.0, 0.0, time=1.5, rotation=(1.5, 0, 0))
    grasps = (Grasp(u=0.0, hold="clamp"), Grasp(u=0.6, hold="clamp", path=roll))
    return Scene(cable=cable, shape=shape, grasps=grasps, environment=hanging(drag=0.1))


@entry
def clamped_bow_turned_out_of_its_plane() -> Scene:
    wire = Cable.preset("red-wire", length=0.6, bending_damping=5e-5)
    grasps = (
        Grasp(u=0.0, hold="clamp"),
        Grasp(u=0.6, hold="clamp", path=move(-0.05, 0.0, 0.1, time=1.5, rotation=(0, 0.8, 0.4))),
    )
    around = Environment(gravity=WEIGHTLESS, drag=0.1)
    return Scene(cable=wire, shape=Points(points=bow(0.6, 1.5)), grasps=grasps, environment=around)


# --- plastic and naturally bent ---


@entry.where(yields)
def wire_bent_for_good_in_the_plane() -> Scene:
    wire = cord(
        length=0.4, diameter=0.003, bending_stiffness=4e-3, bending_damping=4e-4, yield_strain=0.004, memory_rate=30.0
    )
    turn = move(-0.1, 0.1, time=1.5, rotation=(0, 0, 1.6))
    grasps = (Grasp(u=0.0, hold="tangent"), Grasp(u=0.4, hold="tangent", path=turn, release_time=1.6))
    around = on_table(0.0, drag=0.2)
    return Scene(cable=wire, shape=Straight(), grasps=grasps, environment=around, horizon=2.2)


@entry.where(ends_on("obstacles[0]"), yields)
def plastic_cable_laid_around_a_peg_on_a_rough_table() -> Scene:
    cable = cord(yield_strain=0.02, memory_rate=20.0)
    grasp = Grasp(u=0.0, path=move(0.3, 0.35, time=2.0), release_time=2.0)
    around = on_table(0.3, obstacles=pegs((0.25, 0.08), radius=0.03))
    return Scene(cable=cable, shape=Straight(), grasps=(grasp,), environment=around, horizon=2.5)


@entry
def coil_memory_of_a_cable_in_space() -> Scene:
    cable = Cable.preset("black-wire", rest_shape="initial", bending_damping=1e-4)
    points = bow(1.0, 2.5)
    start = np.column_stack([points[:, 0], 0 * points[:, 0], -points[:, 1]])
    grasps = (Grasp(u=0.0, hold="clamp", path=move(0.0, 0.2, 0.1, time=1.2, rotation=(0, 0, 0.8))),)
    around = Environment(gravity=WEIGHTLESS, drag=0.1)
    return Scene(cable=cable, shape=Points(points=start), grasps=grasps, environment=around)


@entry.where(stays_elastic)
def barely_stressed_plastic_cable() -> Scene:
    cable = cord(yield_strain=0.5, memory_rate=20.0)
    grasp = Grasp(u=0.25, path=move(0.0, 0.3, time=1.6))
    return Scene(cable=cable, shape=Straight(), grasps=(grasp,), environment=on_table(0.0, drag=0.05))
