"""In the plane: on a smooth table or without weight, on a rough table, around pegs and along walls."""

import numpy as np

from benchmarks.catalogue.entries import Entries
from benchmarks.catalogue.parts import WEIGHTLESS, bow, cord, move, on_table, pegs, wave
from benchmarks.premises import comes_to_rest, ends_on, slides_on, touches, untouched
from dlocore import (
    Box,
    Cable,
    Environment,
    Grasp,
    Load,
    Points,
    Scene,
    Straight,
    Table,
)

entry = Entries()

# --- in the plane, on a smooth table or without weight ---


@entry
def paper_case_at_a_quarter() -> Scene:
    grasp = Grasp(u=0.25, path=move(0.0, 0.5, time=1.6))
    return Scene(cable=cord(), shape=Straight(), grasps=(grasp,), environment=on_table(0.0, drag=0.05))


@entry
def fast_sideways_on_a_smooth_table() -> Scene:
    grasp = Grasp(u=0.5, path=move(0.0, 0.4, time=0.5))
    return Scene(cable=cord(), shape=Straight(), grasps=(grasp,), environment=on_table(0.0), horizon=1.0)


@entry
def slow_turn_of_a_gripper_on_a_smooth_table() -> Scene:
    grasp = Grasp(u=0.0, hold="tangent", path=move(0.1, 0.1, time=2.5, rotation=(0, 0, 1.2)))
    return Scene(cable=cord(), shape=Straight(), grasps=(grasp,), environment=on_table(0.0, drag=0.2))


@entry
def two_grippers_bend_a_wire_in_the_plane() -> Scene:
    wire = Cable.preset("black-wire", length=0.6)
    grasps = (
        Grasp(u=0.0, hold="tangent"),
        Grasp(u=0.6, hold="tangent", path=move(-0.15, 0.1, time=1.5, rotation=(0, 0, 0.8))),
    )
    return Scene(cable=wire, shape=Points(points=bow(0.6, 0.6)), grasps=grasps, environment=on_table(0.0, drag=0.1))


@entry
def weightless_swing_with_quadratic_drag() -> Scene:
    grasp = Grasp(u=0.0, path=move(0.0, 0.4, time=0.8))
    around = Environment(gravity=WEIGHTLESS, drag_quadratic=0.3)
    return Scene(cable=cord(), shape=Straight(), grasps=(grasp,), environment=around, horizon=1.5)


@entry
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


@entry
def short_cable_pulled_slowly_over_a_rough_table() -> Scene:
    cable = cord(length=0.2, bending_stiffness=2e-4, diameter=0.003, linear_density=0.02)
    grasp = Grasp(u=0.0, path=move(0.0, 0.15, time=2.0))
    return Scene(cable=cable, shape=Straight(), grasps=(grasp,), environment=on_table(0.4))


@entry
def cable_dragged_along_itself() -> Scene:
    grasp = Grasp(u=0.0, path=move(-0.3, 0.0, time=2.0))
    return Scene(cable=cord(), shape=Straight(), grasps=(grasp,), environment=on_table(0.3))


@entry
def seen_cable_moved_at_its_middle_and_released() -> Scene:
    cable = cord(length=0.8, diameter=0.006, linear_density=0.06, bending_stiffness=1.3e-3, rest_shape="initial")
    grasp = Grasp(u=0.4, hold="tangent", path=move(0.05, 0.2, time=1.5, rotation=(0, 0, 0.6)), release_time=1.5)
    shape = Points(points=wave(0.8, 0.05, 1.2))
    return Scene(cable=cable, shape=shape, grasps=(grasp,), environment=on_table(0.3), horizon=2.0)


@entry
def fast_pull_over_a_slightly_rough_table() -> Scene:
    grasp = Grasp(u=0.1, path=move(-0.1, 0.5, time=0.6))
    return Scene(cable=cord(), shape=Straight(), grasps=(grasp,), environment=on_table(0.1), horizon=1.0)


@entry
def two_grippers_straighten_a_wave_on_a_rough_table() -> Scene:
    points = wave(1.0, 0.06, 1.5)
    slack = 0.97 - float(np.linalg.norm(points[-1] - points[0]))
    grasps = (Grasp(u=0.0), Grasp(u=1.0, path=move(slack, 0.0, time=2.0)))
    return Scene(cable=cord(), shape=Points(points=points), grasps=grasps, environment=on_table(0.3))


