"""The scenes that a file enters into the catalogue, in their order."""

from collections.abc import Callable

from dlocore import Scene


class Entries:
    """Scenes by the names of the functions that make them: `entry = Entries()`, then `@entry` before each."""

    def __init__(self) -> None:
        self._makers: dict[str, Callable[[], Scene]] = {}

    def __call__(self, make: Callable[[], Scene]) -> Callable[[], Scene]:
        self._makers[make.__name__.replace("_", " ")] = make
        return make

    def scenes(self) -> dict[str, Scene]:
        """Return every scene by name."""
        return {name: make() for name, make in self._makers.items()}
