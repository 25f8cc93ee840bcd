"""Paths of held markers: noise is smoothed away, outliers are left out, motion stays."""

import numpy as np
import pytest

from dlocore import SceneError
from dlocore.identify.tracks import held_paths, noise_of
from dlocore.recordings import Recording

TIMES = np.arange(1200) / 200.0


def swinging() -> np.ndarray:
    """Return the path of a gripper (frames, 3) [m] that swings up to 1.7 times a second."""
    phases = 2.0 * np.pi * np.outer(TIMES, (0.6, 1.1, 1.7))
    return 0.1 * np.stack([np.sin(phases), np.cos(phases), np.sin(phases + 1.0)], axis=2).sum(axis=1)


def recorded(path: np.ndarray) -> Recording:
    free = path[:, None] + np.array([[0.2, 0.0, 0.0], [0.4, 0.0, 0.0]])
    return Recording(times=TIMES, markers=np.concatenate([path[:, None], free], axis=1), held=(0,))


@pytest.mark.parametrize("seed", range(8))
def test_a_badly_tracked_gripper_is_followed_closer_than_its_noise(seed: int) -> None:
    rng = np.random.default_rng(seed)
    path = swinging()
    seen = path + 1e-3 * rng.standard_normal(path.shape)
    wild = rng.random(len(path)) < 0.05
    seen[wild] += 0.05 * rng.standard_normal((int(wild.sum()), 3))
    seen[rng.random(len(path)) < 0.1] = np.nan
    away = held_paths(recorded(seen), None)[0](TIMES) - path
    # motion up to 1.7 Hz takes about a tenth of the noise's band of 100 Hz: sqrt(1/10) of 1 mm
    assert np.sqrt((away**2).mean()) < 0.45e-3
    # four deviations of what is left; at the ends half of the neighbours are missing, and an outlier there may pass
    assert np.abs(away[20:-20]).max() < 1.8e-3


def test_a_path_without_noise_is_kept() -> None:
    path = swinging()
    away = held_paths(recorded(path), None)[0](TIMES) - path
    assert np.abs(away).max() < 2e-5  # knots of 20 ms: h^4/384 of the fourth derivative of 0.1 m at 1.7 Hz is 3e-6


def test_too_few_sound_samples_are_named() -> None:
    path = swinging()[:12]
    seen = path.copy()
    seen[3:9] = np.nan
    markers = recorded_short(path, seen)
    with pytest.raises(SceneError, match="markers"):
        held_paths(markers, None)


def recorded_short(path: np.ndarray, seen: np.ndarray) -> Recording:
    free = path[:, None] + np.array([[0.2, 0.0, 0.0], [0.4, 0.0, 0.0]])
    return Recording(times=TIMES[:12], markers=np.concatenate([seen[:, None], free], axis=1), held=(0,))


def test_a_coordinate_that_never_changes_tells_nothing_of_noise() -> None:
    seen = swinging()[:, :2] + 1e-3 * np.random.default_rng(2).standard_normal((len(TIMES), 2))
    flat = np.column_stack([seen, np.full(len(seen), 0.3)])
    assert noise_of(flat) == pytest.approx(1e-3, rel=0.1)  # 2400 differences, of which three in a row hang together
    assert noise_of(np.zeros((20, 3))) == 0.0
