"""A start or a gripper's path inside an obstacle is refused, however thin or fast that is."""

from typing import Any

import numpy as np
import pytest

from dlocore import Box, Cable, Cylinder, Environment, Grasp, Move, Scene, SceneError, Straight, Table, Waypoints
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
