"""The model of what a solve costs, the choice of a grid from it, and the front of what is worth its time."""

from dataclasses import replace

import numpy as np
import pytest

from dlocore.budget import grid_within
from dlocore.cost import Cost, Rates, Sample, exponent, fitted_rates, pareto_front
from dlocore.problem import pose
from dlocore.solvers.ladder import given_steps
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
def test_the_grid_for_a_budget_costs_no_more_and_the_next_one_does(scene: object) -> None:
    problem = pose(scene)  # type: ignore[arg-type]
    active = [name for name, choice in problem.choices.items() if choice.active]
    sizes = []
    for budget in (0.02, 0.05, 0.2):
        grid = grid_within(problem, COST, budget)
        assert grid is not None
        n_u, n_t = grid

        def time(n_u: int, n_t: int) -> float:
            return COST.time("march", n_u, n_t, given_steps(n_t), coordinates=problem.nc, effects=active)

        assert time(n_u, n_t) <= budget < time(n_u + 1, round(n_t * (n_u + 1) / n_u) + 1)
        sizes.append(n_u)
    assert sizes == sorted(set(sizes)), "more time gives a finer grid"


def test_a_budget_below_every_grid_gives_none() -> None:
    assert grid_within(pose(paper_case(0.25)), COST, 1e-4) is None


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
