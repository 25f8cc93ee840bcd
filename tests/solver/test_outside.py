"""A start or a path inside an obstacle is refused, however thin that is; what was seen a little inside is moved out."""

from typing import Any

import numpy as np
import pytest

from dlocore import (
    Box,
    Cable,
    Cylinder,
    Environment,
    Grasp,
    Move,
    Points,
    Prediction,
    Scene,
    SceneError,
    Straight,
    Table,
    Waypoints,
    predict,
)
from dlocore.problem.problem import pose

CORD = Cable(length=1.0, diameter=0.005, linear_density=0.05, bending_stiffness=1e-3)
WIRE = Cable(length=1.0, diameter=0.002, linear_density=0.01, bending_stiffness=1e-4)
ASIDE = Move(displacement=(0.0, 0.3, 0.0), duration=1.0)


def peg(x: float, y: float, radius: float) -> Cylinder:
    return Cylinder(center=(x, y, 0.0), radius=radius, height=0.1)


def scene(*obstacles: Any, cable: Cable = CORD, path: Any = ASIDE) -> Scene:
    around = Environment(drag=0.1, table=Table(), obstacles=obstacles)
    return Scene(cable=cable, shape=Straight(), grasps=[Grasp(u=0.25, path=path)], environment=around)


@pytest.mark.parametrize("x", [0.5, 0.505, 0.5037])
def test_a_cable_through_which_a_needle_goes_is_refused(x: float) -> None:
    with pytest.raises(SceneError, match=r"environment.obstacles\[1\]: got 0.00[34][0-9]* m inside"):
        pose(scene(peg(0.7, 0.4, 0.05), peg(x, 0.0, 0.002)))


def test_a_long_cable_through_which_a_peg_goes_is_refused() -> None:
    long = Cable(length=10.0, diameter=0.01, linear_density=0.1, bending_stiffness=1e-2)
    with pytest.raises(SceneError, match=r"environment.obstacles\[0\].*The cable starts up to 0.03"):
        pose(scene(peg(5.05, 0.0, 0.03), cable=long))


@pytest.mark.parametrize(("cable", "bears"), [(WIRE, 0.001), (CORD, 0.0025)], ids=["wire", "cord"])
def test_what_was_seen_of_a_cable_may_be_half_its_diameter_inside(cable: Cable, bears: float) -> None:
    def beside(inside: float) -> Scene:
        edge = -0.5 * cable.diameter + inside
        return scene(Box(center=(0.6, edge - 0.05, 0.0), size=(0.1, 0.1, 0.1)), cable=cable)

    pose(beside(0.95 * bears))
    with pytest.raises(SceneError, match=r"environment.obstacles\[0\]"):
        pose(beside(1.05 * bears))


@pytest.mark.parametrize("y", [0.11, 0.1234, 0.2])
def test_a_path_through_a_peg_is_refused_however_thin_that_is(y: float) -> None:
    with pytest.raises(SceneError, match=r"primitives\[0\].path.*It takes the cable 0.00[0-9]* m into obstacles\[0\]"):
        pose(scene(peg(0.25, y, 0.0002)))
    pose(scene(peg(0.254, y, 0.0002)))  # beside the path


def test_waypoints_that_go_into_something_and_out_again_between_two_looks_are_refused() -> None:
    times = np.linspace(0.0, 10.0, 2001)
    y = 0.05 * np.exp(-(((times - 5.03) / 0.02) ** 2))
    path = Waypoints(times=times, positions=np.column_stack([0.25 + 0.0 * y, y, 0.0 * y]))
    with pytest.raises(SceneError, match=r"primitives\[0\].path.*into obstacles\[0\]"):
        pose(scene(Box(center=(0.25, 0.08, 0.0), size=(0.1, 0.1, 0.1)), path=path))


def strongest(found: Prediction) -> float:
    return max(float(np.linalg.norm(g.reaction, axis=1).max()) for g in found.grasps)


def test_points_that_were_seen_a_little_below_the_table_and_above_it_are_lifted_as_from_the_table() -> None:
    x = np.linspace(0.0, 1.0, 60)
    lift = Grasp(u=0.3, path=Move(displacement=(0.0, 0.05, 0.1), duration=1.0))

    def lifted(seen: float) -> Prediction:
        points = np.column_stack([x, 0.05 * np.sin(3.0 * x), seen * np.sin(6.0 * np.pi * x)])
        around = Environment(drag=0.1, table=Table(friction=0.3))
        return predict(Scene(cable=CORD, shape=Points(points=points), grasps=[lift], environment=around))

    flat, waved = lifted(0.0), lifted(0.0015)
    assert waved.status == "converged"  # pressed into the table by its own bends it had jammed
    assert strongest(waved) < 2.0 * strongest(flat)
    assert waved.surface.sample(101, 2)[2][0, :, 2].min() > -0.05 * CORD.diameter
    ends = [found.surface.positions(np.linspace(0.0, 1.0, 33), [1.0])[0] for found in (flat, waved)]
    assert np.linalg.norm(ends[1] - ends[0], axis=1).max() < 0.003


@pytest.mark.parametrize("path", [ASIDE, Waypoints(times=[0.0, 1.0], positions=[[0.25, 0.0, 0.0], [0.25, 0.3, 0.0]])])
def test_a_cable_seen_a_little_inside_a_box_is_moved_out_of_it_without_a_kink(path: Any) -> None:
    inside = 0.4 * CORD.diameter
    box = Box(center=(0.6, inside - 0.5 * CORD.diameter - 0.05, 0.0), size=(0.1, 0.1, 0.1))
    start = pose(scene(box, path=path)).start
    u = np.linspace(0.0, 1.0, 201)
    at = start(u)
    over = np.abs(at[:, 0] - 0.6) < 0.05
    assert at[over, 1].min() > 0.94 * inside
    assert at[:, 1].max() < 1.3 * inside
    assert np.linalg.norm(start(u, 2), axis=1).max() < 10.0 * inside / 0.1**2
    np.testing.assert_allclose(start([0.25]), [[0.25, 0.0, 0.0]], atol=1e-12)
    assert predict(scene(box, path=path)).status == "converged"


def test_a_motion_that_goes_on_begins_pressed_in_as_it_ended() -> None:
    first = predict(scene(peg(0.6, 0.05, 0.02)))
    second = scene(peg(0.6, 0.05, 0.02))
    onward = Scene(cable=CORD, shape=first.shape_at(), grasps=second.grasps, environment=second.environment)
    np.testing.assert_array_equal(pose(onward).start.control_points[:, :2], first.shape_at().control_points[:, :2])


def test_a_path_that_presses_the_cable_into_the_table_is_refused_by_name() -> None:
    def through(z: float) -> Scene:
        down = Waypoints(times=[0.0, 0.5, 1.0], positions=[[0.25, 0.0, 0.0], [0.25, 0.1, z], [0.25, 0.2, 0.01]])
        return scene(path=down)

    with pytest.raises(SceneError, match=r"primitives\[0\].path: got 0.00[0-9]* m below.*into the table"):
        pose(through(-0.003))
    pose(through(-0.0008))  # less than a quarter of its diameter: noise
