"""Waypoints whose times are so close that noise between them throws a smooth path off are told of, others are not."""

from typing import Literal

import numpy as np
import pytest

from dlocore import Grasp, Scene, Straight, Waypoints
from dlocore.problem.notes import scene_notes
from tests.solver.scenes import Floats, cable

EVEN = np.arange(500) / 250.0
NOISE = 2e-5  # [m]
Start = Literal["rest", "moving"]


def smooth(t: Floats) -> Floats:
    """Return places along x [m] of a gripper that sets out from rest."""
    return 0.05 * (1.0 - np.cos(2.0 * t))


def notes(times: Floats, x: Floats, noise: float = NOISE, seed: int = 0, start: Start = "rest") -> list[str]:
    """Return what is told of a cable whose end is led along x [m], as it is seen with noise [m]."""
    seen = np.outer(x, [1.0, 0.0, 0.0]) + noise * np.random.default_rng(seed).normal(size=(len(x), 3))
    seen[0] = 0.0
    path = Waypoints(times=times, positions=seen, start=start)
    return scene_notes(Scene(cable=cable(), shape=Straight(), grasps=[Grasp(u=0.0, path=path)]))


def with_gap(after: int, gap: float) -> Floats:
    """Return even times of which one comes a gap [s] after that before it."""
    times = EVEN.copy()
    times[after + 1] = times[after] + gap
    return times


@pytest.mark.parametrize("start", ["rest", "moving"])
@pytest.mark.parametrize("after", [0, 1, 249, 497, 498])
def test_two_times_that_are_all_but_the_same_are_told_of_with_how_far_the_path_is_off(after: int, start: Start) -> None:
    times = with_gap(after, 5e-6)
    x = smooth(EVEN)  # where it was at the times that were meant
    (note,) = (n for n in notes(times, x, start=start) if "throws the smooth path off" in n)
    assert note.startswith(
        f"primitives[0].path.times[{after + 1}] is 5e-06 s after the one before it, others are 0.004"
    )
    off, when = float(note.split("up to ")[1].split(" mm")[0]), float(note.split(", at ")[1].split(" s")[0])
    seen = np.outer(x, [1.0, 0.0, 0.0]) + NOISE * np.random.default_rng(0).normal(size=(len(x), 3))
    seen[0] = 0.0
    t = np.linspace(max(0.0, times[after] - 0.02), min(times[after] + 0.02, times[-1]), 8001)
    path = Waypoints(times=times, positions=seen, start=start).at(t, np.zeros(3))
    far = np.linalg.norm(path - np.outer(smooth(t), [1.0, 0.0, 0.0]), axis=1).max()
    assert 1e-3 * off == pytest.approx(far, rel=0.1)
    assert abs(when - times[after]) < 0.02


def test_three_times_that_are_all_but_the_same_are_told_of() -> None:
    times = with_gap(249, 5e-6)
    times[251] = times[250] + 5e-6
    assert any("throws the smooth path off" in note for note in notes(times, smooth(EVEN)))


@pytest.mark.parametrize(("gap", "least"), [(5e-5, 0.1), (2e-4, 0.02), (5e-4, 5e-3)])
def test_a_late_time_stamp_of_a_log_is_told_of_with_how_far_the_path_is_off(gap: float, least: float) -> None:
    times, x = 2.0 * EVEN, 6.0 * smooth(EVEN)  # 125 Hz; up to 0.3 m/s
    times[200] = times[201] - gap  # this message came with the next one
    (note,) = notes(times, x, 0.0)
    assert note.startswith(f"primitives[0].path.times[201] is {gap:.2g} s after the one before it, others are 0.008")
    assert 1e-3 * float(note.split("up to ")[1].split(" mm")[0]) > least


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("noise", [0.0, NOISE, 1e-3])
def test_noise_at_even_times_and_at_trembling_ones_is_not_told_of_as_close_times(noise: float, seed: int) -> None:
    tremble = 0.45 * np.random.default_rng(seed).uniform(-1.0, 1.0, len(EVEN)) / 250.0
    for times in (EVEN, EVEN + np.where(EVEN > 0.0, tremble, 0.0)):
        told = notes(times, smooth(times), noise, seed)
        assert not any("close" in note or "throws" in note for note in told)
        assert noise == 1e-3 or not told


def test_a_recording_that_is_left_for_a_while_is_not_told_of() -> None:
    kept = (EVEN < 0.8) | (EVEN > 0.9)
    assert not notes(EVEN[kept], smooth(EVEN[kept]))


def test_pauses_and_quick_moves_are_not_told_of_as_close_times() -> None:
    for quick in (0.02, 0.05, 0.3):
        times = np.array([0.0, 1.0, 1.0 + quick, 2.0, 3.0])
        for x in ([0.0, 0.0, 0.3, 0.3, 0.3], [0.0, 0.2, 0.2, 0.2, 0.2], [0.0, 0.0, 0.0, 0.0, 0.0]):
            told = notes(times, np.array(x), 0.0)
            assert not any("close" in note or "throws" in note for note in told)
