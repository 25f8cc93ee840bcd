"""The scenes of the catalogue do what they are named for."""

from dataclasses import replace

import pytest

from benchmarks.catalogue import catalogue, premises
from dlocore import Quality, predict


@pytest.mark.parametrize("name", premises())
def test_a_scene_does_what_it_is_named_for(name: str):
    quick = Quality(n_u=25, n_t=61, method="march", estimate=False)
    prediction = predict(replace(catalogue()[name], quality=quick))
    assert all(premise(prediction) for premise in premises()[name])
