"""Parts of an answer that are found when they are first read are pickled as what they are, without what finds them."""

from typing import Any, Generic, TypeVar

T = TypeVar("T")


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
