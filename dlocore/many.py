"""Many predictions at once, on all processors."""

import gc
from collections.abc import Callable, Iterable
from threading import Event, Lock, Thread
from typing import cast

from dlocore.errors import SceneError, whole
from dlocore.front import check_options, predict
from dlocore.machine import usable_cores
from dlocore.prediction import Prediction
from dlocore.scene.scene import Scene

_NEVER = 2**31 - 1  # looks at what is younger, after which what is old is looked at
_MOST_AT_ONCE = 16  # scenes that a thread takes: to wake another for each takes longer than to solve a short one


def predict_many(
    scenes: Iterable[Scene],
    *,
    like: Prediction | None = None,
    threads: int | None = None,
    deadline: float | None = None,
    cancelled: Callable[[], bool] | None = None,
    keep_grid: bool = False,
) -> list[Prediction | SceneError]:
    """Predict the motions of many scenes, each as `predict` would, bit for bit.

    The compiled part of a solve runs beside the others'; what Python does in between runs one at a time.

    Args:
        scenes: what to predict.
        like: a prediction of a scene much like them all, as in `predict`.
        threads: solves at once; by default as many as there are processors for this process.
        deadline: time allowed for each scene [s], as in `predict`.
        cancelled: asked between iterations of every solve; where it returns True all stop.
        keep_grid: answer with what given grids come to by themselves, however much that errs, as in `predict`.

    Returns:
        For each scene, in order, its prediction, or the error that says why it can't be solved as it was given.

    Raises:
        SceneError: `threads` is no positive whole number, another option is none that `predict` takes, or `scenes` are
            none.
        Cancelled: `cancelled` returned True.
    """
    wanted = usable_cores() if threads is None else whole("threads", threads, at_least=1, at_most=1024)
    check_options(like, deadline, keep_grid)
    if not isinstance(scenes, Iterable):
        raise SceneError("scenes", scenes, "scenes one after the other, as a list of them")
    given = list(scenes)
    answers: list[Prediction | SceneError | None] = [None] * len(given)
    failures: list[BaseException] = []
    stop, lock, taken = Event(), Lock(), 0

    def stopped() -> bool:
        return stop.is_set() or (cancelled is not None and cancelled())

    def solve(scene: Scene) -> Prediction | SceneError:
        try:
            return predict(scene, like=like, deadline=deadline, cancelled=stopped, keep_grid=keep_grid)
        except SceneError as error:
            return error

    def take() -> range:
        nonlocal taken
        with lock:  # fewer at once towards the end, so that all threads end together
            begin = taken
            taken += min(_MOST_AT_ONCE, -(-(len(given) - taken) // (2 * wanted)))
            return range(begin, taken)

    def work() -> None:
        try:
            while not stop.is_set() and (indices := take()):
                for index in indices:
                    answers[index] = solve(given[index])
        except BaseException as failure:  # the caller's to see, whichever thread it is in
            failures.append(failure)
            stop.set()

    helpers = [Thread(target=work, name=f"dlo-predict-{n}") for n in range(1, min(wanted, len(given)))]
    with _old_garbage:
        try:
            for helper in helpers:
                helper.start()
            work()
            for helper in helpers:
                helper.join()
        finally:
            stop.set()  # what still runs where this thread is interrupted
            for helper in helpers:
                if helper.is_alive():
                    helper.join()
    if failures:
        raise failures[0]
    return cast(list[Prediction | SceneError], answers)


class _OldGarbage:
    """Waits: Python looks for garbage among what has lived for long only after the last of the batches under way.

    Each such look takes as long as there are objects in the process, and comes the more often the more answers a batch
    has made, none of which are garbage: with thousands of them it is a fifth of the time. Young objects are looked
    through as ever.
    """

    def __init__(self) -> None:
        self._lock, self._batches, self._kept = Lock(), 0, gc.get_threshold()

    def __enter__(self) -> None:
        with self._lock:
            if self._batches == 0:
                self._kept = gc.get_threshold()
                gc.set_threshold(*self._kept[:2], _NEVER)
            self._batches += 1

    def __exit__(self, *_: object) -> None:
        with self._lock:
            self._batches -= 1
            if self._batches == 0:
                gc.set_threshold(*self._kept)


_old_garbage = _OldGarbage()
