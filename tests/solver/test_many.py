"""predict_many: each scene as predict would, whatever runs beside it."""

import gc
import threading
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from benchmarks.hard.generator import draw
from dlocore import (
    Cable,
    Cancelled,
    Environment,
    Grasp,
    Move,
    Points,
    Prediction,
    Quality,
    Scene,
    SceneError,
    Straight,
    Table,
    predict,
    predict_many,
)

COARSE = Quality(n_u=9, n_t=13, method="march", keep_grid=True)


def scene(u: float, quality: Quality = COARSE, displacement: tuple[float, float, float] = (0.0, 0.4, 0.0)) -> Scene:
    return Scene(
        cable=Cable(length=1.0, diameter=0.005, linear_density=0.05, bending_stiffness=1e-3),
        shape=Straight(),
        grasps=(Grasp(u=u, path=Move(displacement=displacement, duration=1.6)),),
        environment=Environment(drag=0.05, table=Table()),
        quality=quality,
    )


def hanging(u: float) -> Scene:
    arc = np.linspace(0.0, 1.0, 9)[:, None] * [1.0, 0.0, 0.0]
    lift = Grasp(u=u, path=Move(displacement=(-0.02, 0.02, 0.01), duration=0.4))
    return Scene(cable=Cable.preset("paper"), shape=Points(points=arc), grasps=(lift, Grasp(u=0.0)), quality=COARSE)


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_each_is_bit_for_bit_what_predict_gives(threads: int):
    scenes = [make(u) for u in (0.1, 0.35, 0.6, 0.85, 1.0) for make in (scene, hanging)]
    scenes.append(scene(0.5, Quality()))
    together = predict_many(scenes, threads=threads)
    assert len(together) == len(scenes)
    for given, one in zip(scenes, together, strict=True):
        assert isinstance(one, Prediction)
        assert one.scene is given
        alone = predict(given)
        assert np.array_equal(one.surface.control_points, alone.surface.control_points)
        assert one.accuracy.error_estimate == alone.accuracy.error_estimate
        assert (one.status, one.message) == (alone.status, alone.message)


def test_solves_on_one_grid_leave_each_other_alone():
    arc = np.column_stack([np.linspace(0.0, 0.72, 9), np.zeros(9), -0.28 * np.sin(np.linspace(0.0, np.pi, 9))])
    quality = Quality(n_u=9, n_t=13, method="spacetime", estimate=False)

    def clamped(turn: float) -> Scene:
        turned = Move(displacement=(-0.05, 0.02, 0.0), rotation=(turn, 0.0, 0.0), duration=1.0)
        grasps = (Grasp(u=0.0, hold="clamp"), Grasp(u=1.0, hold="clamp", path=turned))
        environment = Environment(drag=0.1)
        return Scene(
            cable=Cable.preset("paper"), shape=Points(points=arc, settle=True), grasps=grasps, environment=environment,
            quality=quality,
        )  # fmt: skip

    first = predict(clamped(0.1))
    assert first.accuracy.dimensions == 3
    scenes = [clamped(0.1 + 1e-3 * k) for k in range(24)]
    for given, one in zip(scenes, predict_many(scenes, like=first, threads=4), strict=True):
        assert isinstance(one, Prediction)
        alone = predict(given, like=first)
        assert "from the beginning" not in alone.message
        assert np.array_equal(one.surface.control_points, alone.surface.control_points)


@pytest.mark.parametrize("threads", [1, 3, 64])
def test_each_answer_is_in_the_place_of_its_scene(threads: int):
    scenes = [scene(u) for u in np.linspace(0.0, 1.0, 50)]
    together = predict_many(iter(scenes), threads=threads)
    assert [one.scene for one in together if isinstance(one, Prediction)] == scenes


def test_an_impossible_scene_has_its_error_in_its_place_and_spoils_no_other():
    taut = Scene(
        cable=Cable.preset("paper"), shape=Straight(),
        grasps=(Grasp(u=0.0), Grasp(u=1.0, path=Move(displacement=(0.5, 0.0, 0.0), duration=1.0))), quality=COARSE,
    )  # fmt: skip
    first, second, third = predict_many([scene(0.2), taut, scene(0.8)], threads=2)
    assert isinstance(first, Prediction)
    assert isinstance(third, Prediction)
    assert isinstance(second, SceneError)
    with pytest.raises(SceneError) as alone:
        predict(taut)
    assert str(second) == str(alone.value)


