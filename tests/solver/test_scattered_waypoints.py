"""Waypoints that noise of their positions or times scatters about a smooth path are told of, smooth paths are not."""

import numpy as np
import pytest

from dlocore import Grasp, Scene, Straight, Waypoints
from dlocore.problem.notes import SHAKEN, scene_notes
from tests.solver.scenes import Floats, G, cable

EVEN = np.arange(201) / 100.0


def gripper(t: Floats) -> Floats:
    """Return places (k, 3) [m] of a gripper that moves by half a metre and stops."""
    s = np.clip(t / 1.6, 0.0, 1.0)
    return np.outer(s**3 * (10.0 - 15.0 * s + 6.0 * s**2), [0.3, 0.4, 0.0])


def notes(path: Waypoints) -> list[str]:
    return scene_notes(Scene(cable=cable(), shape=Straight(), grasps=[Grasp(u=0.0, path=path)]))


def jittered(seed: int, deviation: float) -> Floats:
    """Return the times [s] of a log of 100 Hz whose stamps have a standard deviation [s]."""
    times = np.sort(EVEN + deviation * np.random.default_rng(seed).normal(size=len(EVEN)))
    return np.asarray(np.maximum.accumulate(times - times[0] + 2e-6 * np.arange(len(times))))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("deviation", [0.002, 0.003])
def test_jitter_of_time_stamps_is_told_of_with_how_it_shakes_the_path(deviation: float, seed: int) -> None:
    times = jittered(seed, deviation)
    path = Waypoints(times=times, positions=gripper(EVEN))
    (note,) = (n for n in notes(path) if "scatter" in n)
    assert note.startswith("the waypoints of primitives[0] scatter about a smooth path, by some ")
    assert note.endswith("If this is noise of a log, or of its times, smooth its positions first")
    t = np.linspace(0.0, times[-1], 20001)
    shaken = np.gradient(np.gradient(path.at(t, np.zeros(3)), t, axis=0), t, axis=0)
    rms = float(np.sqrt((shaken**2).sum(axis=1).mean()))
    assert float(note.split("accelerations of ")[1].split(" m/s^2")[0]) == pytest.approx(rms, rel=0.06)
    assert rms > SHAKEN
    if deviation == 0.002:
        assert 3.0 < rms / G < 5.0  # as docs/api.md says


@pytest.mark.parametrize("noise", [5e-4, 2e-3])
def test_noise_of_positions_is_told_of_with_its_size(noise: float) -> None:
    seen = gripper(EVEN) + noise * np.random.default_rng(0).normal(size=(len(EVEN), 3))
    (note,) = notes(Waypoints(times=EVEN, positions=seen, start="moving"))
    size = 1e-3 * float(note.split("by some ")[1].split(" mm")[0])
    assert noise < size < 3.0 * noise  # of three coordinates, and of the cubic through neighbours


def test_slow_waypoints_that_scatter_by_more_than_a_thousandth_of_the_length_are_told_of() -> None:
    seen = gripper(EVEN) + 2e-3 * np.random.default_rng(0).normal(size=(len(EVEN), 3))
    assert any("scatter" in note for note in notes(Waypoints(times=20.0 * EVEN, positions=seen)))


def test_exact_paths_are_not_told_of() -> None:
    straight = np.outer(np.clip(EVEN / 1.6, 0.0, 1.0), [0.3, 0.4, 0.0])  # whose velocity jumps as it stops
    raster = np.array([[0.05 * (k // 2), 0.3 * ((k + 1) // 2 % 2), 0.0] for k in range(30)])
    swing = np.outer(0.05 * np.sin(2.0 * np.pi * 4.0 * EVEN), [1.0, 0.0, 0.0])
    for times, x in [
        (EVEN, gripper(EVEN)),
        (jittered(0, 5e-4), gripper(jittered(0, 5e-4))),  # uneven times are no noise
        (EVEN, np.round(gripper(EVEN), 4)),
        (EVEN, straight),
        (EVEN[::4], straight[::4]),
        (EVEN[::5], swing[::5]),  # five for each swing
        (np.arange(30.0), raster),
        (EVEN, np.zeros((len(EVEN), 3))),
        (EVEN[:5], gripper(EVEN[:5])),
    ]:
        assert not [note for note in notes(Waypoints(times=times, positions=x, start="moving")) if "scatter" in note]


def test_a_robot_program_is_not_told_of() -> None:
    seen = gripper(EVEN) + 2e-3 * np.random.default_rng(0).normal(size=(len(EVEN), 3))
    assert not any("scatter" in note for note in notes(Waypoints(times=EVEN, positions=seen, profile="minimum_jerk")))
