"""Many predictions at once, on all processors."""

from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from threading import Event

from dlocore.errors import SceneError, number
from dlocore.front import predict
from dlocore.machine import usable_cores
from dlocore.prediction import Prediction
from dlocore.scene import Scene


def predict_many(
    scenes: Iterable[Scene],
    *,
    like: Prediction | None = None,
    threads: int | None = None,
    deadline: float | None = None,
    cancelled: Callable[[], bool] | None = None,
) -> list[Prediction | SceneError]:
    """Predict the motions of many scenes, each as `predict` would, bit for bit.

    The compiled part of a solve runs beside the others'; what Python does in between runs one at a time.

    Args:
        scenes: what to predict.
        like: a prediction of a scene much like them all, as in `predict`.
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
    stop = Event()

    def stopped() -> bool:
        return stop.is_set() or (cancelled is not None and cancelled())

    def solve(scene: Scene) -> Prediction | SceneError:
        try:
            return predict(scene, like=like, deadline=deadline, cancelled=stopped)
        except SceneError as error:
            return error

    if wanted == 1:
        return [solve(scene) for scene in scenes]
    pool = ThreadPoolExecutor(wanted, "dlo-predict")
    try:
        return list(pool.map(solve, scenes))
    finally:
        stop.set()  # what still runs where a solve failed, or this thread is interrupted
        pool.shutdown(cancel_futures=True)
