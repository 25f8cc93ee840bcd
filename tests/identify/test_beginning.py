"""The first frames of a recording: where markers are and how fast they move, whether they rest, what a start shares."""

from dataclasses import replace

import numpy as np

from benchmarks.simulated_recordings import CABLE, DRAG, simulated
from dlocore.identify import Candidate, Replay, Resolution
from dlocore.identify.beginning import rests, start_markers
from dlocore.identify.candidate import varied
from dlocore.recordings import Recording

TIMES = np.cumsum(np.random.default_rng(1).uniform(0.003, 0.007, 16))  # cameras do not keep time
AT = float(TIMES[:12].mean())
PLACE = np.column_stack([0.1 * np.arange(6), np.zeros(6), 0.02 * np.arange(6) ** 2])
SPEED = np.column_stack([np.linspace(0.2, 0.9, 6), np.full(6, -0.3), np.zeros(6)])
BENT = np.array([1.0, -9.81, 3.0])


def recorded(change: np.ndarray | None = None) -> Recording:
    t = (TIMES - AT)[:, None, None]
    markers = PLACE + t * SPEED + 0.5 * t**2 * BENT
    return Recording(times=TIMES, markers=markers if change is None else markers + change, held=(0,))


def test_places_and_speeds_of_a_parabola_are_exact_also_where_frames_are_lost() -> None:
    lost = np.zeros((16, 6, 3))
    lost[2, 1] = lost[5:9, 3] = np.nan
    seen, places, speeds = start_markers(recorded(lost), 12, AT, None)
    np.testing.assert_array_equal(seen, np.arange(6))
    np.testing.assert_allclose(places, PLACE, atol=1e-12)  # rounding of metres
    np.testing.assert_allclose(speeds, SPEED, atol=1e-10)  # over 0.05 s


def test_a_marker_that_is_hardly_seen_is_left_out() -> None:
    lost = np.zeros((16, 6, 3))
    lost[:10, 2] = np.nan
    seen, places, _ = start_markers(recorded(lost), 12, AT, None)
    np.testing.assert_array_equal(seen, [0, 1, 3, 4, 5])
    np.testing.assert_allclose(places, PLACE[seen], atol=1e-12)


def test_outliers_of_the_first_frames_weigh_little() -> None:
    rng = np.random.default_rng(3)
    change = 1e-3 * rng.standard_normal((16, 6, 3))
    change[4, 1] += 0.05
    change[9, 4] -= 0.08
    _, places, _ = start_markers(recorded(change), 12, AT, None)
    # at the middle of 12 frames a parabola is known to 0.43 of their noise: four deviations of the largest of 18
    assert np.abs(places - PLACE).max() < 4 * 0.43e-3


def test_a_shaken_start_moves_as_the_noise_of_its_frames_lets_it() -> None:
    rng = np.random.default_rng(4)
    recording = recorded(1e-3 * rng.standard_normal((16, 6, 3)))
    calm = start_markers(recording, 12, AT, None)[1]
    shaken = [start_markers(recording, 12, AT, np.random.default_rng(k))[1] - calm for k in range(40)]
    # 0.43 of 1 mm, which the few frames left beside three coefficients tell to about a fifth
    assert 0.3e-3 < np.sqrt(np.mean(np.square(shaken))) < 0.6e-3


def test_what_rests_is_told_from_what_moves() -> None:
    still = Recording(times=TIMES, markers=np.tile(PLACE, (16, 1, 1)), held=(0,))
    noisy = replace(still, markers=PLACE + 1e-3 * np.random.default_rng(5).standard_normal((16, 6, 3)))
    assert rests(still, 12)
    assert rests(noisy, 12)
    assert not rests(recorded(), 12)  # at 0.3 m/s and more


def test_a_candidate_that_resists_otherwise_shares_the_start_and_nothing_else() -> None:
    replay = Replay(simulated(3, 0.5, cable=CABLE, environment=DRAG), Resolution(n_u=9))
    known = Candidate(cable=CABLE, environment=replace(DRAG, drag_quadratic=0.02))
    played = replay.play(known)
    drag = replace(known, environment=replace(known.environment, drag=0.2, drag_quadratic=0.1))
    damped = replace(known, cable=replace(CABLE, bending_damping=2e-3))
    for candidate in (drag, damped):
        problem = varied(played.problem, known, candidate)
        assert problem is not None
        for shared, posed in zip(problem.law_table(), replay.posed(candidate)[0].law_table(), strict=True):
            np.testing.assert_array_equal(shared, posed)
        assert problem.drag_coefficient() == candidate.environment.drag
        alone = replay.play(candidate).predicted
        # a start is found anew to 1e-8 m, and half a second of motion makes no more than a few times that of it
        np.testing.assert_allclose(replay.play(candidate, played).predicted, alone, atol=1e-6)
        assert np.abs(alone - played.predicted).max() > 1e-4
    stiffer = replace(known, cable=replace(CABLE, bending_stiffness=4e-3))
    without = replace(known, environment=replace(known.environment, drag=0.0))
    assert varied(played.problem, known, stiffer) is None
    assert varied(played.problem, known, without) is None
