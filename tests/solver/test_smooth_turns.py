"""Orientations of a smooth path turn it as smoothly as its positions move it: from rest, and of fourth order."""

import pickle
from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dlocore import Move, Waypoints
from dlocore.scene.paths import Profile
from tests.solver.scenes import Floats

TURN = np.array([0.5, -0.4, 1.0])  # [rad]
FINE = np.linspace(0.0, 2.0, 2001)


def waypoints(turns: Rotation, times: Floats, **changes: object) -> Waypoints:
    quaternions = turns.as_quat()[:, [3, 0, 1, 2]]
    return Waypoints(times=times, positions=np.zeros((len(times), 3)), orientations=quaternions, **changes)  # type: ignore[arg-type]


def sampled(count: int, profile: Profile = "minimum_jerk", **changes: object) -> Waypoints:
    """Return a turn by TURN in 2 s as a recording of so many waypoints would have it."""
    times = np.linspace(0.0, 2.0, count)
    return waypoints(Rotation.from_matrix(move(profile).rotation_at(times)), times, **changes)


def move(profile: Profile = "minimum_jerk") -> Move:
    return Move(displacement=(0.0, 0.0, 0.0), rotation=TURN, duration=2.0, profile=profile)


def apart(path: Waypoints, other: Move | Waypoints) -> float:
    """Return the largest angle between two paths [rad]."""
    a, b = (Rotation.from_matrix(p.rotation_at(FINE)) for p in (path, other))
    return float((a * b.inv()).magnitude().max())


def rates(path: Waypoints, times: Floats = FINE) -> Floats:
    """Return the angular velocity between times [rad/s]."""
    turns = Rotation.from_matrix(path.rotation_at(times))
    return np.asarray((turns[1:] * turns[:-1].inv()).as_rotvec()) / np.diff(times)[:, None]


def test_a_sampled_turn_nears_the_turn_with_the_third_power_of_the_samples_or_faster() -> None:
    off = [apart(sampled(count), move()) for count in (5, 9, 17, 33)]
    assert off[0] < 0.02
    assert all(fine < coarse / 7.0 for coarse, fine in pairwise(off))


def test_it_starts_at_rest_and_its_rate_does_not_jump() -> None:
    times = np.array([0.0, 0.5, 1.0, 1.5, 2.0])
    path = waypoints(Rotation.from_rotvec(np.outer([0.0, 0.4, 0.5, 1.0, 1.2], TURN)), times)
    assert np.linalg.norm(rates(path)[0]) < 0.01 * np.linalg.norm(rates(path), axis=1).max()
    change = np.linalg.norm(np.diff(rates(path), axis=0), axis=1)
    assert change.max() < 0.02 * np.linalg.norm(rates(path), axis=1).max()  # at 1 kHz


def test_one_that_is_recorded_in_motion_starts_at_the_rate_that_its_waypoints_tell() -> None:
    path = sampled(9, "linear", start="moving")
    np.testing.assert_allclose(rates(path), np.tile(0.5 * TURN, (len(FINE) - 1, 1)), rtol=2e-4)


def test_only_the_turn_since_the_first_counts_in_world_axes() -> None:
    times, first = np.linspace(0.0, 2.0, 5), Rotation.from_rotvec([0.9, 0.2, -1.1])  # a tool that begins turned
    turns = Rotation.from_rotvec(np.outer(times / 2.0, TURN))
    assert apart(waypoints(turns * first, times), waypoints(turns, times)) < 1e-7


def test_the_other_sign_of_a_quaternion_is_the_same_turn() -> None:
    path = sampled(9)
    signs = np.array([1, -1, -1, 1, -1, 1, 1, -1, 1])[:, None]
    assert path.orientations is not None
    flipped = Waypoints(times=path.times, positions=path.positions, orientations=np.asarray(path.orientations) * signs)
    assert apart(flipped, path) < 1e-7


def test_it_turns_the_shorter_way_and_about_one_axis_where_its_waypoints_do() -> None:
    angles = np.radians([0.0, 150.0, 300.0, 450.0])
    times = np.linspace(0.0, 2.0, 4)
    path = waypoints(Rotation.from_rotvec(np.outer(angles, [0.0, 0.0, 1.0])), times)
    found = path.rotation_at(FINE)
    assert found is not None
    assert np.abs(found[:, 2, :2]).max() == 0.0
    along = np.tile([0.0, 0.0, 1.0], (len(FINE), 1))
    assert path.spin(FINE, along).sum() == pytest.approx(angles[-1], abs=1e-9)
    back = waypoints(Rotation.from_rotvec([(0.0, 0.0, 0.0), (0.0, 0.0, np.radians(200.0))]), times[:2])
    ends = times[:2]
    assert back.spin(ends, along[:2])[0] == pytest.approx(np.radians(-160.0), abs=1e-9)


def test_the_spin_between_times_is_that_of_the_rotations_there() -> None:
    path = sampled(5)
    axis = TURN / np.linalg.norm(TURN)
    few = np.linspace(0.0, 2.0, 8)
    turned = np.array([Rotation.from_matrix(r).as_rotvec() @ axis for r in np.asarray(path.rotation_at(few))])
    np.testing.assert_allclose(path.spin(few, np.tile(axis, (8, 1))), np.diff(turned), atol=1e-9)


@pytest.mark.parametrize("rate", [100, 250])
def test_noise_of_a_recording_is_not_made_worse(rate: int) -> None:
    times = np.arange(2 * rate + 1) / rate
    noise = np.radians(0.5) * np.random.default_rng(0).normal(size=(len(times), 3))
    seen = Rotation.from_rotvec(noise) * Rotation.from_matrix(move().rotation_at(times))
    smooth = waypoints(seen * seen[0].inv(), times)
    seen_off = float((seen * seen[0].inv() * Rotation.from_matrix(move().rotation_at(times)).inv()).magnitude().max())
    assert apart(smooth, move()) < 1.2 * seen_off


def test_a_program_still_turns_about_one_axis_from_each_waypoint_to_the_next() -> None:
    times = np.array([0.0, 2.0])
    program = waypoints(Rotation.from_rotvec([0.0 * TURN, TURN]), times, profile="minimum_jerk")
    assert apart(program, move()) < 1e-7


def test_it_is_pickled_with_its_turns() -> None:
    assert apart(pickle.loads(pickle.dumps(sampled(9))), sampled(9)) == 0.0
