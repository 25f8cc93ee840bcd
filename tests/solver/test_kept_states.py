"""Marches of very many steps, of which not every state is kept: the motion is the same, seen at fewer times."""

import dataclasses
import gc
import weakref

import numpy as np
import pytest

from dlocore import Cable, Environment, Grasp, Load, Move, Points, Quality, Scene, Sphere, Table, predict
from dlocore.accuracy import refinement
from dlocore.kernels.predictor import differences_of
from dlocore.levels import progress, review
from dlocore.levels.level import Level, Size
from dlocore.levels.progress import record_level
from dlocore.levels.whole_march import march_level
from dlocore.problem.problem import pose
from dlocore.problem.time_grid import marks_of, step_counts
from dlocore.sensitivity import objection
from dlocore.solvers import kept
from dlocore.solvers.march import March, march
from dlocore.solvers.monitor import Monitor
from dlocore.spline import design_matrix
from dlocore.statics.statics import start_grid

BENT = tuple((float(x), 0.0, float(0.02 + 0.15 * np.sin(np.pi * x))) for x in np.linspace(0.0, 0.95, 9))
CABLE = Cable(length=1.0, diameter=0.008, linear_density=0.05, bending_stiffness=5e-3)
LIFT = Move(displacement=(-0.1, 0.05, 0.1), duration=0.4)

SCENES = {
    "let go": Scene(
        cable=CABLE,
        shape=Points(points=BENT),
        grasps=(Grasp(u=0.0, hold="clamp"), Grasp(u=1.0, path=LIFT, release_time=0.25)),
        horizon=0.6,
    ),
    "twisted and yielding": Scene(
        cable=dataclasses.replace(CABLE, yield_strain=0.004, memory_rate=10.0),
        shape=Points(points=BENT),
        grasps=(
            Grasp(u=0.0, hold="clamp"),
            Grasp(u=1.0, hold="clamp", path=dataclasses.replace(LIFT, rotation=(2.0, 0.0, 0.0))),
        ),
        effects={"plasticity": "on", "twist": "on"},
        horizon=0.5,
    ),
    "loaded": Scene(
        cable=CABLE,
        shape=Points(points=BENT),
        grasps=(Grasp(u=0.0), Grasp(u=1.0)),
        loads=(Load(u=0.4, force=((0.0, 0.0, 0.0), (0.0, 0.1, 0.3), (0.1, 0.0, 0.0)), times=(0.0, 0.2, 0.4)),),
        horizon=0.5,
    ),
    "dropped on a table": Scene(
        cable=CABLE,
        shape=Points(points=tuple((x, y, z + 0.05) for x, y, z in BENT)),
        grasps=(Grasp(u=0.0, release_time=0.05), Grasp(u=1.0, path=LIFT)),
        environment=Environment(table=Table(height=0.0, friction=0.3)),
        horizon=0.5,
    ),
}


def marched(scene: Scene, steps: int = 150) -> March:
    problem, monitor = pose(scene), Monitor(None, None)
    return march(problem, start_grid(problem, 11, monitor), steps, monitor)


def thinned(scene: Scene, every: int, monkeypatch: pytest.MonkeyPatch) -> March:
    full = marched(scene)
    monkeypatch.setattr(kept, "MOST_NUMBERS", full.states.size / every)
    return marched(scene)


@pytest.mark.parametrize("every", [2, 7, 1000])
@pytest.mark.parametrize("name", SCENES)
def test_every_so_many_states_are_those_of_the_whole_march(name: str, every: int, monkeypatch: pytest.MonkeyPatch):
    scene = SCENES[name]
    full, thin = marched(scene), thinned(scene, every, monkeypatch)
    rows = np.flatnonzero(np.isin(full.times, thin.times))
    assert len(thin.times) < len(full.times) / min(every, 20) + 8
    assert len(rows) == len(thin.times)
    np.testing.assert_array_equal(thin.states, full.states[rows])
    if len(full.log):
        np.testing.assert_array_equal(thin.log, full.log[rows])
    assert (thin.steps, thin.stopped, thin.split, thin.deepest) == (full.steps, "", full.split, full.deepest)
    assert thin.largest_strain == full.largest_strain
    assert thin.reached == len(thin.times) - 1
    for few, all_of_them in zip(thin.forces, full.forces, strict=True):
        at = np.flatnonzero(np.isin(all_of_them.times, few.times))
        assert (few.times[0], few.times[-1]) == (all_of_them.times[0], all_of_them.times[-1])
        np.testing.assert_array_equal(few.forces, all_of_them.forces[at])
        np.testing.assert_array_equal(few.states, all_of_them.states[at])


