"""Hard grids and thresholds: each case of benchmarks/hard/cases/numbers.py has its true answer and keeps the laws."""

from dataclasses import replace

import pytest

from benchmarks.hard.cases import CASES, posed
from dlocore import SceneError, predict
from tests.hard.checks import hold_to, of_group


@pytest.mark.parametrize("case", of_group("numbers"))
def test_case_has_its_true_answer_and_keeps_the_laws(case):
    hold_to(case)


@pytest.mark.parametrize("name", ["too few in time for a release", "too few along for the grasps"])
def test_the_least_that_a_refusal_names_will_do(name):
    scene = posed(CASES[name])
    with pytest.raises(SceneError, match="at least") as refused:
        predict(scene)
    axis, least = refused.value.field.removeprefix("quality."), int(refused.value.allowed.split()[2])
    predict(replace(scene, quality=replace(scene.quality, **{axis: least})))
    with pytest.raises(SceneError):
        predict(replace(scene, quality=replace(scene.quality, **{axis: least - 1})))
