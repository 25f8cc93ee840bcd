"""Studies: what they measure, that they are read again, and what a comparison tells."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from dlocore import Cancelled, Quality, Scene, SceneError, predict
from dlocore.study import record, running
from dlocore.study.compare import compare, words
from dlocore.study.judge import finest_march, largest_error, step_by_step
from dlocore.study.plan import StudyPlan
from dlocore.study.record import EffectCost, Scaled, Study
from dlocore.study.running import run_study
from dlocore.study.scaling import effect_pairs, sizes
from dlocore.study.scenes import accuracy_scenes, hanging, paper_case
from dlocore.study.timing import Times, timed

GRIDS = ((9, 13), (13, 19), (17, 25))


@pytest.fixture(scope="module")
def measured() -> Study:
    """Two grasps on three grids by both methods, without twist and as chosen, with two thresholds."""
    scenes = {"at the end": paper_case(0.0), "at a quarter": paper_case(0.25)}
    sets = {"auto": {}, "no drag": {"drag": "off"}}
    return run_study(
        StudyPlan(scenes=scenes, grids=GRIDS, deltas=(1e-3, 1e-6), effects=sets, repeats=2, parts=("runs",))  # type: ignore[arg-type]
    )


def test_every_combination_is_measured_once(measured: Study) -> None:
    # a march has no threshold, so that it is measured for one of the two
    assert len(measured.runs) == 2 * 2 * len(GRIDS) * (1 + 2)
    assert len({run.key for run in measured.runs}) == len(measured.runs)
    assert all(run.repeats == 2 and run.wall_time > 0 and run.spread >= 0 for run in measured.runs)
    assert {("drag" in run.active) == (run.effects == "auto") for run in measured.runs} == {True}


def test_errors_are_those_of_the_predictions_and_fall_with_the_grid(measured: Study) -> None:
    scene = paper_case(0.25)
    truth = finest_march(scene)
    prediction = predict(replace(scene, quality=Quality(n_u=9, n_t=13, method="march", estimate=False)))
    run = next(r for r in measured.runs if r.key[:5] == ("at a quarter", "auto", "march", 9, 13))
    # both are computed alike; a solve does not depend on what was solved before
    assert run.error == pytest.approx(largest_error(prediction, truth), rel=1e-9)
    assert run.rms < run.error
    for name in ("at the end", "at a quarter"):
        errors = [r.error for r in measured.runs if r.key[:3] == (name, "auto", "march")]
        assert errors == sorted(errors, reverse=True)
        assert errors[0] > 3 * errors[-1]  # spacings halved, at least second order: a factor of 4, less a margin


def test_a_truth_moves_less_than_the_errors_it_judges() -> None:
    truth = finest_march(hanging())
    assert truth.status == "converged"
    assert truth.moved < 2e-5  # the length is 1 m, and it stops at 2e-5 of it
    finer = predict(replace(hanging(), quality=Quality(n_u=129, n_t=385, method="march", estimate=False)))
    assert largest_error(finer, truth) < 5 * truth.moved  # what is left falls at least by half with each refinement


def test_the_independent_judge_agrees_with_the_march_within_both_errors() -> None:
    march, reference = finest_march(paper_case(0.25)), step_by_step(paper_case(0.25))
    assert reference.status == "converged"
    assert 0 < reference.moved <= 2e-4  # the tolerance, of a length of 1 m
    apart = float(np.linalg.norm(march.positions - reference.positions, axis=-1).max())
    assert 1e-9 < apart < 2 * (reference.moved + march.moved)  # both are estimates; the same numbers would be no judge


def test_a_smaller_threshold_takes_more_iterations_down_to_it(measured: Study) -> None:
    for loose, tight in zip(
        [r for r in measured.runs if r.method == "spacetime" and r.delta == 1e-3],
        [r for r in measured.runs if r.method == "spacetime" and r.delta == 1e-6],
        strict=True,
    ):
        assert loose.key[:5] == tight.key[:5]
        assert len(loose.iterations) <= len(tight.iterations)
        last = tight.iterations[-1].update
        assert last is not None
        assert tight.status != "converged" or last < 1e-6


def test_a_study_is_read_as_it_was_written(measured: Study, tmp_path: Path) -> None:
    whole = replace(
        measured,
        scaling=(Scaled(variable="n_u", value=9.0, method="march", wall_time=1e-3, spread=1e-5),),
        effects=(EffectCost(effect="drag", present=2e-3, absent=1e-3),),
    )
    (tmp_path / "study.json").write_bytes(record.as_json(whole))
    assert record.load(tmp_path / "study.json") == whole


NO_STUDIES = ["", "[]", "{}", '{"format": 7}', '{"format": 1, "runs": 3}', '{"format": ' + "[" * 100_000]


@pytest.mark.parametrize("text", NO_STUDIES, ids=lambda text: text[:30])
def test_what_is_no_study_is_refused_in_words(text: str, tmp_path: Path) -> None:
    (tmp_path / "no.json").write_text(text)
    with pytest.raises(record.StudyError, match=r"not a study|not JSON|Allowed") as refused:
        record.load(tmp_path / "no.json")
    assert "indices" not in str(refused.value)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("wall_time", "fast"),
        ("wall_time", None),
        ("wall_time", 0.0),
        ("error", True),
        ("error", -1e-3),
        ("truth_error", -1e-3),
        ("n_u", 9.5),
        ("status", 1),
    ],
)
def test_a_run_of_a_study_with_a_wrong_value_is_refused_by_its_name(measured: Study, name: str, value: object) -> None:
    document = json.loads(record.as_json(measured))
    document["runs"][0] = {**document["runs"][0], name: value}
    with pytest.raises(record.StudyError, match=f"{name}: got {value!r}. Allowed: "):
        record.from_document(document)


def test_a_study_without_a_machine_is_refused(measured: Study) -> None:
    with pytest.raises(record.StudyError, match="not a study"):
        record.from_document({**record.to_document(measured), "machine": None})


def changed(study: Study, **by: float) -> Study:
    runs = tuple(
        replace(run, wall_time=by.get("time", 1.0) * run.wall_time, error=by.get("error", 1.0) * run.error)
        for run in study.runs
    )
    return replace(study, runs=runs)


def test_a_study_compared_with_itself_shows_no_change(measured: Study) -> None:
    comparison = compare(measured, measured)
    assert comparison.compared == len(measured.runs)
    assert comparison.changes == ()


def test_slower_and_less_accurate_runs_are_told_and_noise_is_not(measured: Study) -> None:
    often = tuple(replace(run, repeats=5) for run in measured.runs)
    sharp = replace(measured, runs=tuple(replace(run, spread=0.001 * run.wall_time) for run in often))
    slower = compare(changed(sharp, time=1.3), sharp)
    assert len(slower.worse) == len(sharp.runs)
    assert all(change.quantity == "time" for change in slower.worse)
    assert "1.30 x" in words(slower)
    faster = compare(sharp, changed(sharp, time=1.3))
    assert not faster.worse
    assert len(faster.changes) == len(sharp.runs)
    assert compare(changed(sharp, time=1.1), sharp).changes == (), "within what two measurements differ by"
    blurred = replace(measured, runs=tuple(replace(run, spread=0.1 * run.wall_time) for run in often))
    assert compare(changed(blurred, time=1.3), blurred).changes == (), "within the spread"
    worse = compare(changed(sharp, error=1.5), sharp).worse
    # but where the truth itself is too uncertain to tell
    assert len(worse) == sum(0.5 * run.error > 2 * (run.truth_error or 0.0) for run in sharp.runs) > 0
    unsure = replace(sharp, runs=tuple(replace(run, truth_error=None) for run in sharp.runs))
    assert compare(changed(unsure, error=1.5), unsure).changes == ()
    assert {change.quantity for change in worse} == {"error"}
    lost = replace(sharp, runs=tuple(replace(run, status="stalled") for run in sharp.runs))
    assert {change.quantity for change in compare(lost, sharp).worse} == {"status"}


def test_times_of_few_repeats_are_not_compared_but_errors_are(measured: Study) -> None:
    once = replace(measured, runs=tuple(replace(run, repeats=1, spread=0.0) for run in measured.runs))
    often = replace(once, runs=tuple(replace(run, repeats=5) for run in once.runs))
    for now, before in ((changed(once, time=1.8), often), (changed(often, time=1.8), once)):
        comparison = compare(now, before)
        assert comparison.changes == ()
        assert f"times of {len(once.runs)} runs are not compared: fewer than 3 repeats" in words(comparison)
    assert "not compared" not in words(compare(often, often))
    assert {change.quantity for change in compare(changed(once, time=1.8, error=2.0), often).worse} == {"error"}


def test_times_of_another_machine_are_not_compared(measured: Study) -> None:
    elsewhere = replace(changed(measured, time=9.0), machine={**measured.machine, "processor": "another"})
    comparison = compare(elsewhere, measured)
    assert not comparison.same_machine
    assert comparison.changes == ()
    assert "different machines" in words(comparison)


def test_a_grid_without_room_is_noted_and_the_rest_is_measured() -> None:
    grasps = paper_case(0.25).grasps
    crowded = replace(paper_case(0.25), grasps=tuple(replace(grasps[0], u=u) for u in (0.2, 0.3, 0.4, 0.5, 0.6)))
    study = run_study(
        StudyPlan(
            scenes={"crowded": crowded}, grids=((7, 13), (17, 25)), methods=("march",), repeats=1, parts=("runs",)
        )
    )
    assert [(run.n_u, run.n_t) for run in study.runs] == [(17, 25)]
    assert len(study.refused) == 1
    assert "quality.n_u" in study.refused[0]


@pytest.mark.parametrize(
    ("asked", "field"),
    [
        ({"repeats": 0}, "repeats"),
        ({"repeats": 1000}, "repeats"),
        ({"grids": ((3, 13),)}, "grids"),
        ({"grids": ()}, "grids"),
        ({"deltas": (1.0,)}, "deltas"),
        ({"methods": ("guess",)}, "methods"),
        ({"effects": {"odd": {"wind": "on"}}}, "effects"),
        ({"effects": {"odd": {"drag": "maybe"}}}, "effects.drag"),
        ({"effects": {"odd": {"stretch": "off"}}}, "effects.stretch"),
        ({"parts": ("all",)}, "parts"),
        ({"judge": "me"}, "judge"),
        ({"grids": ((9, 13), (9, 13))}, "grids"),
        ({"methods": ("march", "march")}, "methods"),
        ({"methods": ("march",), "deltas": (1e-5, 1e-6)}, "deltas"),
        ({"grids": tuple((n, 13) for n in range(5, 129)), "deltas": tuple(np.geomspace(1e-9, 1e-3, 20))}, "scenes"),
    ],
)
def test_what_is_not_allowed_is_named(asked: dict[str, object], field: str) -> None:
    with pytest.raises(SceneError) as caught:
        StudyPlan(**asked)  # type: ignore[arg-type]
    assert caught.value.field == field


def test_every_part_and_every_refusal_is_named_differently(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(scene: Scene, **options: object) -> None:
        raise SceneError("quality.n_u", 9, "more")

    monkeypatch.setattr("dlocore.study.running.predict", refuse)
    monkeypatch.setattr("dlocore.study.running.finest_march", lambda scene, **options: None)
    sets = {"auto": {}, "no drag": {"drag": "off"}}
    news: list[str] = []
    study = run_study(
        StudyPlan(scenes={"a": paper_case(0.0)}, grids=GRIDS[:1], deltas=(1e-3, 1e-6), effects=sets, parts=("runs",)),  # type: ignore[arg-type]
        on_progress=lambda done, total, what: news.append(what),
    )
    assert len(set(news)) == len(news) == 1 + 2 * (1 + 3) + 1
    assert len(set(study.refused)) == 2 * 3
    assert study.refused[-1].startswith("a, effects no drag: spacetime, 9 x 13, delta 1e-06: quality.n_u")


def test_a_study_stops_when_asked() -> None:
    news: list[int] = []
    with pytest.raises(Cancelled):
        run_study(
            StudyPlan(parts=("runs",)),
            on_progress=lambda done, total, what: news.append(done),
            cancelled=lambda: len(news) >= 2,
        )
    assert len(news) == 2


def test_sizes_and_effects_are_solvable_and_differ_in_what_they_say() -> None:
    least_and_most = {}
    for size in sizes():
        key = (size.variable, size.scene.quality.method)
        least_and_most[key] = (least_and_most.get(key, (size,))[0], size)
    assert len(least_and_most) == 10
    for least, most in least_and_most.values():
        assert least.value < most.value
        assert predict(least.scene).status == "converged", least
        march = replace(most.scene, quality=replace(most.scene.quality, method="march"))
        assert predict(march).status == "converged", most
    for effect, present, absent in effect_pairs():
        made = [{e.name for e in predict(scene).effects if e.active} for scene in (present, absent)]
        assert effect in made[0], effect
        assert effect not in made[1], effect


def test_the_first_call_is_not_counted_and_patience_ends_the_repeats() -> None:
    calls: list[int] = []
    answer, times = timed(lambda: calls.append(1) or len(calls), 4)
    assert answer == 5
    assert times.repeats == 4
    calls.clear()
    assert timed(lambda: calls.append(1), 50, patience=0.0)[1].repeats == 1


def test_the_standard_scenes_move_in_the_plane_and_in_space() -> None:
    quality = Quality(n_u=9, n_t=13, method="march", estimate=False)
    found = [predict(replace(s, quality=quality)).accuracy.dimensions for s in accuracy_scenes().values()]
    assert found == [2, 2, 2, 2, 3]


def test_a_size_whose_time_is_drowned_by_noise_is_told_of(monkeypatch: pytest.MonkeyPatch) -> None:
    chosen = [size for size in sizes() if size.variable == "n_u" and size.value in (9, 13)]
    monkeypatch.setattr(running, "sizes", lambda: chosen)
    times = iter([2e-3, 2e-3, 1.9e-3, 4e-3])  # the marches, then the solves that begin with them
    solved = SimpleNamespace(iterations=[None, None])
    monkeypatch.setattr(running._Measuring, "_solved", lambda *_: (solved, Times(next(times), 1e-5, 5)))
    found = run_study(StudyPlan(parts=("scaling",)))
    assert [(row.method, row.value) for row in found.scaling] == [("march", 9), ("march", 13), ("spacetime", 13)]
    assert found.scaling[-1].wall_time == pytest.approx(1e-3)
    (told,) = found.refused
    assert told.startswith("cost against n_u = 9: spacetime took 1.9 ms, not above the 2 ms of the march")
