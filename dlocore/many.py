"""Many predictions at once, on all processors."""

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_EXCEPTION, ThreadPoolExecutor, wait
from threading import Event, Lock

from dlocore.errors import Cancelled, SceneError, number
from dlocore.front import predict
from dlocore.machine import usable_cores
from dlocore.prediction import Prediction
from dlocore.scene import Scene


def predict_many(
    scenes: Iterable[Scene],
    *,
    threads: int | None = None,
    deadline: float | None = None,
    cancelled: Callable[[], bool] | None = None,
) -> list[Prediction | SceneError]:
    """Predict the motions of many scenes, each as `predict` would, bit for bit.

    The compiled part of a solve runs beside the others'; what Python does in between runs one at a time.

    Args:
        scenes: what to predict.
        threads: solves at once; by default as many as there are processors for this process.
        deadline: time allowed for each scene [s], as in `predict`.
        cancelled: asked between iterations of every solve; where it returns True all stop.

    Returns:
        For each scene, in order, its prediction, or the error that says why it can't be solved as it was given.

    Raises:
        SceneError: `threads` is no positive whole number.
        Cancelled: `cancelled` returned True.
    """
    wanted = usable_cores() if threads is None else int(number("threads", threads, at_least=1, at_most=1024))
    given = list(scenes)
    found: list[Prediction | SceneError | None] = [None] * len(given)
    rest, lock, stop = iter(range(len(given))), Lock(), Event()

    def stopped() -> bool:
        return stop.is_set() or (cancelled is not None and cancelled())

    def work() -> None:
        for index in _shared(rest, lock):
            if stopped():
                raise Cancelled("the solves were cancelled")
            try:
                found[index] = predict(given[index], deadline=deadline, cancelled=stopped)
            except SceneError as error:
                found[index] = error

    count = min(wanted, len(given))
    if count <= 1:
        work()
    else:
        with ThreadPoolExecutor(count, "dlo-predict") as pool:
            done = [pool.submit(work) for _ in range(count)]
            try:
                wait(done, return_when=FIRST_EXCEPTION)
            finally:
                stop.set()  # also where this thread is interrupted
        errors = [one.exception() for one in done]
        # the others were only stopped by the first
        for error in sorted((e for e in errors if e is not None), key=lambda e: isinstance(e, Cancelled)):
            raise error
    return [one for one in found if one is not None]


def _shared(rest: Iterator[int], lock: Lock) -> Iterator[int]:
    """Give what is left of an iterator that several threads draw from."""
    while True:
        with lock:
            index = next(rest, None)
        if index is None:
            return
        yield index
