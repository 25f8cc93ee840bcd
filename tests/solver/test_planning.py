"""What a plan expects of a solve before it is done, and what it refuses."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from dlocore import (
    Cable,
    Environment,
    Grasp,
    Move,
    Quality,
    Scene,
    SceneError,
    Sphere,
    Straight,
    Table,
    plan,
    predict,
)

PATH = Move(displacement=(0.0, 0.3, 0.0), duration=1.0)
BALL = Sphere(center=(0.6, 0.15, 0.0), radius=0.05)
RESTS_LONG = Cable.preset("paper", rest_shape=np.linspace((0.0, 0.0), (17.0, 0.0), 50))


def scene(*obstacles: Sphere, friction: float = 0.0, release: float | None = None) -> Scene:
    return Scene(
        cable=Cable.preset("paper"),
        shape=Straight(),
        grasps=(Grasp(u=0.3, path=PATH), Grasp(u=0.9, path=PATH, release_time=release)),
        environment=Environment(drag=0.1, table=Table(friction=friction), obstacles=obstacles),
        quality=Quality(n_u=17, n_t=33),
    )


def test_what_makes_steps_harder_is_expected_to_take_longer() -> None:
    plain = plan(scene(release=None)).expected_time
    assert plan(scene(friction=0.3)).expected_time > 1.2 * plain
    assert plan(scene(BALL)).expected_time > 3.0 * plain
    assert plan(scene(release=0.5)).expected_time > 1.5 * plain
    meets = replace(scene(), effects={"self_contact": "on"})
    assert plan(meets).expected_time > 10.0 * plain


def test_a_free_grid_is_expected_to_take_longer_than_its_first_two() -> None:
    free = plan(replace(scene(), quality=Quality()))
    given = plan(replace(scene(), quality=Quality(n_u=free.n_u, n_t=free.n_t)))
    assert free.expected_time > 2.0 * given.expected_time


def test_no_more_is_expected_than_a_time_budget_allows() -> None:
    assert plan(replace(scene(BALL), quality=Quality())).expected_time > 2e-3
    assert plan(replace(scene(BALL), quality=Quality(time_budget=2e-3))).expected_time == 2e-3


@pytest.mark.parametrize(("n_u", "n_t"), [(5, 33), (17, 5)])
def test_a_grid_that_is_too_small_is_refused_in_the_words_of_the_prediction(n_u: int, n_t: int) -> None:
    small = replace(scene(release=0.5), quality=Quality(n_u=n_u, n_t=n_t))
    with pytest.raises(SceneError) as planned:
        plan(small)
    with pytest.raises(SceneError) as predicted:
        predict(small)
    assert str(planned.value) == str(predicted.value)


@pytest.mark.parametrize(
    "change",
    [
        pytest.param({"cable": RESTS_LONG}, id="rests too long"),
        pytest.param({"cable": RESTS_LONG, "quality": Quality(method="reference")}, id="for the reference, too"),
        pytest.param({"quality": Quality(n_u=65, n_t=65, method="paper")}, id="too large for the paper"),
        pytest.param({"effects": {"inertia": "off"}, "quality": Quality(method="reference")}, id="no reference"),
    ],
)
def test_what_a_method_can_not_solve_is_refused_in_the_words_of_the_prediction(change: dict[str, Any]) -> None:
    impossible = replace(scene(), **change)
    with pytest.raises(SceneError) as planned:
        plan(impossible)
    with pytest.raises(SceneError) as predicted:
        predict(impossible)
    assert str(planned.value) == str(predicted.value)


def test_a_jump_inside_is_refused_for_the_paper_before_it_is_solved() -> None:
    with pytest.raises(SceneError, match="one smooth motion"):
        plan(replace(scene(release=0.5), quality=Quality(n_u=17, n_t=33, method="paper")))
