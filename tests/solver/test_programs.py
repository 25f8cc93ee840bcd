"""A gripper that stops at its waypoints: a program of moves and pauses in one path."""

from dataclasses import replace
from typing import cast

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from dlocore import Cable, Environment, Grasp, Move, Points, Quality, Scene, SceneError, Straight, Waypoints, predict
from dlocore.problem.events import find_events
from dlocore.problem.problem import pose
from dlocore.problem.trembling import trembles
from dlocore.scene.paths import MAX_STOPS, Profile, Through

Floats = NDArray[np.float64]

TIMES = [0.0, 1.0, 1.5, 2.5, 3.0]  # a move, a pause, a move, a pause
PLACES = np.array([(0.6, 0, 0), (0.5, 0.1, 0.1), (0.5, 0.1, 0.1), (0.7, -0.1, 0.0), (0.7, -0.1, 0.0)])
TURNS = Rotation.from_rotvec([(0, 0, 0), (0, 0.5, 0), (0, 0.5, 0), (0.3, 0, -1), (0.3, 0, -1)])
QUATERNIONS = TURNS.as_quat()[:, [3, 0, 1, 2]]
PROFILES: tuple[Profile, ...] = ("minimum_jerk", "cubic", "linear")


def program(profile: Through = "minimum_jerk", *, turns: bool = False) -> Waypoints:
    return Waypoints(times=TIMES, positions=PLACES, orientations=QUATERNIONS if turns else None, profile=profile)


def hanging(path: Waypoints | Move, **changes: object) -> Scene:
    """Return a cable that hangs between a fixed gripper and one on a path."""
    s = np.linspace(0.0, 1.0, 61)
    sagging = np.stack([0.6 * s, 0.0 * s, -1.4866 * s * (1.0 - s)], axis=1)
    scene = Scene(
        cable=Cable.preset("paper"), shape=Points(points=sagging, settle=True),
        grasps=(Grasp(u=0.0), Grasp(u=1.0, path=path)), environment=Environment(drag=0.1), horizon=3.0,
    )  # fmt: skip
    return replace(scene, **changes)  # type: ignore[arg-type]


def sampled(path: Waypoints, every: float = 0.005) -> Waypoints:
    """Return the path as a recording would have it."""
    times = np.arange(round(path.duration / every) + 1) * every
    return Waypoints(times=times, positions=path.at(times, PLACES[0]))


@pytest.mark.parametrize("profile", PROFILES)
def test_each_way_is_that_of_a_move(profile: Profile) -> None:
    path = program(profile, turns=True)
    for k in range(4):
        lasts = TIMES[k + 1] - TIMES[k]
        turn = (TURNS[k + 1] * TURNS[k].inv()).as_rotvec()
        move = Move(displacement=PLACES[k + 1] - PLACES[k], duration=lasts, rotation=turn, profile=profile)
        inside = np.linspace(0.0, lasts, 11)
        np.testing.assert_allclose(path.at(TIMES[k] + inside, PLACES[0]), move.at(inside, PLACES[k]), atol=1e-15)
        turned = cast(Floats, move.rotation_at(inside)) @ TURNS[k].as_matrix()
        np.testing.assert_allclose(cast(Floats, path.rotation_at(TIMES[k] + inside)), turned, atol=1e-14)


@pytest.mark.parametrize(("profile", "multiplicity"), [("minimum_jerk", 1), ("cubic", 2), ("linear", 3)])
def test_each_stop_is_an_event_as_the_end_of_a_move_is(profile: Profile, multiplicity: int) -> None:
    events = find_events(hanging(program(profile), horizon=4.0))
    assert [(event.time, event.multiplicity) for event in events] == [(t, multiplicity) for t in TIMES[1:]]


def test_stops_after_the_release_are_none() -> None:
    let_go = Grasp(u=1.0, path=program(), release_time=1.2)
    assert [event.time for event in find_events(hanging(program(), grasps=(Grasp(u=0.0), let_go)))] == [1.0, 1.2]


@pytest.mark.parametrize("path", [program(), Move(displacement=PLACES[1] - PLACES[0], duration=2.0)])
def test_the_end_of_a_path_after_the_release_is_none(path: Waypoints | Move) -> None:
    let_go = Grasp(u=1.0, path=path, release_time=0.7)
    assert [event.time for event in find_events(hanging(path, grasps=(Grasp(u=0.0), let_go)))] == [0.7]


