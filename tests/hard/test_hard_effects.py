"""Effects that jump: each case of benchmarks/hard/cases/effects.py has its true answer and keeps the laws."""

import pytest

from tests.hard.checks import hold_to, of_group


@pytest.mark.parametrize("case", of_group("effects"))
def test_case_has_its_true_answer_and_keeps_the_laws(case):
    hold_to(case)
