"""Random hard scenes on small grids: no exception, no NaN, no broken law, and a status that tells the truth."""

from collections import Counter

import pytest

from benchmarks.hard.generator import IMPOSSIBLE, SPLINED, draw
from benchmarks.hard.judge import run
from benchmarks.random_reference import PATIENT, WRONG
from benchmarks.random_reference import compare as compare_with_reference
from dlocore import ControlPoints

SEED = 2
COUNT = 300
BATCH = 30
DEADLINE = 1.0  # [s]: an answer that is cut off, one in eight, has a status too
# Faults of those that end in time, at deadlines from 0.4 to 20 s (docs/stability.md). A mend takes a scene off its
# list, and none may come to it.
KNOWN = {
    "spline off a gripper's path": {26, 42, 113, 221},  # by 1e-4 to 1e-3 L: beside a release, and noisy waypoints
    "gained energy": {281},  # 3.5 % of what is about, at an estimated error of 0.4 % of the length
    "lost momentum": {285},  # 6 %: a heavily damped hairpin, moved fast, on 19 control points in time
    "not converged: stalled": {62, 206},  # one folds on every grid, one does not determine its motion
}
CUT_OFF = ("time limit passed", "time was up")
PATIENCE = 15.0  # [s]: for scenes that have to converge


@pytest.mark.parametrize("first", range(0, COUNT, BATCH))
def test_random_scene_ends_with_a_finite_answer_or_is_refused_for_a_reason(first: int):
    for index in range(first, first + BATCH):
        drawn = draw(SEED, index, small=True)
        record = run(drawn, DEADLINE, False, measured="checked")
        assert record["status"] != "exception", (index, record["message"])
        if record["status"] == "refused" and record["field"] == "shape.settle":
            continue  # a start that did not come to rest is refused in words; docs/stability.md counts them
        if drawn.possible:
            assert record["status"] != "refused", (index, record["message"])
            assert record["laws"]["finite"], index
            if record["status"] == "converged":  # else the surface stands still from where the march ended
                assert record["laws"]["held"] < 1e-9 * record["length"], index  # interpolated: rounding
            told = record["estimate"] is not None or "its error" in record["message"].lower()
            assert record["status"] != "converged" or told, (index, record["message"])
        else:
            assert record["status"] != "converged", (index, record["families"])
        if record["wall"] > DEADLINE or any(words in record["message"].lower() for words in CUT_OFF):
            continue  # maybe on the grid that is given, however coarse it is: what it shows depends on the machine
        for fault in record["faults"]:
            if fault == "strained" and record["laws"]["strain"] < (record["estimate"] or 0.0) * record["n_u"]:
                continue  # an end of a span that errs by the estimated error strains the span by that much
            assert index in KNOWN.get(fault, ()), (index, fault, record["message"])


def test_of_the_random_scenes_that_end_in_time_99_of_100_converge():
    """Those that do not are on the list, or the test above fails."""
    failing = set().union(*(KNOWN[fault] for fault in KNOWN if fault.startswith("not converged")))
    assert len(failing) <= 0.01 * COUNT * (1.0 - IMPOSSIBLE)


def test_smooth_starts_by_control_points_end_with_a_finite_answer():
    drawn = [one for one in (draw(SPLINED, index, small=True) for index in range(12)) if one.possible]
    splined = [one for one in drawn if isinstance(one.make().shape, ControlPoints)]
    assert len(splined) > len(drawn) // 3
    for one in splined:
        record = run(one, DEADLINE, False, measured="checked")
        assert record["status"] not in ("exception", "refused"), (one.index, record["message"])
        assert record["laws"]["finite"], one.index


@pytest.mark.parametrize(("seed", "index"), [(2, 125), (3, 28), (10, 783)])
def test_a_cable_pushed_exactly_along_itself_buckles(seed, index):
    record = run(draw(seed, index), PATIENCE, False)
    assert record["status"] == "converged", record["message"]
    assert record["faults"] == []


def test_a_scene_is_drawn_from_its_seed_and_index_alone():
    alone, after = draw(5, 17), [draw(5, index) for index in range(18)][17]
    assert alone.families == after.families
    assert repr(alone.make()) == repr(after.make())
    assert repr(draw(6, 17).make()) != repr(alone.make())


def test_every_kind_of_hardness_is_drawn_often():
    families = Counter(family for index in range(300) for family in draw(3, index).families)
    for group in ("geometry", "stiffness", "motion", "effects", "numbers", "impossible"):
        kinds = {family: count for family, count in families.items() if family.startswith(group)}
        assert len(kinds) >= 6, kinds
    assert sum(count for family, count in families.items() if family.startswith("impossible")) > 300 * IMPOSSIBLE / 2


# Scenes that had ended up to 0.8 of the length from the reference, and not said so: starts that settle on something
# rough (58, 133, 319, 366), drag on the spin of the sections (64), and the reference's own starts, which yielded (290).
@pytest.mark.parametrize("index", [58, 64, 133, 290, 319, 366])
def test_scenes_that_were_elsewhere_are_where_the_reference_takes_them(index: int) -> None:
    found = compare_with_reference(20, index, PATIENT)
    assert found is not None
    assert found.is_told
    assert found.apart <= WRONG