def test_the_clock_of_a_late_program_starts_as_its_gripper_closes() -> None:
    late = Waypoints(times=[0.5, 1.0, 2.0], positions=PLACES[:3], profile="cubic")
    scene = hanging(program(), grasps=(Grasp(u=0.0), Grasp(u=1.0, path=late, grasp_time=0.25)))
    assert [(event.time, event.multiplicity) for event in find_events(scene)] == [
        (0.25, 3),
        (0.75, 2),
        (1.25, 2),
        (2.25, 2),
    ]


def test_one_move_is_the_move() -> None:
    path = Waypoints(times=[0.0, 1.0], positions=PLACES[:2], profile="minimum_jerk")
    one = predict(hanging(path))
    other = predict(hanging(Move(displacement=PLACES[1] - PLACES[0], duration=1.0)))
    assert one.status == other.status == "converged"
    assert np.abs(one.surface.control_points - other.surface.control_points).max() < 1e-6


@pytest.mark.parametrize("profile", PROFILES)
def test_it_is_the_motion_of_the_same_path_as_it_would_be_recorded(profile: Profile) -> None:
    asked = Quality(target_error=5e-4)
    found = predict(hanging(program(profile), quality=asked))
    recorded = predict(hanging(sampled(program(profile)), quality=asked))
    assert found.status == recorded.status == "converged"
    u, t = np.linspace(0.0, 1.0, 21), np.linspace(0.0, 3.0, 121)
    away = np.linalg.norm(found.surface.positions(u, t) - recorded.surface.positions(u, t), axis=2).max()
    assert away < found.accuracy.error_estimate + recorded.accuracy.error_estimate
    held = np.linalg.norm(found.surface.positions(u[-1:], t)[:, 0] - program(profile).at(t, PLACES[0]), axis=1)
    assert held.max() < 2e-5  # a path of minimum jerk is of fifth order, the surface of third


def test_the_reference_stops_there_too() -> None:
    asked = Quality(target_error=2e-3, method="reference")
    judge, found = predict(hanging(program("linear"), quality=asked)), predict(hanging(program("linear")))
    u, t = np.linspace(0.0, 1.0, 21), np.linspace(0.0, 3.0, 121)
    away = np.linalg.norm(found.surface.positions(u, t) - judge.surface.positions(u, t), axis=2).max()
    assert judge.status == found.status == "converged"
    assert away < found.accuracy.error_estimate + judge.accuracy.error_estimate


def test_a_clamp_turns_as_it_is_told() -> None:
    path = program(turns=True)
    found = predict(hanging(program(), grasps=(Grasp(u=0.0), Grasp(u=1.0, path=path, hold="clamp"))))
    assert found.status == "converged", found.message
    t = np.linspace(0.0, 3.0, 25)
    tangents = found.surface(np.array([1.0]), t, du=1)[:, 0, :3]
    tangents /= np.linalg.norm(tangents, axis=1)[:, None]
    np.testing.assert_allclose(tangents, cast(Floats, path.rotation_at(t)) @ tangents[0], atol=1e-5)


def test_a_program_trembles_at_no_step() -> None:
    assert trembles(pose(hanging(sampled(program("linear")))), 0.3) > 0.0
    assert trembles(pose(hanging(program("linear"))), 0.3) == 0.0


def test_a_stop_out_of_reach_is_seen_however_short_it_is() -> None:
    """Of a path that is looked at as many times as one move is, it would be passed over."""
    times = np.array([0.0, 100.0, 100.05, 100.1, 200.0])
    far = np.array([(1.0, 0, 0), (0.8, 0, 0), (1.2, 0, 0), (0.8, 0, 0), (0.8, 0, 0)])
    way = Waypoints(times=times, positions=far, profile="minimum_jerk")
    scene = Scene(cable=Cable.preset("paper"), shape=Straight(), grasps=(Grasp(u=0.0), Grasp(u=1.0, path=way)))
    with pytest.raises(SceneError, match=r"primitives\[1\].path: got 1.2 m from primitives\[0\] at 100 s\."):
        predict(scene)


@pytest.mark.parametrize(
    ("field", "given"),
    [
        ("profile", {"profile": "quintic"}),
        ("start", {"profile": "linear", "start": "moving"}),
        ("times", {"profile": "cubic", "times": np.arange(MAX_STOPS + 1.0), "positions": np.zeros((MAX_STOPS + 1, 3))}),
    ],
)
def test_what_is_no_program_is_refused_by_name(field: str, given: dict[str, object]) -> None:
    with pytest.raises(SceneError) as refused:
        Waypoints(**{"times": [0.0, 1.0], "positions": PLACES[:2], **given})  # type: ignore[arg-type]
    assert refused.value.field == field
