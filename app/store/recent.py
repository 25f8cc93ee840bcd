"""The latest predictions, kept in memory so that similar ones can reuse their grids and error estimates."""

import gc
import sys
from collections import OrderedDict
from threading import Lock
from types import BuiltinFunctionType, FunctionType, ModuleType

import numpy as np

from dlocore import Prediction

MOST_BYTES = 256_000_000  # of memory, accurate to a tenth
_OF_ALL = (type, ModuleType, BuiltinFunctionType)  # shared by all predictions, and so not counted


class Recent:
    """The latest predictions by id, as many as fit in `most` bytes; safe to call from any thread."""

    def __init__(self, most: int = MOST_BYTES) -> None:
        self._most = most
        self._kept: OrderedDict[str, tuple[Prediction, int]] = OrderedDict()  # each with its size in bytes
        self._bytes = 0
        self._lock = Lock()

    def add(self, id: str, prediction: Prediction) -> None:
        """Keep a prediction whose lazy parts have been read; forget the least recently used ones beyond the limit."""
        size = size_of(prediction)
        with self._lock:
            self._remove(id)
            self._kept[id] = (prediction, size)
            self._bytes += size
            while self._bytes > self._most and len(self._kept) > 1:
                self._remove(next(iter(self._kept)))

    def get(self, id: str) -> Prediction | None:
        """Return the prediction `id`, or None if it is not kept."""
        with self._lock:
            if id not in self._kept:
                return None
            self._kept.move_to_end(id)
            return self._kept[id][0]

    def forget(self, id: str) -> None:
        """Forget the prediction `id`, if it is kept."""
        with self._lock:
            self._remove(id)

    def _remove(self, id: str) -> None:
        if id in self._kept:
            self._bytes -= self._kept.pop(id)[1]


def size_of(prediction: Prediction) -> int:
    """Return how many bytes a prediction holds: its arrays, its other objects, and predictions that it refers to.

    The size is found by following all references except those to code, so it includes whatever a prediction holds.
    """
    seen: set[int] = set()
    total = 0
    waiting: list[object] = [prediction]
    while waiting:
        part = waiting.pop()
        if id(part) in seen or isinstance(part, _OF_ALL) or type(part).__module__.startswith("numba"):
            continue
        seen.add(id(part))
        total += sys.getsizeof(part)
        if isinstance(part, np.ndarray):
            if isinstance(part.base, np.ndarray):
                waiting.append(part.base)
            elif part.base is not None:  # memory of compiled code
                total += part.nbytes
        elif isinstance(part, FunctionType):
            waiting.extend(part.__closure__ or ())
        else:
            waiting.extend(gc.get_referents(part))
    return total
