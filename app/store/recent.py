"""The last predictions, kept in memory so that others much like them can go on from their grids."""

from collections import OrderedDict
from threading import Lock

from dlocore import Prediction

MOST_BYTES = 256_000_000  # of their motions


class Recent:
    """The last predictions by id, as many as `most` bytes hold; safe to call from any thread."""

    def __init__(self, most: int = MOST_BYTES) -> None:
        self._most = most
        self._kept: OrderedDict[str, Prediction] = OrderedDict()
        self._bytes = 0
        self._lock = Lock()

    def add(self, id: str, prediction: Prediction) -> None:
        """Keep a prediction; forget those that were not asked for the longest."""
        with self._lock:
            self._remove(id)
            self._kept[id] = prediction
            self._bytes += _size(prediction)
            while self._bytes > self._most and len(self._kept) > 1:
                self._remove(next(iter(self._kept)))

    def get(self, id: str) -> Prediction | None:
        """Return the prediction `id`, or None where it is not kept."""
        with self._lock:
            found = self._kept.get(id)
            if found is not None:
                self._kept.move_to_end(id)
            return found

    def forget(self, id: str) -> None:
        """Forget the prediction `id`, if it is kept."""
        with self._lock:
            self._remove(id)

    def _remove(self, id: str) -> None:
        if id in self._kept:
            self._bytes -= _size(self._kept.pop(id))


def _size(prediction: Prediction) -> int:
    """Return about how many bytes a prediction holds; that whose error estimate it took on counts with each."""
    others = 0 if prediction.judged is None else _size(prediction.judged)
    if prediction.level is None:
        return others + prediction.surface.control_points.nbytes
    motion = prediction.level.motion
    forces = sum(window.forces.nbytes for window in motion.forces)
    iterates = len(prediction.iterations) * prediction.level.control.nbytes
    return others + motion.states.nbytes + motion.log.nbytes + forces + iterates
