"""How far the stiffness of contact, which is numerical, takes a motion that strikes something."""

import dataclasses

import numpy as np
import pytest

from dlocore import Cable, Environment, Quality, Scene, Straight, Table, predict
from dlocore.accuracy import budget, doubts, refinement
from dlocore.levels.level import Size, run_level
from dlocore.problem.problem import pose, stiffer
from dlocore.solvers.march import March, march
from dlocore.solvers.monitor import Monitor, TimeIsUp
from dlocore.stability.determined import DOUBTFUL, UNSEEN
from dlocore.stability.firmness import FIRMER, gives_way

LENGTH = 1.0
TOLD = "But contact twice as stiff changes the motion by up to"


def dropped(tilt: float, **quality: float) -> Scene:
    """Return a cable that falls on a table by 2 cm, one end of it first where it is tilted [rad]."""
    return Scene(
        cable=Cable(length=LENGTH, diameter=0.005, linear_density=0.04, bending_stiffness=1e-3, bending_damping=1e-4),
        shape=Straight(start=(0.0, 0.0, 0.02), direction=(np.cos(tilt), 0.0, np.sin(tilt))),
        environment=Environment(table=Table()),
        horizon=0.3,
        quality=Quality(**quality),
    )


def test_it_is_how_far_the_same_march_goes_elsewhere_with_stiffer_contact():
    problem, monitor = pose(dropped(0.3)), Monitor()
    level = run_level(problem, *Size(19, 28, 320), monitor, free_knots=True)
    assert level.motion.split  # it strikes
    solved = level.problem
    firm = march(stiffer(solved, FIRMER), level.motion.grid, 320, monitor, rho=level.motion.rho)
    apart = np.linalg.norm((firm.states - level.motion.states)[..., : solved.plane.dimensions], axis=-1).max()
    moved = gives_way(solved, level.motion, monitor)
    assert moved == apart
    assert moved > 1e-4 * LENGTH


def test_what_does_not_strike_is_not_marched_again():
    lying = dataclasses.replace(dropped(0.0), shape=Straight(start=(0.0, 0.0, 0.0)))
    level = run_level(pose(lying), *Size(9, 13, 40), Monitor(), free_knots=True)
    assert not level.motion.split
    nothing_may_run = Monitor(None, None, lambda: True)  # a march would be cancelled at its first step
    assert gives_way(level.problem, level.motion, nothing_may_run) == 0.0


def test_a_cable_that_falls_flat_hardly_hangs_on_it_and_a_tilted_one_tells():
    flat, tilted = predict(dropped(0.0)), predict(dropped(0.1, target_error=0.005))
    assert "contact" not in flat.accuracy.error_parts
    assert flat.status == "converged"
    contact = tilted.accuracy.error_parts["contact"]
    assert contact > DOUBTFUL * LENGTH
    assert TOLD in tilted.message
    assert tilted.accuracy.error_estimate == pytest.approx(sum(tilted.accuracy.error_parts.values()))


@pytest.fixture
def given(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """How far contact takes motions from here on [m], as often as it is asked; the last of them for ever."""
    said: list[float] = []
    monkeypatch.setattr(doubts, "gives_way", lambda *_: said.pop(0) if len(said) > 1 else said[0])
    return said


def test_what_takes_a_motion_beyond_its_target_is_no_success(given: list[float]):
    given.append(0.02)
    found = predict(dropped(0.0, target_error=0.01))
    assert found.status == "stalled"
    assert found.message.startswith("Two grids agree")
    assert f"{TOLD} 20 mm. Make the motion slower" in found.message
    assert found.accuracy.error_parts["contact"] == 0.02


def test_what_a_target_has_room_for_counts(given: list[float]):
    given.append(0.003)
    found = predict(dropped(0.0, target_error=0.01))
    assert found.status == "converged"
    assert f"{TOLD} 3 mm." in found.message
    assert 0.003 < found.accuracy.error_estimate < 0.01


def test_what_it_leaves_too_little_room_for_is_made_up_for_by_finer_grids(given: list[float]):
    given.append(0.0)
    plain = predict(dropped(0.0))
    assert plain.status == "converged"
    given[:] = [0.01 * LENGTH - 0.5 * plain.accuracy.error_estimate]
    found = predict(dropped(0.0))
    sizes = [found.accuracy.n_u * found.accuracy.steps, plain.accuracy.n_u * plain.accuracy.steps]
    assert sizes[0] > sizes[1]
    assert found.status in ("converged", "max_iterations")
    assert (found.status == "converged") == (found.accuracy.error_estimate <= 0.01 * LENGTH)


def test_where_no_time_is_left_to_look_the_answer_says_so(monkeypatch: pytest.MonkeyPatch):
    def late(*_: object) -> float:
        raise TimeIsUp

    monkeypatch.setattr(doubts, "gives_way", late)
    assert UNSEEN in predict(dropped(0.0, target_error=0.01)).message


def test_grids_that_would_do_without_it_are_refined_further(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(refinement, "AUTO_TARGET", 1e-4)  # so that the finest grids agree to what is enough only
    monkeypatch.setattr(budget, "MOST_WORK", 0.1 * budget.MOST_WORK)
    looked: list[Size] = []
    contact = 0.0

    def asked(_: object, motion: March, __: object) -> float:
        looked.append(Size(motion.grid.n_u, 0, motion.asked))
        return contact

    monkeypatch.setattr(doubts, "gives_way", asked)
    scene = dataclasses.replace(dropped(0.6), horizon=0.2)
    plain = predict(scene)
    assert "No finer one was tried" in plain.message
    assert len(looked) == 1
    contact = 0.01 * LENGTH - 0.5 * plain.accuracy.error_estimate
    found = predict(scene)
    assert found.accuracy.n_u * found.accuracy.steps > plain.accuracy.n_u * plain.accuracy.steps
    assert len(set(looked)) == len(looked) - 1  # each grid once, the first of them twice


def test_on_a_given_grid_a_note_tells_of_it_where_it_is_more_than_a_thousandth():
    scenes = [
        dataclasses.replace(dropped(tilt), quality=Quality(n_u=25, n_t=41, keep_grid=True)) for tilt in (0.0, 0.3)
    ]
    flat, tilted = (predict(scene) for scene in scenes)
    assert flat.status == tilted.status == "converged"
    assert gives_way(tilted.level.problem, tilted.level.motion, Monitor()) > DOUBTFUL * LENGTH
    note = f"on this grid {TOLD.removeprefix('But ')}"
    assert note in tilted.message
    assert note not in flat.message
