"""What is left of a time budget decides on the grids of a climb, and what its answer says."""

from dataclasses import replace

import pytest

from benchmarks.hard.generator import draw
from dlocore import Quality, predict
from dlocore.accuracy import refinement
from dlocore.accuracy.budget import Means
from dlocore.levels import whole_march
from dlocore.levels.level import Level, run_level, stretched
from dlocore.levels.whole_march import march_level
from dlocore.problem.problem import pose
from dlocore.solvers.monitor import Monitor, TimeIsUp
from tests.solver.scenes import paper_scene


def test_finer_grids_end_with_a_time_budget_and_the_first_one_does_not(monkeypatch: pytest.MonkeyPatch):
    left: list[float] = []

    def marched(problem: object, size: object, monitor: Monitor, *arguments: object, **options: object) -> Level:
        left.append(monitor.remaining())
        return march_level(problem, size, monitor, *arguments, **options)

    monkeypatch.setattr(refinement, "march_level", marched)
    found = predict(replace(paper_scene(0.25), quality=Quality(time_budget=600.0)), deadline=900.0)
    assert found.status == "converged"
    assert 600.0 < left[0] <= 900.0
    assert max(left[1:]) <= 600.0


def test_a_budget_that_ends_within_a_march_has_the_grid_before_as_its_answer(monkeypatch: pytest.MonkeyPatch):
    scene = replace(paper_scene(0.25), quality=Quality(time_budget=600.0))
    sizes: list[object] = []

    def marched(problem: object, size: object, monitor: Monitor, *arguments: object, **options: object) -> Level:
        sizes.append(size)
        if len(sizes) > 2:
            monitor.end_within(-1.0)
        return march_level(problem, size, monitor, *arguments, **options)

    monkeypatch.setattr(refinement, "march_level", marched)
    monkeypatch.setattr(Monitor, "elapsed", lambda monitor: 0.0 if len(sizes) < 3 else 601.0)
    found = predict(scene)
    assert len(sizes) == 3
    assert found.accuracy.n_u == sizes[1].n_u
    assert "The best grid in 600000 ms" in found.message
    assert found.accuracy.error_estimate is not None


def test_an_answer_tells_which_effects_it_had_no_time_for(monkeypatch: pytest.MonkeyPatch):
    calls: list[object] = []

    def marched(problem: object, size: object, monitor: Monitor, *arguments: object, **options: object) -> Level:
        calls.append(size)
        level = march_level(problem, size, monitor, *arguments, **options)
        if len(calls) == 2:
            raise TimeIsUp("self_contact", "side")
        return level

    monkeypatch.setattr(refinement, "march_level", marched)
    for quality, deadline in ((Quality(time_budget=600.0), None), (Quality(target_error=1e-3), 600.0)):
        calls.clear()
        found = predict(replace(paper_scene(0.25), quality=quality), deadline=deadline)
        assert found.status == "time_limit"
        assert "a finer grid calls for self_contact, a side to go to, which this answer leaves out" in found.message
        assert found.accuracy.error_estimate is None


def test_the_effects_of_a_march_that_the_time_ends_are_named(monkeypatch: pytest.MonkeyPatch):
    problem = pose(paper_scene(0.25))
    size = refinement.stretched(problem, 0)
    monkeypatch.setattr(whole_march, "called_for", lambda level, fine: {"twist": 1.0})
    marches: list[object] = []

    def ended(problem: object, *arguments: object, **options: object) -> Level:
        marches.append(problem)
        if len(marches) == 2:
            raise TimeIsUp
        return run_level(problem, *arguments, **options)

    monkeypatch.setattr(whole_march, "run_level", ended)
    with pytest.raises(TimeIsUp, match=r"^twist$"):
        march_level(problem, size, Monitor(), whole=True)


def test_within_a_time_budget_an_error_of_more_than_a_hundredth_is_no_success():
    loop = draw(108, 96).make()  # 18 m long, and its second grid is 2 m from the first
    found = predict(replace(loop, quality=Quality(time_budget=1e-4)))
    assert (found.status, found.accuracy.error_estimate) == ("time_limit", None)
    climb = refinement._Climb(
        problem=pose(loop), means=Means(Monitor(), None, 600.0), target=0.04, enough=0.18, number=0
    )
    for number in (0, 1):
        size = refinement.stretched(climb.problem, number)
        level = climb._march(size)
        if climb.best is not None:
            climb._weigh(level, climb.best)
        climb.best = level
    outcome = climb._within_budget(climb.best)
    assert sum(outcome.errors.values()) > climb.enough
    assert outcome.status == "time_limit"
    assert "Its estimated error is more than 1% of the length: allow more time." in outcome.message


def test_a_march_that_called_for_another_effect_does_not_count_in_what_the_next_grid_takes(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    spent: list[float] = []

    def fits(means: Means, problem: object, size: object, finer: object, took: float, checked: bool) -> bool:
        spent.append(took)
        assert checked is (len(spent) > 1)
        return True

    clock = iter(range(100_000))
    monkeypatch.setattr(Means, "next_fits", fits)
    monkeypatch.setattr(Monitor, "elapsed", lambda monitor: 1e-3 * next(clock))  # each look at the clock takes 1 ms
    scene = replace(paper_scene(0.25), quality=Quality(time_budget=600.0))
    yielding = replace(scene, cable=replace(scene.cable, yield_strain=1e-3, memory_rate=100.0))
    predict(scene)
    plain = spent.copy()
    spent.clear()
    found = predict(yielding)
    assert "calls for plasticity" in found.iterations[0].note
    assert spent[0] < 1.5 * plain[0]  # and not two marches


def test_a_grid_that_no_other_has_checked_is_followed_by_one_that_may_be_done_in_time() -> None:
    problem = pose(paper_scene(0.25))
    size, finer = stretched(problem, 0), stretched(problem, 1)
    for budget, checked, fits in ((2.0, True, False), (2.0, False, True), (1.0, False, False), (4.0, True, True)):
        means = Means(Monitor(None, None, None), None, budget)
        assert means.next_fits(problem, size, finer, 1.0, checked) is fits
