"""Lengths, times and counts as messages write them."""

from dataclasses import replace

import pytest

from dlocore import Quality, predict, sensitivities
from dlocore.words import counted, in_mm, in_ms, in_newtons, in_um
from tests.solver.scenes import paper_scene


@pytest.mark.parametrize(
    ("length", "digits", "words"),
    [
        (0.58, 2, "580 mm"),
        (0.0997, 2, "100 mm"),
        (0.0993, 2, "99 mm"),
        (12.3456, 3, "12346 mm"),
        (5e-3, 3, "5 mm"),
        (1.234e-3, 2, "1.2 mm"),
        (3.7e-8, 2, "3.7e-05 mm"),
        (0.0, 2, "0 mm"),
        (float("inf"), 2, "inf mm"),
    ],
)
def test_a_length_has_its_digits_and_no_exponent_where_it_is_long(length: float, digits: int, words: str) -> None:
    assert in_mm(length, digits) == words


def test_forces_times_short_lengths_and_counts():
    assert [in_newtons(force) for force in (263.7, 61254.7, 0.0574, 2.0)] == ["264 N", "61255 N", "0.057 N", "2 N"]
    assert [in_ms(time) for time in (2.0, 1.2345, 0.0123, 4e-7)] == ["2000 ms", "1234 ms", "12.3 ms", "0.0004 ms"]
    assert [in_um(length) for length in (1e-6, 1e-3, 1.234e-5)] == ["1 um", "1000 um", "12 um"]
    assert [counted(count, "iteration") for count in (0, 1, 2)] == ["0 iterations", "1 iteration", "2 iterations"]


def test_what_is_shown_of_an_answer_is_a_line():
    found = predict(replace(paper_scene(0.25), quality=Quality()))
    shown = repr(found)
    assert shown.startswith("<Prediction: converged by march on 13 x 19 control points, estimated error ")
    assert shown.endswith(" ms>")
    assert repr(found.surface) == "<SplineSurface: 13 x 19 control points, 1 m, 1.6 s>"
    by = sensitivities(found, ["cable.bending_stiffness", "environment.drag"])
    assert repr(by) == "<Sensitivities by cable.bending_stiffness, environment.drag>"
    guessed = predict(replace(paper_scene(0.25), quality=Quality(n_u=9, n_t=13, estimate=False)))
    assert "estimated error not known" in repr(guessed)
