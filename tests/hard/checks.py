"""What every hard case is held to: its name, its true answer, its laws, and a status that tells the truth."""

import pytest

from benchmarks.hard.cases import CASES, Case, posed
from benchmarks.hard.laws import measure
from dlocore import Prediction, SceneError, predict

STRAIN = 0.02  # the cases are built so that weight and inertia strain them by less than 0.5 per cent
HELD = 1e-9  # of the length: the ends of a hold are interpolated, so that only rounding is left
GAIN = 0.02  # of the energy that was about: the velocities of the time spline, and trapezoids of the power
LOST = 0.05  # of the impulses that were about: the same


def of_group(group: str) -> list[object]:
    """Return the cases of a group as parameters of a test."""
    return [pytest.param(case, id=case.name) for case in CASES.values() if case.group == group]


def hold_to(case: Case) -> None:
    """Solve a case and hold the answer to its name and its truth, or expect that it is refused by that field."""
    if case.refused:
        with pytest.raises(SceneError) as refused:
            predict(posed(case))
        assert refused.value.field == case.refused
        return
    prediction = predict(posed(case))
    asked = prediction.scene.quality.method
    assert asked in ("auto", prediction.accuracy.method)  # a march in place of a least squares is none
    assert prediction.status == "converged", prediction.message
    keep_laws(prediction)
    assert case.premise is None or case.premise(prediction), "it does not do what it is named for"
    if case.error is not None:
        assert case.error(prediction) <= case.within


def keep_laws(prediction: Prediction) -> None:
    """Assert that a motion keeps the laws that its answer can be held to."""
    found = measure(prediction)
    assert found.finite
    assert found.strain < STRAIN
    assert found.held < HELD * prediction.surface.length
    assert found.energy is None or found.energy < GAIN
    assert found.momentum is None or found.momentum < LOST