def test_the_ends_of_all_stretches_are_kept(monkeypatch: pytest.MonkeyPatch):
    scene = SCENES["let go"]
    marks = marks_of(pose(scene))
    thin = thinned(scene, 1000, monkeypatch)
    np.testing.assert_allclose(thin.times, marks, rtol=0.0, atol=1e-12)
    np.testing.assert_array_equal(kept.rows_of(1000, step_counts(marks, 150)), np.cumsum([0, *step_counts(marks, 150)]))


def test_a_knock_moves_what_is_kept_and_what_follows(monkeypatch: pytest.MonkeyPatch):
    problem, monitor = pose(SCENES["let go"]), Monitor(None, None)
    grid = start_grid(problem, 11, monitor)
    knocks = {0.1: 1e-3 * np.cos(np.arange(11.0))[:, None] * np.ones(problem.nc)}
    full = march(problem, grid, 150, monitor, knocks=knocks)
    monkeypatch.setattr(kept, "MOST_NUMBERS", full.states.size / 9)
    thin = march(problem, grid, 150, monitor, knocks=knocks)
    assert len(thin.times) < len(full.times) / 5
    np.testing.assert_array_equal(thin.states, full.states[np.isin(full.times, thin.times)])


def test_a_march_that_ends_early_stands_still_from_there(monkeypatch: pytest.MonkeyPatch):
    problem, monitor = pose(SCENES["let go"]), Monitor(None, None)
    grid = start_grid(problem, 11, monitor)
    strain = 0.5 * march(problem, grid, 150, monitor).largest_strain
    monkeypatch.setattr("dlocore.solvers.march.CHUNK", 5)
    full = march(problem, grid, 150, monitor, credible=strain)
    monkeypatch.setattr(kept, "MOST_NUMBERS", full.states.size / 4)
    thin = march(problem, grid, 150, monitor, credible=strain)
    assert (full.stopped, thin.stopped) == ("strain", "strain")
    assert 0 < thin.reached < len(thin.times) - 1
    assert thin.times[thin.reached] <= full.times[full.reached] < thin.times[thin.reached + 1]
    np.testing.assert_array_equal(thin.states[thin.reached + 1 :] - full.states[full.reached], 0.0)


