"""How well parameters are known, in words and numbers."""

import numpy as np
import pytest

from dlocore.identify.intervals import _estimated
from dlocore.identify.parameters import parameters
from dlocore.identify.replay import Resolution
from dlocore.identify.search import Search


@pytest.mark.parametrize(
    ("name", "value", "deviation", "said"),
    [
        ("bending_stiffness", 4e-3, 0.004, "bending_stiffness = 0.004 N m^2, known to 0.8 %."),
        ("length_ratio", 1.02, 0.002, "length_ratio = 1.02, known to 0.4 %."),
        ("drag", 0.05, 0.1, "drag = 0.05 N s/m^2, known to 20 %."),
        ("drag", 0.002, 0.01, "drag = 0.002 N s/m^2, known to 50 %."),
        ("turn", 0.5, 0.02, "turn = 0.5 rad, known to 0.04 rad."),
        ("turn", -0.5, 0.02, "turn = -0.5 rad, known to 0.04 rad."),
    ],
)
def test_a_statement_tells_half_the_interval(name: str, value: float, deviation: float, said: str) -> None:
    (p,) = parameters((name,), 2)
    search = Search((), (p,), Resolution())
    # two deviations of a logarithm, or of a usual value (0.05 N s/m^2 of drag, 1 rad of turn)
    found = _estimated(p, p.coordinate(value), deviation, 2.0, 1.0, search, np.zeros(0))
    assert found.statement == said
