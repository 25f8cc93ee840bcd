"""The arithmetic of runs of random scenes in stages."""

from typing import Any

import numpy as np
import pytest

from benchmarks.hard.judge import by_a_march, faults, is_undetermined, left_its_grid
from benchmarks.hard.shares import GROWTHS, Strata, drawn_again, has_failed, in_place_of, is_left, share, strata
from benchmarks.random_scenes import counts, in_the_end, summary
from dlocore.accuracy.companion import TOO_LATE
from dlocore.stability.determined import DISTURBED

SEED = 5


def record(index: int, status: str, **more: Any) -> dict[str, Any]:
    return {"index": index, "status": status, "possible": True, "method": "auto", "faults": [], **more}


def test_the_share_is_that_of_a_sample_weighted_by_what_it_stands_for():
    counted = Strata(converged=900, lost=0, left=100, again_converged=30, again_failed=15, again_excluded=5)
    middle, low, high = share(counted)
    assert middle == pytest.approx((900 + 60) / (900 + 90))
    assert low < middle < high


def test_where_nothing_is_left_out_all_are_counted_and_the_interval_is_that_of_a_binomial():
    middle, low, high = share(Strata(9000, 0, 1000, 800, 200, 0))
    assert middle == pytest.approx(0.98)
    wilson = 1.96 * np.sqrt(0.98 * 0.02 / 10000)
    assert high - low == pytest.approx(2 * wilson, rel=0.05)


def test_no_failure_in_a_sample_is_not_certainty():
    middle, low, high = share(Strata(9000, 0, 1000, 50, 0, 0))
    assert middle == 1.0
    assert 0.99 < low < 0.9995 < high <= 1.0
    assert share(Strata(10, 0, 0, 0, 0, 0))[0] == 1.0
    assert np.isnan(share(Strata(10, 0, 5, 0, 0, 0))[0])


def test_the_interval_holds_the_truth_nineteen_times_in_twenty():
    rng = np.random.default_rng(1)
    first, chances = 0.95, [0.6, 0.3, 0.1]  # converged in the first stage; of the rest converged, failed, excluded
    truth = (first + 0.05 * 0.6) / (first + 0.05 * 0.9)
    held = 0
    for _ in range(200):
        a = rng.binomial(5000, first)
        low, high = share(Strata(a, 0, 5000 - a, *rng.multinomial(100, chances)))[1:]
        held += low <= truth <= high
    assert 180 <= held <= 200  # 190 expected, three standard deviations are 9


def test_who_is_run_again_is_drawn_by_seed_and_index_and_the_first_of_more_are_the_same():
    left = list(range(0, 400, 3))
    drawn = drawn_again(SEED, left, 20)
    assert drawn == drawn_again(SEED, left[::-1], 50)[:20]
    assert drawn != drawn_again(SEED + 1, left, 20)
    assert drawn == [i for i in drawn_again(SEED, range(400), 400) if i in left][:20]
    assert drawn != sorted(drawn)


def test_records_of_both_stages_are_counted_once():
    first = [record(i, "converged") for i in range(20)]
    first += [record(i, "time_limit") for i in range(20, 30)]
    first.append(record(30, "converged", apart=0.02, disturbed=0.5))  # shown to be undetermined
    first.append(record(31, "refused", possible=False))
    first.append(record(32, "stalled", method="paper"))
    first.append(record(33, "exception"))
    left = [r["index"] for r in first if is_left(r)]
    assert left == list(range(20, 30))
    order = drawn_again(SEED, left, 10)
    again = [record(index, "converged") for index in order[:4]]
    again += [record(order[4], "max_iterations", disturbed=2e-3), record(order[5], "stalled", disturbed=0.3)]
    again.append(record(order[7], "converged"))  # of an interrupted run: the one before it is missing
    assert strata(SEED, first, again, GROWTHS[0]) == Strata(20, 1, 10, 4, 1, 1)
    assert strata(SEED, first, again, GROWTHS[1]) == Strata(20, 1, 10, 4, 0, 2)


def test_a_third_stage_runs_those_that_failed_and_takes_the_place_of_the_second():
    again = [
        record(0, "converged"),
        record(1, "time_limit"),
        record(2, "stalled", disturbed=0.3),  # not determined
        record(3, "max_iterations"),
        record(4, "stalled", possible=False),  # shown to be impossible
    ]
    assert [r["index"] for r in again if has_failed(r)] == [1, 3]
    first = [record(index, "time_limit") for index in range(5)]
    drawn = [again[index] for index in drawn_again(SEED, range(5), 5)]
    assert strata(SEED, first, drawn, GROWTHS[0]) == Strata(0, 0, 5, 1, 2, 2)
    newer = in_place_of(drawn, [record(3, "converged"), record(1, "max_iterations")])
    assert [r["index"] for r in newer] == [r["index"] for r in drawn]
    assert strata(SEED, first, newer, GROWTHS[0]) == Strata(0, 0, 5, 2, 1, 2)


