"""A whip that strains its cable beyond belief on every grid is not given up for it, nor damped for ever."""

from dataclasses import replace

import pytest

from benchmarks.hard.generator import draw
from dlocore.accuracy.budget import Means
from dlocore.accuracy.changes import Change, Changes
from dlocore.accuracy.refinement import ROUGH, _Climb, _is_worse
from dlocore.levels.level import CREDIBLE_STRAIN, LEVELS, Size, run_level
from dlocore.problem.problem import Problem, pose
from dlocore.solvers.march import RHO, STRONGLY_DAMPED
from dlocore.solvers.monitor import Monitor


@pytest.fixture(scope="module")
def whip() -> Problem:
    """Return a cable of 45 m, held at one end, whose free end cracks: its tension strains it by 2 %."""
    return pose(draw(4, 42).make(), {"inertia": "it swings"})


def test_strain_that_strong_damping_leaves_is_no_reason_for_it(whip: Problem):
    size = Size(33, 98, 3072)
    level = run_level(whip, *size, Monitor(None, None))
    assert level.motion.largest_strain > CREDIBLE_STRAIN
    assert level.motion.rho == RHO


def test_strain_that_passes_the_credible_by_a_hair_is_no_failure(whip: Problem):
    coarse, fine = (run_level(whip, 33, 98, n, Monitor(None, None), rho=STRONGLY_DAMPED) for n in (1536, 3072))
    assert coarse.motion.largest_strain < CREDIBLE_STRAIN < fine.motion.largest_strain
    assert not _is_worse(fine, coarse)
    torn = replace(fine.motion, largest_strain=2.0 * CREDIBLE_STRAIN)  # more than half as much again
    assert _is_worse(replace(fine, motion=torn), coarse)


@pytest.mark.parametrize(("meets", "rho"), [(False, RHO), (True, STRONGLY_DAMPED)])
def test_strong_damping_ends_with_the_first_refinement_in_time_alone(whip: Problem, meets: bool, rho: float):
    # on the same steps a strongly damped march errs several times as much; but strands that meet rebound less in it
    change = 2.0 * ROUGH * whip.scene.cable.length
    size = Size(33, 49, 192)
    level = replace(run_level(whip, *size, Monitor(None, None), rho=STRONGLY_DAMPED), change=change)
    problem = pose(whip.scene, {**whip.called_for, "self_contact": "strands meet"}) if meets else whip
    climb = _Climb(
        problem=problem, means=Means(Monitor(None, None), None, float("inf")), target=1e-3, enough=1e-3,
        number=len(LEVELS), rho=STRONGLY_DAMPED, changes=Changes({"both": Change(change, 2.0 * change, 0.9)}),
        best=level,
    )  # fmt: skip
    finer = climb._next(level, size, None)
    assert finer is not None
    assert finer.steps > size.steps
    assert climb.rho == rho
    climb.direction = "time"
    climb._weigh(level, level)  # a change that is large still
    assert climb.rho == rho