@pytest.mark.parametrize("every", [2, 5])
def test_a_thin_log_stands_still_from_there_too(every: int, monkeypatch: pytest.MonkeyPatch):
    problem, monitor = pose(SCENES["twisted and yielding"]), Monitor(None, None)
    grid = start_grid(problem, 11, monitor)
    strain = 0.5 * march(problem, grid, 150, monitor).largest_strain
    monkeypatch.setattr("dlocore.solvers.march.CHUNK", 5)
    full = march(problem, grid, 150, monitor, credible=strain)
    monkeypatch.setattr("dlocore.solvers.march.MOST_FRAMES", -(-11 * 151 // every))
    thin = march(problem, grid, 150, monitor, credible=strain)
    assert full.stopped == "strain"
    assert 0 < full.reached < 150
    assert len(thin.log) < len(full.log) / every + 2
    np.testing.assert_array_equal(thin.log, full.log[thin.logged])


@pytest.mark.parametrize("every", [1, 4])
def test_steps_are_predicted_from_all_the_states_behind_them(every: int, monkeypatch: pytest.MonkeyPatch):
    states = np.random.default_rng(0).normal(size=(61, 7, 3))
    monkeypatch.setattr(kept, "MOST_NUMBERS", states.size / every)
    held = kept.Kept(states[0], [60], np.inf, (0, 0))
    assert held.thin == (every > 1)
    for at, until in ((0, 20), (20, 21), (21, 23), (23, 60)):
        base, window, log = held.window(at, until, 0)
        np.testing.assert_array_equal(differences_of(window[: at - base + 1]), differences_of(states[: at + 1]))
        window[at - base + 1 :] = states[at + 1 : until + 1]
        held.keep(base, window, log, at, until)
    np.testing.assert_array_equal(held.states, states[held.steps])


def test_a_march_without_time_stays_at_its_start():
    problem = pose(SCENES["twisted and yielding"])
    grid = start_grid(problem, 11, Monitor(None, None))
    motion = march(problem, grid, 150, Monitor(None, 0.0))
    assert (motion.stopped, motion.reached) == ("time", 0)
    np.testing.assert_array_equal(motion.states, np.broadcast_to(grid.start, motion.states.shape))
    assert np.abs(motion.log[0]).max() > 0.0
    np.testing.assert_array_equal(motion.log, np.broadcast_to(motion.log[0], motion.log.shape))


def test_a_surface_of_few_states_is_that_of_all(monkeypatch: pytest.MonkeyPatch):
    scene = dataclasses.replace(
        SCENES["twisted and yielding"], quality=Quality(n_u=11, n_t=17, method="march", keep_grid=True)
    )
    full = predict(scene)
    assert full.level is not None
    monkeypatch.setattr(kept, "MOST_NUMBERS", full.level.motion.states.size / 3)
    thin = predict(scene)
    assert thin.level is not None
    assert len(thin.level.motion.times) < 0.5 * len(full.level.motion.times)
    u, t = np.linspace(0.0, 1.0, 21), np.linspace(0.0, 0.5, 33)
    missed = full.level.missed
    assert missed > 0.0
    np.testing.assert_allclose(thin.surface.positions(u, t), full.surface.positions(u, t), rtol=0.0, atol=missed)
    assert thin.material is not None
    assert full.material is not None
    np.testing.assert_allclose(thin.material.memory[-1], full.material.memory[-1], rtol=1e-12)
    assert thin.accuracy.steps == full.accuracy.steps


def test_steps_whose_states_were_not_kept_are_not_differentiated(monkeypatch: pytest.MonkeyPatch):
    scene = SCENES["loaded"]
    assert objection(pose(scene), marched(scene)) == ""
    assert "not all of its states" in objection(pose(scene), thinned(scene, 3, monkeypatch))


@pytest.mark.parametrize(("gap", "says"), [(-0.02, "passes through"), (0.005, "comes within 5"), (1.0, "")])
def test_obstacles_are_looked_for_in_a_few_states_at_once(gap: float, says: str, monkeypatch: pytest.MonkeyPatch):
    problem = pose(SCENES["loaded"])
    motion = marched(SCENES["loaded"], 100)
    places = design_matrix(motion.grid.knots, np.linspace(0.0, 1.0, 65))
    passed = problem.world(places @ motion.states)[..., :3].reshape(-1, 3)
    x, y, z = passed[passed[:, 2].argmax()]  # the highest place on the way
    ball = Sphere(center=(x, y, z + 0.03 + 0.5 * CABLE.diameter + gap), radius=0.03)
    scene = dataclasses.replace(
        SCENES["loaded"], environment=Environment(obstacles=(ball,)), effects={"obstacles": "off"}
    )
    level = march_level(pose(scene), Size(11, 17, 100), Monitor(None, None))
    at_once = review._touches(level)
    monkeypatch.setattr(review, "_BLOCK", 7)
    assert review._touches(level) == at_once
    assert says in at_once.get("obstacles", "") if says else at_once == {}


@pytest.mark.parametrize("name", ["let go", "twisted and yielding"])
def test_of_the_grids_before_the_last_no_log_is_kept_and_nothing_that_is_asked_for_changes(
    name: str, monkeypatch: pytest.MonkeyPatch
):
    """Frames and memory of all grids of a long refinement took gigabytes."""
    marches: list[weakref.ref[March]] = []

    def seen(level: Level, monitor: Monitor) -> None:
        marches.append(weakref.ref(level.motion))
        record_level(level, monitor)

    scene = dataclasses.replace(SCENES[name], quality=Quality(target_error=3e-3))
    monkeypatch.setattr(refinement, "record_level", seen)
    plain = predict(scene)
    assert len(plain.iterations) > 1
    kept_without = [found() for found in marches]
    marches.clear()
    monkeypatch.setattr(progress, "_LARGE", 0)
    found = predict(scene)
    gc.collect()
    *before, last = [march() for march in marches]
    assert last is not None
    assert found.level is not None
    assert all(march is None for march in before)
    assert all(len(level.motion.log) == 0 for level in found.level.beside)
    assert any(kept_without[:-1])  # small ones are, until their surface is asked for, which takes time
    for one, other in zip(plain.iterations, found.iterations, strict=True):
        np.testing.assert_array_equal(one.surface.control_points, other.surface.control_points)
        assert one.energy == other.energy
    for grasp, same in zip(plain.grasps, found.grasps, strict=True):
        np.testing.assert_array_equal(grasp.reaction_error, same.reaction_error)
        np.testing.assert_array_equal(grasp.moment_error, same.moment_error)
