"""What time budgets achieve: `python -m benchmarks.budgets [--seed S] [--begin N] [--end N] [--budgets MS ...]
[--calibrated]`.

Random hard scenes are predicted within time budgets and compared with a prediction to 0.1 % of the length. Times are
processor times, so that other programs on the machine do not count. The first grid is the coarsest one; with
`--calibrated` it is chosen from the results of `dlo calibrate` on this machine.
"""

import argparse
import time
from collections import defaultdict
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from benchmarks.hard.generator import draw
from benchmarks.machine import machine_line
from dlocore import Quality, SceneError, predict, warm_up
from dlocore.accuracy.cost import Cost
from dlocore.calibration import stored_cost

TARGET = 1e-3  # of the length: of what the answers are compared with
DEADLINE = 15.0  # [s] for that
SMALL = 2e-3  # of the length: a smaller error is not asked for what was estimated


class Answer(NamedTuple):
    """What came of a budget: its status, the number of grids, the time [s], and parts of the length: error, told."""

    status: str
    grids: int
    spent: float
    error: float
    told: float | None


def answers(seed: int, index: int, budgets: list[float], cost: Cost | None) -> list[Answer]:
    """Return what each budget gives for a random scene; nothing where no fine prediction converges."""
    drawn = draw(seed, index)
    if not drawn.possible:
        return []
    try:
        scene = drawn.make()
        length = scene.cable.length
        fine = predict(replace(scene, quality=Quality(target_error=TARGET * length)), deadline=DEADLINE)
        if fine.status != "converged":
            return []
        u, t = np.linspace(0.0, length, 65), np.linspace(0.0, fine.surface.horizon, 65)
        expected, found = fine.surface.positions(u, t), []
        for budget in budgets:
            began = time.process_time()
            answer = predict(replace(scene, quality=Quality(time_budget=budget)), cost=cost)
            spent = time.process_time() - began
            error = np.linalg.norm(answer.surface.positions(u, t) - expected, axis=-1).max() / length
            told = answer.accuracy.error_estimate
            known = None if told is None else (told + (fine.accuracy.error_estimate or 0.0)) / length
            found.append(Answer(answer.status, len(answer.iterations), spent, float(error), known))
    except SceneError:
        return []
    return found


def row(budget: float, found: list[Answer]) -> str:
    """Return a row of the table: of those with more than one grid, too, how often what was told was half the error."""
    part = np.array([answer.spent for answer in found]) / budget
    finer = np.array([answer.spent for answer in found if answer.grids > 1] or [np.nan]) / budget
    good = [answer for answer in found if answer.status == "converged"]
    errors = np.array([answer.error for answer in good] or [np.nan])
    low = sum(a.error > max(2.0 * (a.told or 0.0), SMALL) for a in good)
    quantiles = ("{:.2f}, {:.2f}, {:.2f}".format(*np.quantile(x, [0.5, 0.9, 1.0])) for x in (part, finer))
    return (
        f"| {budget * 1e3:g} | {' | '.join(quantiles)} | {len(good) / len(found):.0%} | "
        f"{np.median(errors):.1e}, {np.quantile(errors, 0.9):.1e} | {low} of {len(good)} |"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=108)
    parser.add_argument("--begin", type=int, default=0, help="first index (default 0)")
    parser.add_argument("--end", type=int, default=300, help="index after the last (default 300)")
    parser.add_argument("--budgets", type=float, nargs="+", default=[5.0, 20.0, 100.0, 500.0], help="time budgets [ms]")
    parser.add_argument(
        "--calibrated", action="store_true", help="use the measured cost of solves, as the service does"
    )
    options = parser.parse_args()
    warm_up()
    cost = stored_cost() if options.calibrated else None
    if options.calibrated and cost is None:
        parser.error("--calibrated needs a calibration: dlo calibrate")
    budgets = [1e-3 * ms for ms in options.budgets]
    by_budget: dict[float, list[Answer]] = defaultdict(list)
    for index in range(options.begin, options.end):
        for budget, answer in zip(budgets, answers(options.seed, index, budgets, cost), strict=False):
            by_budget[budget].append(answer)
            if answer.status == "converged" and answer.error > max(2.0 * (answer.told or 0.0), SMALL):
                print(f"{index}: {answer.error:.1e} of the length off at {answer.told:.1e}, {1e3 * budget:g} ms")
            if answer.spent > 3.0 * budget and answer.grids > 1:
                print(f"{index}: {answer.spent * 1e3:.0f} ms of {1e3 * budget:g}, {answer.grids} grids", flush=True)
    print(f"{len(by_budget[budgets[0]])} scenes; time as a part of the budget: median, 90 %, largest")
    print("| budget [ms] | time | where a second grid began | converged | errors: median, 90 % | told half |")
    print("|---" * 6 + "|")
    for budget in budgets:
        print(row(budget, by_budget[budget]))
    print(machine_line())


if __name__ == "__main__":
    main()
