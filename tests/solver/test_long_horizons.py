"""A motion that is lively for a moment of a long time is solved, and its error estimated, for that moment too."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from dlocore import Cable, Environment, Grasp, Load, Move, Quality, Scene, Straight, predict
from dlocore.levels.level import run_level
from dlocore.problem.problem import pose
from dlocore.solvers.monitor import Monitor
from dlocore.solvers.timefit import MISSED_COUNTS, largest

AIR = Environment(drag=0.3)
DAMPED = Cable(length=1.0, diameter=0.005, linear_density=0.05, bending_stiffness=1e-3, bending_damping=1e-4)


def sagging(horizon: float) -> Scene:
    """Return a straight cable between two clamps that sags within 0.3 s."""
    clamps = (Grasp(u=0.0, hold="clamp"), Grasp(u=1.0, hold="clamp"))
    return Scene(cable=DAMPED, shape=Straight(), grasps=clamps, environment=AIR, horizon=horizon)


def pushed(horizon: float) -> Scene:
    """Return a cable that falls, and whose tip is pushed for 0.1 s."""
    force = np.array([(0, 0, 0), (0, 0, 0), (0, 1.0, 0), (0, 0, 0)])
    load = Load(u=1.0, force=force, times=[0.0, 0.3, 0.35, 0.4])
    held = (Grasp(u=0.0),)
    return Scene(
        cable=Cable.preset("paper"), shape=Straight(), grasps=held, loads=(load,), environment=AIR, horizon=horizon
    )


def released(horizon: float) -> Scene:
    """Return a cable that is let go at one end after 1.2 s."""
    path = Move(displacement=(-0.3, 0.2, 0.0), duration=1.0)
    grasps = (Grasp(u=0.0), Grasp(u=1.0, path=path, release_time=1.2))
    return Scene(cable=Cable.preset("paper"), shape=Straight(), grasps=grasps, environment=AIR, horizon=horizon)


@pytest.mark.parametrize("horizon", [10.0, 60.0])
@pytest.mark.parametrize("scene", [sagging, pushed, released])
def test_the_estimate_holds_while_it_is_lively(scene: Callable[[float], Scene], horizon: float):
    found = predict(scene(horizon))
    assert found.status == "converged", found.message
    fine = predict(replace(scene(2.5), quality=Quality(target_error=3e-4)))
    u, t = np.linspace(0.0, 1.0, 51), np.linspace(0.0, 2.5, 801)
    error = np.linalg.norm(found.surface.positions(u, t) - fine.surface.positions(u, t), axis=2).max()
    assert error < 1.5 * (found.accuracy.error_estimate + fine.accuracy.error_estimate)


def test_a_moment_counts_as_much_in_a_long_time_as_in_a_short_one():
    times, off = np.linspace(0.0, 40.0, 4001), np.zeros(4001)
    off[150:180] = 1.0  # 0.3 s
    for longest in (2.0, 10.0, 40.0):
        some = times <= longest
        assert largest(times[some], off[some], 2.0) == 1.0
    off[153:] = 0.0  # 0.03 s
    for longest in (2.0, 10.0, 40.0):
        some = times <= longest
        assert largest(times[some], off[some], 2.0) == 1.0 / MISSED_COUNTS


def test_what_a_spline_misses_in_less_than_a_swing_is_told():
    times, off = np.linspace(0.0, 0.5, 51), np.linspace(0.0, 1.0, 51)
    assert largest(times, off, 2.0) == off[int(0.95 * 50)]
    assert largest(times[:1], off[:1], 2.0) == 0.0


def test_grids_are_compared_while_it_is_lively_however_far_apart_the_even_times_are():
    level = run_level(pose(sagging(1000.0)), 13, 832, 2560, Monitor(), free_knots=True)
    step = 1000.0 / (len(level.samples) - 1)
    assert step == pytest.approx(0.488, abs=1e-3)
    inside = level.between[level.between < step]
    assert len(inside) == 10  # at seven even parts of the time, and at three shorter ones, as it sets out at once
    assert not np.any(level.between > 100.0)  # where it hangs still


def test_the_spline_of_a_free_grid_has_more_knots_where_it_is_lively_and_nowhere_else():
    fixed, free = (run_level(pose(sagging(60.0)), 13, 390, 1200, Monitor(), free_knots=free) for free in (False, True))
    more = np.setdiff1d(free.knots_t, fixed.knots_t)
    assert 0 < len(more) < 20
    assert more.max() < 2.5
    assert free.missed < 0.5 * fixed.missed