@entry
def long_heavy_cable_dragged_by_its_end() -> Scene:
    cable = Cable.preset("orange-electric-cable", length=5.0)
    grasp = Grasp(u=0.0, path=move(0.0, 0.8, time=3.0))
    return Scene(cable=cable, shape=Straight(), grasps=(grasp,), environment=on_table(0.5))


@entry
def regrasp_on_a_rough_table() -> Scene:
    first = Grasp(u=0.2, path=move(0.0, 0.2, time=1.0), release_time=1.0)
    second = Grasp(u=0.8, path=move(0.0, 0.2, time=1.0), grasp_time=1.1)
    return Scene(cable=cord(), shape=Straight(), grasps=(first, second), environment=on_table(0.4), horizon=2.2)


@entry
def three_grippers_lay_an_s_on_a_rough_table() -> Scene:
    grasps = (
        Grasp(u=0.0, path=move(0.1, 0.1, time=1.5)),
        Grasp(u=0.5),
        Grasp(u=1.0, path=move(-0.1, -0.1, time=1.5)),
    )
    shape = Points(points=wave(1.0, 0.02, 1.0))
    return Scene(cable=cord(), shape=shape, grasps=grasps, environment=on_table(0.25))


@entry.where(slides_on)
def sloping_table_that_the_cable_slides_down() -> Scene:
    around = Environment(gravity=(2.5, 0.0, -9.5), table=Table(friction=0.15))
    grasp = Grasp(u=0.0)
    return Scene(cable=cord(), shape=Straight(direction=(0.2, 1, 0)), grasps=(grasp,), environment=around, horizon=1.5)


@entry.where(comes_to_rest)
def thrown_cable_that_friction_stops() -> Scene:
    start = Straight(velocity=(0.2, 0.8, 0.0))
    return Scene(cable=cord(), shape=start, environment=on_table(0.3), horizon=1.0)


# --- around pegs and along walls, on a table ---


@entry.where(ends_on("obstacles[0]"))
def dragged_against_a_peg() -> Scene:
    grasp = Grasp(u=0.0, path=move(0.2, 0.4, time=2.0))
    around = on_table(0.3, obstacles=pegs((0.25, 0.06)))
    return Scene(cable=cord(), shape=Straight(), grasps=(grasp,), environment=around)


@entry.where(touches("obstacles[0]", "obstacles[1]"))
def threaded_between_two_pegs() -> Scene:
    grasp = Grasp(u=0.0, path=move(0.1, 0.35, time=2.0))
    around = on_table(0.2, obstacles=pegs((0.35, 0.06), (0.75, -0.019), friction=0.1))
    return Scene(cable=cord(), shape=Straight(), grasps=(grasp,), environment=around)


@entry.where(touches("obstacles[0]"))
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


@entry.where(ends_on("obstacles[0]"))
def pushed_sideways_into_a_wall() -> Scene:
    wall = Box(center=(0.5, 0.25, 0.0), size=(1.4, 0.1, 0.1), friction=0.2)
    grasps = (Grasp(u=0.1, path=move(0.0, 0.17, time=1.5)), Grasp(u=0.9, path=move(-0.05, 0.05, time=1.5)))
    shape = Points(points=bow(1.0, 0.3))
    return Scene(cable=cord(), shape=shape, grasps=grasps, environment=on_table(0.2, obstacles=(wall,)))


@entry.where(untouched("obstacles[0]", "obstacles[1]", "obstacles[2]"))
def pegs_far_from_the_motion() -> Scene:
    grasp = Grasp(u=0.25, path=move(0.0, 0.2, time=1.5))
    around = on_table(0.2, obstacles=pegs((0.5, -0.8), (2.0, 0.3), (-0.9, 0.5)))
    return Scene(cable=cord(), shape=Straight(), grasps=(grasp,), environment=around)


@entry.where(ends_on("obstacles[0]"))
def stiff_rod_levered_around_a_peg() -> Scene:
    rod = Cable.preset("tent-pole", length=0.8)
    grasp = Grasp(u=0.0, path=move(0.0, -0.1, time=1.5))
    around = on_table(0.2, obstacles=pegs((0.3, -0.02)))
    return Scene(cable=rod, shape=Straight(), grasps=(grasp,), environment=around)
