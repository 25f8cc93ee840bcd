"""How parts of scenes and answers are pickled and copied.

Arrays stay read-only. What is found when it is first read is pickled as what it is, without what finds it.
"""

from dataclasses import fields
from typing import Any, Generic, NoReturn, TypeVar

import numpy as np

K = TypeVar("K")
T = TypeVar("T")


class Checked:
    """A part whose fields were checked as it was made: its arrays are read-only, also where it is pickled or copied."""

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        for field in fields(self):  # type: ignore[arg-type]  # those who inherit are dataclasses
            value = state[field.name]
            if isinstance(value, np.ndarray):
                value.setflags(write=False)


class Unwritten(dict[K, T]):
    """A dict that was checked as it was made, and can't be written over; a copy of it, `dict(it)`, can."""

    def _refuse(self, *_: Any, **__: Any) -> NoReturn:
        raise TypeError("it can't be written over: make a new one, by dataclasses.replace where it is part of another")

    __setitem__ = __delitem__ = __ior__ = _refuse  # type: ignore[assignment]
    update = setdefault = pop = popitem = clear = _refuse  # type: ignore[assignment]

    def __reduce__(self) -> tuple[type["Unwritten[K, T]"], tuple[dict[K, T]]]:
        return type(self), (dict(self),)


class Answered(Checked):
    """A part of an answer: its arrays are read-only views, as the solver's own may be written."""

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if isinstance(value, np.ndarray):
                view = value.view()
                view.setflags(write=False)
                vars(self)[name] = view


class Known(Generic[T]):
    """A function that returns what is known, whatever it is called with."""

    def __init__(self, value: T) -> None:
        self._value = value

    def __call__(self, *_: Any) -> T:
        """Return what is known."""
        return self._value


def state_with(part: object, **finders: str) -> dict[str, Any]:
    """Return the state of a part for `pickle`, in which the functions that find attributes know these.

    Args:
        part: what is pickled.
        finders: for each attribute the name of the one that finds it.
    """
    found = {name: getattr(part, name) for name in finders}
    return {**vars(part), **found, **{finder: Known(found[name]) for name, finder in finders.items()}}
