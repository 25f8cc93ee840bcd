"""Paths that seem to be in another unit, order or clock than they are read in are asked about, others are not."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dlocore import Grasp, Move, Scene, SceneError, Straight, Waypoints
from dlocore.problem.notes import scene_notes
from dlocore.scene.paths import Path, Still, Through
from tests.solver.scenes import Floats, cable

PLACE = [(0.0, 0.0, 0.0)] * 5


def notes(path: Path, grasp_time: float | None = None) -> list[str]:
    grasps = [Grasp(u=1.0), Grasp(u=0.0, hold="clamp", path=path, grasp_time=grasp_time)]
    return scene_notes(Scene(cable=cable(), shape=Straight(), grasps=grasps, horizon=4.0))


def turned(rotation: tuple[float, float, float]) -> list[str]:
    return notes(Move(displacement=(0.0, 0.0, 0.0), rotation=rotation, duration=1.0))


def test_a_turn_by_what_looks_like_degrees_is_asked_about() -> None:
    (note,) = turned((90.0, 0.0, 0.0))
    assert note.startswith("primitives[1] turns by 90 rad, 14.3 times around")
    assert note.endswith("if degrees were meant, give (1.571, 0, 0)")
    assert turned((0.0, -180.0, 45.0))


@pytest.mark.parametrize("about", [5.0, 15.0, 10.0 * np.pi, 25.3], ids=["5", "15", "ten half turns", "no degrees"])
def test_a_turn_by_radians_is_not_asked_about(about: float) -> None:
    assert turned((0.0, 0.0, about)) == []


def oriented(quaternions: Floats) -> list[str]:
    path = Waypoints(times=np.arange(5) * 0.25, positions=PLACE, orientations=quaternions, profile="minimum_jerk")
    return notes(path)


def quaternions(*, last: bool, first: Rotation | None = None) -> Floats:
    """Return five quaternions of a turn by 1 rad from a `first` one, w last or first."""
    turns = Rotation.from_rotvec(np.outer(np.linspace(0.0, 1.0, 5), [0.0, 0.6, 0.8])) * (first or Rotation.identity())
    found = np.asarray(turns.as_quat())
    return found if last else found[:, [3, 0, 1, 2]]


def test_quaternions_that_begin_at_no_turn_in_the_other_order_are_asked_about() -> None:
    (note,) = oriented(quaternions(last=True))
    assert note.startswith("primitives[1].path.orientations begin at a half turn about z")
    assert note.endswith("put w first")
    (again,) = oriented(-quaternions(last=True))  # which are the same turns
    assert again == note


@pytest.mark.parametrize("first", [(0.0, 0.0, 0.0), (np.pi, 0.0, 0.0), (0.0, 0.0, 1.0)])
def test_quaternions_in_order_are_not_asked_about(first: tuple[float, float, float]) -> None:
    assert oriented(quaternions(last=False, first=Rotation.from_rotvec(first))) == []
    assert oriented(np.tile([0.0, 0.0, 0.0, 1.0], (5, 1))) == []  # it does not turn


def test_quaternions_that_turn_far_from_a_half_turn_are_not_asked_about() -> None:
    """In the other order they would begin at no turn, too, but go on to a half turn."""
    angles = np.linspace(np.pi, 0.0, 5)
    upright = Rotation.from_rotvec(np.outer(angles, [0.0, 0.0, 1.0])).as_quat()
    assert oriented(upright[:, [3, 0, 1, 2]]) == []


def test_a_late_path_whose_times_begin_at_its_grasp_time_is_asked_about() -> None:
    path = Waypoints(times=[1.0, 2.0], positions=PLACE[:2])
    (note,) = notes(path, grasp_time=1.0)
    assert note.startswith("primitives[1].path.times begin at 1 s, as grasp_time")
    assert "the gripper waits until 2 s" in note


def test_one_that_begins_at_once_or_waits_for_another_time_is_not() -> None:
    for times in ([0.0, 1.0], [0.5, 2.0]):
        assert notes(Waypoints(times=times, positions=PLACE[:2]), grasp_time=1.0) == []
    assert notes(Waypoints(times=[1.0, 2.0], positions=PLACE[:2])) == []


def recorded(begins: float, other: Grasp) -> list[str]:
    path = Waypoints(times=[begins, begins + 0.5, begins + 1.0], positions=PLACE[:3])
    grasps = [other, Grasp(u=0.0, path=path)]
    return scene_notes(Scene(cable=cable(), shape=Straight(), grasps=grasps))


def test_a_path_by_the_clock_of_a_recorder_is_asked_about() -> None:
    (note,) = recorded(1000.0, Grasp(u=1.0))
    assert note.startswith("primitives[1].path.times begin at 1000 s, and no gripper moves before")
    with pytest.raises(SceneError, match=r"times\[0\]: got 1700000000\.0\. Times count from when the gripper closes"):
        recorded(1.7e9, Grasp(u=1.0))


@pytest.mark.parametrize("begins", [0.0, 2.0, 4.9, 1000.0])
def test_one_that_waits_for_another_gripper_or_not_long_is_not(begins: float) -> None:
    moved = Grasp(u=1.0, path=Move(displacement=(0.0, 0.1, 0.0), duration=1.0))
    assert recorded(begins, moved if begins > 4.9 else Grasp(u=1.0)) == []


@pytest.mark.parametrize("profile", ["spline", "minimum_jerk"])
def test_orientations_that_stay_are_no_turn_so_that_a_point_may_be_held(profile: Through) -> None:
    stays = np.array([[0.6, 0.0, 0.8, 0.0], [-0.6, 0.0, -0.8, 0.0], [0.6, 0.0, 0.8, 0.0]])
    path = Waypoints(times=[0.0, 0.5, 1.0], positions=PLACE[:3], orientations=stays, profile=profile)
    times = np.linspace(0.0, 1.0, 5)
    assert Grasp(u=0.0, path=path).path is path
    assert path.turn == Still().turn
    assert path.rotation_at(times) is None
    assert not path.spin(times, np.eye(3)[[0] * 5]).any()
    assert np.array_equal(np.asarray(path.orientations), stays)  # as given
    Grasp(u=0.0, path=Move(displacement=(0.0, 0.1, 0.0), rotation=(0.0, 0.0, 0.0), duration=1.0))
