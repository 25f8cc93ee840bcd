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

_NEVER = 2**31 - 1  # collections of a younger generation after which the oldest is collected
_MOST_AT_ONCE = 16  # scenes that a thread takes at once: switching threads can take longer than a short solve


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

    The compiled parts of the solves run in parallel; the Python code between them runs in one thread at a time.

    Args:
        scenes: what to predict.
        like: a prediction of a scene similar to all of them, as in `predict`.
        threads: solves at once; by default the number of processors that this process may use.
        deadline: time allowed for each scene [s], as in `predict`.
        cancelled: called between iterations of every solve; all solves stop if it returns True.
        keep_grid: keep the answers of given grids however large their error, as in `predict`.

    Returns:
        For each scene, in order, its prediction, or the error that says why it can't be solved as it was given.

    Raises:
        SceneError: `threads` is not a whole number from 1 to 1024, `predict` would refuse another option, or `scenes`
            is not iterable.
        Cancelled: `cancelled` returned True.
    """
    wanted = usable_cores() if threads is None else whole("threads", threads, at_least=1, at_most=1024)
    check_options(like, deadline, keep_grid)
    if not isinstance(scenes, Iterable):
        raise SceneError("scenes", scenes, "a list or another iterable of scenes")
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
        except BaseException as failure:  # raised in the caller's thread below
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
            stop.set()  # stops the other solves if this thread is interrupted
            for helper in helpers:
                if helper.is_alive():
                    helper.join()
    if failures:
        raise failures[0]
    return cast(list[Prediction | SceneError], answers)


class _OldGarbage:
    """Postpones Python's collection of old garbage until the last of the running batches has ended.

    Each such collection visits all objects of the process, and the answers of a batch, none of which are garbage,
    trigger ever more of them: with thousands of answers they take a fifth of the time. Young objects are collected as
    usual.
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
