"""The model of what a solve costs, the choice of a grid from it, and the front of what is worth its time."""

from dataclasses import replace

import numpy as np
import pytest

from dlocore import Quality, Scene, predict
from dlocore.accuracy.budget import first_level, growth, march_time
from dlocore.accuracy.cost import Cost, Rates, Sample, exponent, fitted_rates, pareto_front
from dlocore.levels.level import LEVELS, Size, given_steps, stretched
from dlocore.problem.problem import pose
from dlocore.study.scenes import hanging, paper_case

PLANE = Rates(
    setup=5e-4, step=8e-6, step_point=7e-7, iteration=2e-4, block=0.0, block_1=4e-7, block_2=2e-8, iterations=4.0
)
SPACE = replace(PLANE, setup=4e-3, step_point=2e-6, block_2=1e-7, iterations=5.0)
COST = Cost(rates={2: PLANE, 3: SPACE}, effects={"friction": 1.5}, estimates={"march": 2.5})
GRIDS = ((7, 11), (9, 13), (13, 19), (17, 25), (25, 37), (33, 49))


def samples(cost: Cost) -> list[Sample]:
    """Return solves that take exactly what a model says."""
    found = []
    for nc, rates in cost.rates.items():
        for n_u, n_t in GRIDS:
            grid = {"coordinates": nc, "n_u": n_u, "n_t": n_t, "steps": given_steps(n_t)}
            march = cost.time("march", n_u, n_t, grid["steps"], coordinates=nc, estimate=False)
            full = cost.time("spacetime", n_u, n_t, grid["steps"], coordinates=nc, estimate=False)
            found.append(Sample(**grid, iterations=0, wall_time=march))
            found.append(Sample(**grid, iterations=round(rates.iterations), wall_time=full))
    return found


def test_times_that_follow_the_model_give_its_rates_back() -> None:
    found = fitted_rates(samples(COST))
    assert set(found) == {2, 3}
    for nc, rates in COST.rates.items():
        for name, value in vars(rates).items():
            # least squares of 6 noiseless times with 3 or 4 unknowns: what is left is rounding, times their condition
            assert getattr(found[nc], name) == pytest.approx(value, rel=1e-6, abs=1e-12), (nc, name)


def test_a_noisy_clock_moves_the_modelled_times_by_no_more_than_its_noise() -> None:
    rng = np.random.default_rng(5)
    noisy = [replace(s, wall_time=s.wall_time * rng.uniform(0.9, 1.1)) for s in samples(COST)]
    model = replace(COST, rates=fitted_rates(noisy))
    for s in samples(COST):
        method = "spacetime" if s.iterations else "march"
        time = model.time(method, s.n_u, s.n_t, s.steps, coordinates=s.coordinates, estimate=False)
        assert time == pytest.approx(s.wall_time, rel=0.1)


def test_effects_and_estimates_lengthen_a_solve_by_their_factors() -> None:
    bare = COST.time("march", 13, 19, 95, estimate=False)
    assert COST.time("march", 13, 19, 95, effects=("friction", "bend"), estimate=False) == pytest.approx(1.5 * bare)
    assert COST.time("march", 13, 19, 95) == pytest.approx(2.5 * bare)


@pytest.mark.parametrize("scene", [paper_case(0.25), paper_case(0.25, friction=0.2), hanging()])
def test_a_budget_begins_with_the_finest_grid_that_leaves_time_for_the_next(scene: Scene) -> None:
    problem = pose(scene)
    times = [march_time(problem, COST, stretched(problem, level)) for level in range(len(LEVELS))]
    found = []
    for budget in (0.005, 0.02, 0.05, 0.2, 10.0):
        level = first_level(problem, COST, budget)
        if level > 0:
            assert times[level] + times[level + 1] <= budget
        if level < len(LEVELS) - 2:
            assert times[level + 1] + times[level + 2] > 0.8 * budget
        found.append(level)
    assert found == sorted(found), "more time begins finer"
    assert found[0] == 0
    assert found[-1] == len(LEVELS) - 2


def test_effects_that_cost_time_begin_coarser() -> None:
    smooth, rough = (pose(paper_case(0.25, friction=friction)) for friction in (0.0, 0.2))
    slow = replace(COST, effects={"friction": 20.0})
    assert first_level(rough, slow, 0.02) < first_level(smooth, slow, 0.02)


def test_without_a_calibration_a_budget_begins_with_the_coarsest_grid() -> None:
    problem = pose(paper_case(0.25))
    assert first_level(problem, None, 10.0) == 0
    assert growth(problem, None, stretched(problem, 0), stretched(problem, 1)) == pytest.approx(2 * 13 / 9)
    assert growth(problem, None, Size(20, 30, 160), Size(30, 30, 160)) == 1.5
    assert first_level(pose(hanging()), Cost(rates={2: PLANE}), 10.0) == 0  # calibrated in the plane only
    assert growth(problem, COST, stretched(problem, 0), stretched(problem, 4)) > 2.0


def test_a_time_budget_with_a_calibration_skips_the_coarse_grids() -> None:
    scene = replace(paper_case(0.25), quality=Quality(time_budget=5.0))
    blind, known = predict(scene), predict(scene, cost=COST)
    assert blind.iterations[0].n_u == stretched(pose(scene), 0).n_u
    assert known.iterations[0].n_u == stretched(pose(scene), len(LEVELS) - 2).n_u
    for one in (blind, known):
        assert one.status == "converged"
        assert one.accuracy.error_estimate is not None
    assert known.accuracy.n_u >= blind.accuracy.n_u


def test_the_front_has_every_point_that_no_other_beats_and_only_those() -> None:
    rng = np.random.default_rng(3)
    times, errors = rng.uniform(size=60), rng.uniform(size=60)
    errors[[4, 17]] = np.nan
    front = pareto_front(times, errors)

    def beaten(i: int) -> bool:
        return any(
            times[j] <= times[i] and errors[j] <= errors[i] and (times[j] < times[i] or errors[j] < errors[i])
            for j in range(60)
        )

    assert set(front) == {i for i in range(60) if np.isfinite(errors[i]) and not beaten(i)}
    assert list(times[front]) == sorted(times[front])


def test_the_exponent_of_a_power_law_is_found() -> None:
    sizes = np.array([9.0, 17.0, 33.0, 65.0])
    p, c = exponent(sizes, 3e-5 * sizes**1.7)
    assert p == pytest.approx(1.7, rel=1e-9)
    assert c == pytest.approx(3e-5, rel=1e-8)