def test_a_march_in_place_of_a_least_squares_is_counted_with_the_others_and_apart():
    marched = {"method": "spacetime", "solved_by": "march"}
    first = [record(0, "converged"), record(1, "converged", **marched), record(2, "time_limit"), record(3, "stalled")]
    order = drawn_again(SEED, [2, 3], 2)
    again = [record(order[0], "converged", **marched), record(order[1], "converged", method="spacetime")]
    assert strata(SEED, first, again, GROWTHS[0]) == Strata(2, 0, 2, 2, 0, 0)
    assert strata(SEED, first, again, GROWTHS[0], as_asked=True) == Strata(1, 1, 2, 1, 1, 0)
    asked, both = in_the_end(SEED, first, again)[2], in_the_end(SEED, first, again)[0]
    assert asked.endswith("50.00%")
    assert ": 100.00%" in both
    of_six = {"seconds": 0.0, "families": ["numbers: odd"], "estimate": None, "asked": [9, 13], "n_u": 9, "n_t": 13}
    lines = summary([{**of_six, **r} for r in [*first, *again]]).splitlines()
    assert "converged, as asked: 2 of 6, 33.33%" in lines
    assert "converged, as asked or by a march in place of a least squares: 4 of 6, 66.67%" in lines


def test_before_there_was_that_last_resort_a_march_was_tried_by_the_judge():
    old = record(0, "max_iterations", method="spacetime", solved_by="spacetime", free="converged")
    assert by_a_march(old)
    assert not by_a_march({**old, "free": "stalled"})


def test_an_exception_counts_as_a_failure_that_no_time_mends():
    first = [record(0, "converged"), record(1, "exception"), record(2, "time_limit")]
    found = strata(SEED, first, [record(2, "converged")], GROWTHS[0])
    assert share(found)[0] == pytest.approx(2 / 3)


def test_growth_is_how_much_a_change_of_the_start_is_amplified():
    assert pytest.approx((1e4, 1e3)) == GROWTHS
    assert is_undetermined({"disturbed": 1.1e4 * DISTURBED})
    assert not is_undetermined({"disturbed": 0.9e4 * DISTURBED})
    assert is_undetermined({"disturbed": 1.1e3 * DISTURBED}, GROWTHS[1])
    assert not is_undetermined({"disturbed": None})


def test_what_never_may_happen_is_counted_by_kind():
    records = [
        record(0, "converged", faults=["lie", "strained"]),
        record(1, "hang", faults=["hang"]),
        record(2, "crash", faults=["crash"]),
        record(3, "exception", faults=["exception"], method="paper"),
    ]
    assert "lies: 1: 0" in counts(records)
    assert "hangs and crashes: 2: 1 2" in counts(records)
    assert "exceptions: 0" in counts(records[:3])


@pytest.mark.parametrize(
    ("more", "expected"),
    [
        ({}, []),
        ({"disturbed": 0.3}, ["undetermined and not told"]),
        ({"midway": 0.3}, ["undetermined and not told"]),
        ({"disturbed": 0.3, "estimate": 0.02}, ["undetermined and told: converged"]),
        ({"disturbed": 0.3, "message": "On it the scene does not determine its motion."},
         ["undetermined and told: converged"]),
        ({"disturbed": 0.3, "message": "Its mirror image is as likely."}, ["undetermined and told: converged"]),
        ({"disturbed": 0.3, "error": 0.5, "apart": 0.0}, ["undetermined and not told"]),
        ({"error": 0.5, "apart": 0.0}, ["lie"]),
        ({"error": 0.5, "apart": 0.0, "estimate": 0.3}, ["wrong and told"]),
        ({"error": 0.5, "apart": 0.0, "estimate": None}, ["lie"]),
        ({"error": 0.5, "apart": 0.0, "estimate": None, "message": f"Found. {TOO_LATE}"}, ["wrong and told"]),
        ({"error": 0.5, "apart": 0.4}, ["no reference and not told"]),
        ({"status": "stalled"}, ["not converged: stalled"]),
        ({"status": "stalled", "disturbed": 0.3}, ["undetermined and told: stalled"]),
    ],
)  # fmt: skip
def test_an_answer_that_is_one_of_several_has_to_say_so(more: dict[str, Any], expected: list[str]):
    laws = {"finite": True, "strain": 0.0, "held": 0.0, "held_between": 0.0, "energy": None, "momentum": None}
    answer = {"status": "converged", "possible": True, "message": "", "estimate": 1e-3, "length": 1.0, "laws": laws}
    assert faults({**answer, **more}) == expected


def test_grids_that_were_left_are_told_from_those_that_were_kept():
    assert left_its_grid({"asked": [9, 13], "n_u": 19, "n_t": 28})
    assert not left_its_grid({"asked": [9, 13], "n_u": 9, "n_t": 13})
    assert not left_its_grid({"asked": None, "n_u": 9, "n_t": 13})
