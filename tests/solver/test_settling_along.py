"""An equilibrium at a later time: grippers close where the cable is by then, and it is carried through nothing."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from dlocore import (
    Cable,
    Capsule,
    Cylinder,
    Environment,
    Grasp,
    Load,
    Move,
    PointMass,
    Points,
    Scene,
    SceneError,
    Sphere,
    Straight,
    Table,
    Waypoints,
    equilibrium,
)
from dlocore.problem.problem import pose
from tests.solver.scenes import Floats

DIAMETER = 0.004
_TURN = np.linspace(-1.0, 1.0, 41)
ARC = 0.5 * np.column_stack([np.sin(_TURN), np.cos(_TURN) - np.cos(1.0)])  # of 1 m


def cable(**changes: Any) -> Cable:
    return Cable(**{"length": 1.0, "diameter": DIAMETER, "linear_density": 0.05, "bending_stiffness": 1e-3} | changes)


# --- grippers that close later ---


def let_down_by(late: float, ways: tuple[Grasp, ...] = ()) -> Scene:
    """Return a cable that hangs from a gripper that moves by 0.6 m in 1 s, and is grasped at its end meanwhile."""
    moved = Grasp(u=0.0, path=Move(displacement=(0.6, 0.0, 0.0), duration=1.0, profile="linear"))
    down = Straight(direction=(0.0, 0.0, -1.0), settle=True)
    grasps = (moved, *ways, Grasp(u=1.0, grasp_time=late))
    return Scene(cable=cable(bending_stiffness=2e-3), shape=down, grasps=grasps, horizon=2.0)


@pytest.mark.parametrize("late", [0.07, 0.5, 0.52])
def test_a_gripper_that_closes_later_holds_the_cable_where_it_hung_then(late: float) -> None:
    for at in (late, 1.0, 4.0):  # it had been where it was a 24th of this before
        end = equilibrium(let_down_by(late), at=at, n_u=17).positions([1.0])[0]
        np.testing.assert_allclose(end, [0.6 * late, 0.0, -1.0001], rtol=0.0, atol=1e-4)


def test_what_comes_after_the_last_move_changes_nothing() -> None:
    # it had been carried in 24 steps of all the time, so that a long one went over the move in a step
    found = [equilibrium(let_down_by(0.4), at=at, n_u=17) for at in (1.0, 100.0)]
    np.testing.assert_allclose(found[0].reactions, found[1].reactions, rtol=1e-9)


LATE_GRASP, LATE_LOAD = Grasp(u=0.5, grasp_time=60.0), Load(u=0.5, force=np.zeros((2, 3)), times=(0.0, 60.0))


@pytest.mark.parametrize("later", [{"grasps": LATE_GRASP}, {"loads": LATE_LOAD}])
def test_what_comes_later_takes_no_steps_from_a_quick_move(later: dict[str, Any]) -> None:
    # 24 steps of all the time went over a full turn in one, so that the cable was not wound up
    turned = Move(displacement=(-0.4, 0.2, 0.1), rotation=(0.0, 0.0, 2.0 * np.pi), duration=1.0)
    grasps = (Grasp(u=0.0, hold="clamp"), Grasp(u=1.0, hold="clamp", path=turned))
    alone = Scene(cable=cable(), shape=Straight(), grasps=grasps, horizon=60.0)
    scene = replace(alone, **{name: (*getattr(alone, name), one) for name, one in later.items()})
    for each in (alone, scene):
        middle = equilibrium(each, at=60.0, n_u=17).positions([0.5])[0]
        np.testing.assert_allclose(middle, [0.3312, 0.1234, -0.2786], atol=2e-3)  # of 65 control points


def test_a_quick_turn_along_a_long_recorded_path_is_gone_through() -> None:
    t = np.union1d(np.arange(0.0, 61.0), np.linspace(29.0, 30.0, 11))
    half, share = np.pi * np.clip(t - 29.0, 0.0, 1.0), np.clip(t / 20.0, 0.0, 1.0)
    positions = (1.0, 0.0, 0.0) + share[:, None] * (-0.4, 0.2, 0.1)
    quaternions = np.column_stack([np.cos(half), 0.0 * t, 0.0 * t, np.sin(half)])
    recorded = Waypoints(times=t, positions=positions, orientations=quaternions)
    grasps = (Grasp(u=0.0, hold="clamp"), Grasp(u=1.0, hold="clamp", path=recorded))
    scene = Scene(cable=cable(), shape=Straight(), grasps=grasps, horizon=60.0)
    middle = equilibrium(scene, at=60.0, n_u=17).positions([0.5])[0]
    np.testing.assert_allclose(middle, [0.3312, 0.1234, -0.2786], atol=2e-3)  # of 65 control points


@pytest.mark.parametrize("overlap", [0.0, 0.01])
def test_a_cable_that_is_handed_over_stays_where_the_first_gripper_had_it(overlap: float) -> None:
    # which lets go as the second closes, or so soon after it that both are within a 24th of the time
    way = Move(displacement=(0.0, 0.0, 0.3), duration=0.1)
    gives = Grasp(u=1.0, path=way, release_time=0.2 + overlap)
    shape = Points(points=np.column_stack([ARC[:, 0], 0.0 * ARC[:, 0], -ARC[:, 1]]))
    held = Scene(cable=cable(), shape=shape, grasps=(Grasp(u=0.0), gives), horizon=10.0)
    handed = replace(held, grasps=(*held.grasps, Grasp(u=0.6, grasp_time=0.2)))
    there, later = (equilibrium(scene, at=at) for scene, at in ((held, 0.15), (handed, 6.0)))
    np.testing.assert_allclose(later.positions([0.6]), there.positions([0.6]), atol=1e-4)


def test_stops_between_waypoints_are_gone_through() -> None:
    # the way of the first leads up to 0.4 m and down again within a 24th of the time, the second closes at its top
    way = Waypoints(times=(0.0, 0.1, 0.11, 0.2, 10.0), positions=[(0.0, 0.0, z) for z in (0.0, 0.4, 0.4, 0.0, 0.0)],
                    profile="minimum_jerk")  # fmt: skip
    grasps = (Grasp(u=0.0, path=way), Grasp(u=1.0, grasp_time=0.105))
    scene = Scene(cable=cable(), shape=Straight(direction=(0.0, 0.0, -1.0)), grasps=grasps, horizon=10.0)
    end = equilibrium(scene, at=10.0, n_u=17).positions([1.0])[0]
    np.testing.assert_allclose(end, [0.0, 0.0, -0.6], atol=1e-3)


def test_a_cable_that_nothing_holds_yet_stays_where_it_lies() -> None:
    points = np.column_stack([ARC, 0.0 * ARC[:, 0]])
    lies = Scene(
        cable=cable(),
        shape=Points(points=points),
        grasps=(Grasp(u=0.0, grasp_time=0.5), Grasp(u=1.0, grasp_time=0.5)),
        environment=Environment(table=Table()),
        horizon=1.0,
    )
    found = equilibrium(lies, at=1.0, n_u=17)
    np.testing.assert_allclose(found.positions([0.0, 1.0]), points[[0, -1]], atol=1e-4)


def test_a_cable_that_is_folded_on_few_control_points_is_told_and_refined() -> None:
    # pushed along itself in steps longer than its spans; 25 control points were called at rest in such a fold
    along = Move(displacement=(-1.2, 0.0, 0.3), duration=0.1)
    grasps = (Grasp(u=0.0), Grasp(u=1.0, path=along), Grasp(u=0.6, grasp_time=5.0))
    scene = Scene(cable=cable(), shape=Straight(), grasps=grasps, horizon=10.0)
    few = equilibrium(scene, at=0.2, n_u=25)
    assert few.status == "stalled"
    assert few.message.startswith("The cable is folded")
    enough = equilibrium(scene, at=0.2)
    assert enough.status == "converged"
    np.testing.assert_allclose(enough.positions([0.6])[0], [-0.23429, 0.0, -0.09854], atol=1e-4)


# --- what nothing holds at the end ---

FREE = Environment(gravity=(0.0, 0.0, 0.0))
OVER = Load(u=0.5, force=[(0.0, 0.0, 1.0), (0.0, 0.0, 0.0)], times=(0.0, 1.0))


def test_a_cable_that_is_lifted_off_a_table_and_released_comes_to_rest_on_it() -> None:
    lifted = Grasp(u=0.0, path=Move(displacement=(0.0, 0.0, 0.2), duration=1.0), release_time=1.5)
    pressed = Load(u=0.5, force=(0.0, 0.0, -0.1))
    scene = Scene(
        cable=cable(), shape=Straight(), grasps=(lifted,), loads=(pressed,), environment=Environment(table=Table())
    )
    found = equilibrium(scene, at=3.0, n_u=17)
    assert found.status == "converged"
    np.testing.assert_allclose(found.positions(np.linspace(0.0, 1.0, 9))[:, 2], 0.0, atol=0.03 * DIAMETER)


@pytest.mark.parametrize(("load", "at"), [(Load(u=0.5, force=(0.0, 0.0, 0.0)), 0.0), (OVER, 2.0)])
def test_a_cable_that_no_force_drives_needs_no_grasp(load: Load, at: float) -> None:
    scene = Scene(cable=cable(), shape=Straight(), loads=(load,), environment=FREE, horizon=2.0)
    found = equilibrium(scene, at=at, n_u=9)
    assert found.status == "converged"
    np.testing.assert_allclose(found.positions([0.0, 1.0]), [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]], atol=1e-9)


@pytest.mark.parametrize(
    ("environment", "loads", "at"),
    [
        (FREE, (OVER,), 0.75),
        (Environment(), (), 3.0),
        (Environment(table=Table()), (Load(u=0.5, force=(0.1, 0.0, 0.0)),), 3.0),
        (Environment(table=Table(), gravity=(1.0, 0.0, -9.0)), (), 3.0),
    ],
)
def test_grasps_that_are_open_then_hold_nothing(environment: Environment, loads: tuple[Load, ...], at: float) -> None:
    opened = Grasp(u=0.0, path=Move(displacement=(0.0, 0.0, 0.2), duration=0.4), release_time=0.5)
    scene = Scene(cable=cable(), shape=Straight(), grasps=(opened,), loads=loads, environment=environment, horizon=3.0)
    with pytest.raises(SceneError, match=f"primitives: got no grasp that is closed at {at:g} s. Nothing holds it"):
        equilibrium(scene, at=at, n_u=17)


# --- loads on the way ---


def test_a_measured_load_takes_hardly_more_steps_than_a_rough_one() -> None:
    def relaxations(entries: int) -> int:
        t = np.linspace(0.0, 10.0, entries)
        load = Load(u=0.5, force=np.column_stack([0.05 * np.sin(t), 0.0 * t, 0.0 * t - 0.05]), times=t)
        grasps = (Grasp(u=0.0), Grasp(u=1.0, path=Move(displacement=(-0.3, 0.0, 0.0), duration=2.0)))
        scene = Scene(cable=cable(), shape=Straight(), grasps=grasps, loads=(load,), horizon=10.0)
        asked: list[int] = []
        equilibrium(scene, at=10.0, n_u=9, cancelled=lambda: bool(asked.append(1)))
        return len(asked)

    assert relaxations(1000) < 2 * relaxations(25)  # it had been many times as many: each entry was a step


def test_a_short_push_between_even_steps_is_gone_through() -> None:
    # an arch without weight snaps through and stays there; 24 even steps of the minute miss the push
    shape = Points(points=np.column_stack([ARC[:, 0], 0.0 * ARC[:, 0], ARC[:, 1]]))
    push = Load(u=0.5, force=[(0.0, 0.0, -z) for z in (0.0, 0.0, 5.0, 0.0, 0.0)], times=(0.0, 20.1, 20.2, 20.3, 60.0))
    arch = Scene(
        cable=cable(),
        shape=shape,
        grasps=(Grasp(u=0.0), Grasp(u=1.0)),
        environment=Environment(gravity=(0.0, 0.0, 0.0)),
        horizon=60.0,
    )
    heights = [equilibrium(s, at=60.0, n_u=17).positions([0.5])[0, 2] for s in (arch, replace(arch, loads=(push,)))]
    assert heights[0] > 0.2
    assert heights[1] == pytest.approx(-heights[0], rel=1e-3)


# --- what is in the way ---


def sagging(way: Move, obstacle: Capsule) -> Scene:
    """Return a cable that hangs in an arc between two grippers 0.6 m apart that go the same way, across a bar."""
    s = np.linspace(0.0, 1.0, 101)
    points = np.column_stack([0.6 * s, 0.0 * s, -1.49 * s * (1.0 - s)])
    return Scene(
        cable=cable(diameter=0.006),
        shape=Points(points=points, settle=True),
        grasps=(Grasp(u=0.0, path=way), Grasp(u=1.0, path=way)),
        environment=Environment(drag=0.5, obstacles=(obstacle,)),
        horizon=10.0,
    )


@pytest.mark.parametrize("radius", [0.002, 0.01])
def test_a_cable_is_not_carried_through_a_bar_to_its_equilibrium(radius: float) -> None:
    bar = Capsule(start=(-0.3, 0.2, -0.2), end=(0.9, 0.2, -0.2), radius=radius)
    way = Move(displacement=(0.0, 0.3, 0.0), duration=6.0)
    found = equilibrium(sagging(way, bar), at=6.0, n_u=17)
    assert found.status == "converged"
    r = found.positions(np.linspace(0.0, 1.0, 401))
    lowest = r[np.argmin(r[:, 2])]
    assert lowest[1] < 0.18  # it hangs on the bar, from which grippers have gone on; it had hung beside them, at 0.3 m
    assert np.hypot(r[:, 1] - 0.2, r[:, 2] + 0.2).min() > radius + (0.5 - 0.02) * 0.006


@pytest.mark.parametrize("way", [0.0, 1.0])
def test_a_cable_comes_to_rest_on_what_is_far_from_its_start_and_in_its_reach(way: float) -> None:
    # it falls from the horizontal on to a ball half its length below the gripper, and had come to rest within it
    ball = Sphere(center=(way, 0.0, -0.5), radius=0.1)
    moved = Grasp(u=0.0, path=Move(displacement=(way, 0.0, 0.0), duration=1.0))
    around = Environment(obstacles=(ball,))
    scene = Scene(cable=cable(), shape=Straight(), grasps=(moved,), environment=around, horizon=1.0)
    found = equilibrium(scene, at=1.0, n_u=25)
    assert found.status == "converged"
    gaps = np.linalg.norm(found.positions(np.linspace(0.0, 1.0, 401)) - ball.center, axis=1) - 0.1 - 0.5 * DIAMETER
    assert gaps.min() == pytest.approx(0.0, abs=0.03 * DIAMETER)  # 2 % at the nodes of contact


HANDED = (  # over what it falls on to, and pulled over that
    Grasp(u=0.0, release_time=1.0),
    Grasp(u=1.0, grasp_time=0.5, path=Move(displacement=(1.8, 0.0, 1.2), duration=2.0)),
)
HUNG = Straight(direction=(0.0, 0.0, -1.0))


@pytest.mark.parametrize(
    ("shape", "grasps", "center"),
    [(Straight(), (Grasp(u=0.0), Grasp(u=1.0, release_time=0.5)), (0.0, 0.0, -0.5)), (HUNG, HANDED, (1.8, 0.0, -0.3))],
)
def test_a_cable_comes_to_rest_on_what_it_reaches_only_by_then(
    shape: Straight, grasps: tuple[Grasp, ...], center: tuple[float, float, float]
) -> None:
    # released at one end, or taken by a second gripper, it had come to rest within the ball
    around = Environment(obstacles=(Sphere(center=center, radius=0.1),))
    found = equilibrium(Scene(cable=cable(), shape=shape, grasps=grasps, environment=around, horizon=4.0), at=4.0)
    assert found.status == "converged"
    gaps = np.linalg.norm(found.positions(np.linspace(0.0, 1.0, 401)) - center, axis=1) - 0.1 - 0.5 * DIAMETER
    assert gaps.min() == pytest.approx(0.0, abs=0.03 * DIAMETER)


def test_what_is_beyond_reach_whenever_it_is_held_is_left_out() -> None:
    ends = (Grasp(u=0.0), Grasp(u=1.0), Grasp(u=0.9, grasp_time=2.0))
    around = Environment(obstacles=(Sphere(center=(0.0, 0.0, -0.5), radius=0.1),))
    scene = Scene(cable=cable(), shape=Straight(), grasps=ends, environment=around, horizon=4.0)
    assert pose(scene, at_rest=True).contact is None
    scene = replace(scene, grasps=(ends[0], Grasp(u=1.0, release_time=1.0), ends[2]))
    assert pose(scene, at_rest=True).contact is not None


def arc_over_a_bar(gap: float, radius: float, down: float, **changes: Any) -> Scene:
    """Return a cable in an arc between two grippers `gap` apart that go `down` over a bar 3 mm under its middle."""
    half = float(brentq(lambda a: np.sin(a) / a - gap, 1e-3, 3.0))
    angle = np.linspace(-half, half, 101)
    points = np.column_stack([np.sin(angle), 0.0 * angle, np.cos(angle) - np.cos(half)]) / (2.0 * half)
    z = points[50, 2] - radius - 0.003
    way = Move(displacement=(0.0, 0.0, -down), duration=2.0)
    return Scene(
        cable=cable(**changes),
        shape=Points(points=points),
        grasps=(Grasp(u=0.0, path=way), Grasp(u=1.0, path=way)),
        environment=Environment(obstacles=(Capsule(start=(0.0, -0.5, z), end=(0.0, 0.5, z), radius=radius),)),
        horizon=2.0,
    )


def test_contact_that_a_coarse_grid_made_stiffer_is_not_that_of_finer_ones() -> None:
    # 9 control points are pulled taut over the bar, and make contact 600 times as stiff: on finer ones the cable caught
    # on it beside its middle, and forces of the two grippers were 20 % apart, though they were said to be off by 1 %
    found = equilibrium(arc_over_a_bar(0.6, 0.01, 0.06), at=2.0)
    assert found.status == "converged"
    left, right = found.reactions
    np.testing.assert_allclose(left, right * (-1.0, 1.0, 1.0), atol=1e-6)
    np.testing.assert_allclose(right, [0.0868, 0.0, -0.0535], atol=1e-3)  # as on 129 control points and on 385


def test_a_cable_that_goes_through_a_bar_on_its_way_is_told() -> None:
    # pulled taut over it, and then through: it hangs 0.36 m below, and had been called converged
    found = equilibrium(arc_over_a_bar(0.8, 0.003, 0.1, axial_stiffness=500.0), at=2.0, n_u=49)
    assert found.status == "stalled"
    assert found.message.startswith("On its way the cable was pressed 12")  # % of its diameter
    assert equilibrium(arc_over_a_bar(0.8, 0.003, 0.1, axial_stiffness=500.0), at=2.0, n_u=33).status == "converged"


# --- how deep it is pressed in ---


@pytest.mark.parametrize("load", [0.5, 50.0])
def test_a_load_presses_a_cable_into_a_table_no_deeper_than_motions_are(load: float) -> None:
    lifted = Grasp(u=0.0, path=Move(displacement=(0.0, 0.0, 0.05), duration=1.0))
    scene = Scene(
        cable=cable(),
        shape=Straight(),
        grasps=(lifted,),
        loads=(Load(u=0.6, force=(0.0, 0.0, -load)),),
        environment=Environment(table=Table()),
        horizon=1.5,
    )
    found = equilibrium(scene, at=1.0, n_u=33)
    assert found.status == "converged"
    lowest = found.positions(np.linspace(0.0, 1.0, 2001))[:, 2].min()
    assert -lowest < 0.021 * DIAMETER  # it had been 0.055 and 5.2 of it


def over_a_peg(mass: float) -> Scene:
    """Return a cable that is held at one end and hangs over a peg, with a mass at its other end."""
    radius, begin = 0.03 + 0.5 * DIAMETER, 0.5
    u = np.linspace(0.0, 1.0, 401)
    angle = np.clip((u - begin) / radius, 0.0, 0.5 * np.pi)
    x, z = radius * np.sin(angle), radius * np.cos(angle)
    straight = np.column_stack([np.minimum(u - begin, 0.0), -np.maximum(u - begin - 0.5 * np.pi * radius, 0.0)])
    points = np.column_stack([x + straight[:, 0], 0.0 * u, z + straight[:, 1]])
    peg = Cylinder(center=(0.0, 0.0, 0.0), axis=(0.0, 1.0, 0.0), radius=0.03, height=0.3)
    return Scene(
        cable=cable(bending_stiffness=1e-4, axial_stiffness=1e4, point_masses=(PointMass(u=1.0, mass=mass),)),
        shape=Points(points=points, settle=True),
        grasps=(Grasp(u=0.0),),
        environment=Environment(obstacles=(peg,)),
        horizon=0.5,
    )


def deepest_in_the_peg(r: Floats) -> float:
    return 0.03 + 0.5 * DIAMETER - float(np.hypot(r[:, 0], r[:, 2]).min())


def test_a_heavy_end_does_not_pull_the_cable_into_a_peg() -> None:
    found = equilibrium(over_a_peg(0.5), n_u=49)
    assert found.status == "converged"
    assert deepest_in_the_peg(found.positions(np.linspace(0.0, 1.0, 2001))) < 0.02 * DIAMETER  # it had been 1.5 of it


@pytest.mark.parametrize(("way", "status"), [(0.0004, "converged"), (0.01, "stalled")])
def test_a_gripper_that_presses_the_cable_into_something_is_told(way: float, status: str) -> None:
    down = Grasp(u=0.5, grasp_time=0.5, path=Move(displacement=(0.0, 0.0, -way), duration=0.5))
    lifted = Grasp(u=0.0, path=Move(displacement=(0.0, 0.0, 0.05), duration=0.4))
    table = Environment(table=Table())
    scene = Scene(cable=cable(), shape=Straight(), grasps=(lifted, down), environment=table, horizon=1.0)
    found = equilibrium(scene, at=1.0, n_u=17)
    assert found.status == status
    assert f"pressed {way / DIAMETER:.0%} of its diameter into what it touches" in found.message