def test_no_scenes_give_no_predictions():
    assert predict_many([]) == []
    assert predict_many(iter([])) == []


@pytest.mark.parametrize("threads", [0, -1, 2.5, float("nan"), "2", True, 10**9])
def test_a_wrong_number_of_threads_is_refused_by_name(threads: object):
    with pytest.raises(SceneError) as error:
        predict_many([scene(0.2)], threads=threads)  # type: ignore[arg-type]
    assert error.value.field == "threads"


@pytest.mark.parametrize("wrong", [{"deadline": -1}, {"keep_grid": "x"}, {"like": 3}])
def test_an_option_that_no_solve_takes_is_refused_once(wrong: dict[str, Any]) -> None:
    with pytest.raises(SceneError) as of_one:
        predict(scene(0.2), **wrong)
    with pytest.raises(SceneError) as of_all:
        predict_many([scene(0.2)] * 2, **wrong)
    assert str(of_all.value) == str(of_one.value)
    assert [of_all.value.field] == list(wrong)


@pytest.mark.parametrize("threads", [1, 3])
def test_cancelling_stops_all(threads: int):
    asked: Callable[[], bool] = lambda: True  # noqa: E731
    with pytest.raises(Cancelled):
        predict_many([scene(0.2)] * 6, threads=threads, cancelled=asked)
    names = [thread.name for thread in threading.enumerate()]
    assert not [name for name in names if name.startswith("dlo-predict")]


def test_what_goes_wrong_in_one_solve_is_what_the_caller_sees():
    def broken() -> bool:
        raise ZeroDivisionError("from the caller's own function")

    with pytest.raises(ZeroDivisionError):
        predict_many([scene(0.2)] * 6, threads=3, cancelled=broken)


def test_a_deadline_is_that_of_each_scene():
    late = predict_many([scene(0.2, Quality(target_error=1e-6))] * 3, threads=2, deadline=0.02)
    for one in late:
        assert isinstance(one, Prediction)
        assert one.status == "time_limit"


def test_grids_are_kept_where_that_is_asked_for():
    given = draw(8, 277).make()  # a time spline of 10 control points can't show its motion
    left, kept = (predict_many([given], keep_grid=keep)[0] for keep in (False, True))
    assert isinstance(left, Prediction)
    assert isinstance(kept, Prediction)
    assert kept.accuracy.n_t == given.quality.n_t < left.accuracy.n_t
    assert kept.status != left.status == "converged"


def test_old_garbage_waits_for_the_last_of_the_batches_under_way():
    before = gc.get_threshold()
    seen: list[tuple[int, int, int]] = []

    def watched() -> bool:
        seen.append(gc.get_threshold())
        if len(seen) == 1:
            predict_many([scene(0.5)], threads=1)  # a batch within the batch
            seen.append(gc.get_threshold())
        return False

    predict_many([scene(0.2), scene(0.4)], threads=1, cancelled=watched)
    assert len(seen) > 2
    assert all(x[:2] == before[:2] and x[2] > 1_000_000 for x in seen)
    assert gc.get_threshold() == before
    with pytest.raises(Cancelled):
        predict_many([scene(0.2)], cancelled=lambda: True)
    assert gc.get_threshold() == before


def found_garbage():
    """Return the kinds of the solver's own objects that only a search for garbage finds; others' are not looked at."""
    gc.set_debug(gc.DEBUG_SAVEALL)
    try:
        gc.collect()
        return {type(x).__name__ for x in gc.garbage if type(x).__module__.startswith("dlocore")}
    finally:
        gc.set_debug(0)
        gc.garbage.clear()


def test_predictions_make_no_garbage_that_only_a_search_finds():
    gc.collect()
    answers = predict_many([scene(u) for u in (0.1, 0.3, 0.7)] + [hanging(0.9)], threads=1)
    assert not found_garbage()
    del answers
    assert not found_garbage()


@pytest.mark.parametrize("scenes", [None, scene(0.2)], ids=["None", "one scene"])
def test_what_is_no_list_of_scenes_is_refused_by_name(scenes):
    with pytest.raises(SceneError, match=r"scenes: got .*Allowed: a list or another iterable of scenes"):
        predict_many(scenes)
