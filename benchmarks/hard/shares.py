"""The share of random scenes that converges: all run with little time, and a sample of the rest with more and more."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from benchmarks.hard.judge import WRONG, by_a_march, is_undetermined
from dlocore.stability.determined import DISTURBED

# factors by which a change of the start may grow: beyond them a motion counts as not determined
GROWTHS = (WRONG / DISTURBED, 0.1 * WRONG / DISTURBED)
_DRAWS = 200_000
_PRIOR = 0.5  # Jeffreys' prior


class Strata(NamedTuple):
    """Counts of a run in stages.

    Attributes:
        converged: scenes that converge in the first stage.
        lost: scenes that are refused, raise or hang in the first stage: more time does not help.
        left: the other scenes.
        again_converged: scenes drawn from `left` for the second stage that converge in it.
        again_failed: scenes drawn for the second stage that do not converge in it.
        again_excluded: scenes drawn for the second stage that do not determine their motion, or prove impossible in it.
    """

    converged: int
    lost: int
    left: int
    again_converged: int
    again_failed: int
    again_excluded: int


def drawn_again(seed: int, left: Sequence[int], count: int) -> list[int]:
    """Return at most `count` indices drawn from those left for the second stage, in the order in which they are run.

    The place of each depends only on the seed and the index itself, so the beginning of the order is a fair sample too.
    """
    return sorted(left, key=lambda index: (np.random.default_rng([seed, index, 2]).random(), index))[:count]


def is_left(record: dict[str, Any]) -> bool:
    """Tell whether a scene did not converge in the first stage, but may with more time."""
    told = record["status"] in ("max_iterations", "stalled", "time_limit")
    return told and record["possible"] and record.get("method") != "paper"


def has_failed(record: dict[str, Any]) -> bool:
    """Tell whether a scene in a later stage determines its motion and did not converge."""
    return is_left(record) and not is_undetermined(record)


def in_place_of(again: list[dict[str, Any]], last: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return the records of the second stage, each replaced by that of the third stage if there is one."""
    newer = {r["index"]: r for r in last}
    return [newer.get(r["index"], r) for r in again]


def strata(
    seed: int, first: list[dict[str, Any]], again: list[dict[str, Any]], growth: float, *, as_asked: bool = False
) -> Strata:
    """Count the records of the first stage and of a later one.

    Scenes that are shown to amplify a change by more than `growth` are left out. With `as_asked`, a march in place of a
    least squares counts as a failure.

    Records of the second stage count up to the first drawn scene that is missing: which ones are missing after an
    interrupted run is not random.
    """
    judged = [r for r in first if r["possible"] and r.get("method") != "paper"]
    left = {r["index"] for r in judged if is_left(r)}
    known = [r for r in judged if r["index"] not in left and not is_undetermined(r, growth)]
    run = {r["index"]: r for r in again}
    drawn: list[dict[str, Any]] = []
    for index in drawn_again(seed, sorted(left), len(left)):
        if index not in run:
            break
        drawn.append(run[index])
    determined = [r for r in drawn if r["possible"] and not is_undetermined(r, growth)]

    def is_good(record: dict[str, Any]) -> bool:
        return record["status"] == "converged" and not (as_asked and by_a_march(record))

    good, converged = sum(map(is_good, determined)), sum(map(is_good, known))
    return Strata(
        converged=converged,
        lost=len(known) - converged,
        left=len(left),
        again_converged=good,
        again_failed=len(determined) - good,
        again_excluded=len(drawn) - len(determined),
    )


def share(counts: Strata) -> tuple[float, float, float]:
    """Return the share that converges in the end, among scenes that determine their motion, and its 95 % interval.

    The interval holds for scenes drawn in the same way. It includes the chance of which scenes were drawn and of which
    ones were run again: it gives quantiles of the share when the shares of the strata are drawn from their posteriors
    with Jeffreys' prior.
    """
    a, lost, left, *again = counts
    if left > 0 and sum(again) == 0:
        return np.nan, np.nan, np.nan
    rng = np.random.default_rng(0)
    first = rng.dirichlet([a + _PRIOR, lost + _PRIOR, left + _PRIOR], _DRAWS)
    second = rng.dirichlet(np.add(again, _PRIOR), _DRAWS)
    good, bad = first[:, 0] + first[:, 2] * second[:, 0], first[:, 1] + first[:, 2] * second[:, 1]
    low, high = np.quantile(good / (good + bad), [0.025, 0.975])
    p = np.array(again) / max(1, sum(again))
    best = a + left * p[0]
    return best / max(1.0, best + lost + left * p[1]), float(low), float(high)
