"""The predictions that are remembered take the memory that they may."""

from dataclasses import replace

import numpy as np
import pytest

from app.schemas import PredictionRequest, from_prediction, to_scene
from app.store.recent import Recent, size_of
from dlocore import Prediction, predict
from tests.app.conftest import paper_scene


@pytest.fixture(scope="module")
def prediction() -> Prediction:
    return predict(to_scene(PredictionRequest.model_validate(paper_scene()), lambda id: None))


def test_all_that_a_prediction_holds_is_counted(prediction: Prediction) -> None:
    level = prediction.level
    assert level is not None
    parts = [level, *level.beside]
    assert len(parts) > 1
    shown = [iteration.surface.control_points for iteration in prediction.iterations]
    arrays = [*shown, *(array for part in parts for array in (part.control, part.motion.states, part.motion.log))]
    assert size_of(prediction) > sum({id(array): array.nbytes for array in arrays}.values()) + 30_000  # of its objects
    assert size_of(replace(prediction, judged=prediction)) < size_of(prediction) + 2_000  # what is shared counts once


def test_an_array_counts_once_wherever_its_memory_is(prediction: Prediction) -> None:
    large = np.zeros(1_000_000)
    found = size_of(replace(prediction, report_material=lambda: large[:2].sum() + large[2:].sum()))
    assert large.nbytes < found < large.nbytes + size_of(prediction) + 2_000


def test_what_is_read_later_does_not_spoil_the_count(prediction: Prediction) -> None:
    fresh, recent = replace(prediction), Recent()
    recent.add("a", fresh)
    from_prediction(fresh, "a")
    recent.forget("a")
    assert recent._bytes == 0
