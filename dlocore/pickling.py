"""How parts of scenes and answers are pickled and copied.

Arrays stay read-only. Attributes that are computed when they are first read are pickled by value, without the function
that computes them.
"""

from dataclasses import fields
from typing import Any, Generic, NoReturn, TypeVar

import numpy as np

K = TypeVar("K")
T = TypeVar("T")


class Checked:
    """A part whose fields were checked when it was made. Its arrays are read-only, also after pickling or copying."""

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        for field in fields(self):  # type: ignore[arg-type]  # subclasses are dataclasses
            value = state[field.name]
            if isinstance(value, np.ndarray):
                value.setflags(write=False)


class Unwritten(dict[K, T]):
    """A read-only dict, checked when it was made; a copy, `dict(it)`, can be changed."""

    def _refuse(self, *_: Any, **__: Any) -> NoReturn:
        raise TypeError("this dict is read-only: make a new one, and use dataclasses.replace if it is part of a scene")

    __setitem__ = __delitem__ = __ior__ = _refuse  # type: ignore[assignment]
    update = setdefault = pop = popitem = clear = _refuse  # type: ignore[assignment]

    def __reduce__(self) -> tuple[type["Unwritten[K, T]"], tuple[dict[K, T]]]:
        return type(self), (dict(self),)


class Answered(Checked):
    """A part of an answer. Its arrays are read-only views, because the solver may still write its own arrays."""

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if isinstance(value, np.ndarray):
                view = value.view()
                view.setflags(write=False)
                vars(self)[name] = view


class Known(Generic[T]):
    """A function that returns a known value, whatever it is called with."""

    def __init__(self, value: T) -> None:
        self._value = value

    def __call__(self, *_: Any) -> T:
        """Return the known value."""
        return self._value


def state_with(part: object, **finders: str) -> dict[str, Any]:
    """Return the state of a part for `pickle`, with computed attributes and with their values in place of functions.

    Args:
        part: what is pickled.
        finders: for each computed attribute, the name of the field whose function computes it.
    """
    found = {name: getattr(part, name) for name in finders}
    return {**vars(part), **found, **{finder: Known(found[name]) for name, finder in finders.items()}}
