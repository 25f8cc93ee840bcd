"""The scenes that a file enters into the catalogue, in their order."""

from collections.abc import Callable

from benchmarks.premises import Premise
from dlocore import Scene

Maker = Callable[[], Scene]


class Entries:
    """Scenes by the names of the functions that make them: `entry = Entries()`, then `@entry` before each.

    `@entry.where(premise)` enters a scene whose name promises something.
    """

    def __init__(self) -> None:
        self._makers: dict[str, Maker] = {}
        self.premises: dict[str, tuple[Premise, ...]] = {}

    def __call__(self, make: Maker) -> Maker:
        self._makers[_name(make)] = make
        return make

    def where(self, *premises: Premise) -> Callable[[Maker], Maker]:
        """Return what enters a scene whose prediction has to keep the premises."""

        def enter(make: Maker) -> Maker:
            self.premises[_name(make)] = premises
            return self(make)

        return enter

    def scenes(self) -> dict[str, Scene]:
        """Return every scene by name."""
        return {name: make() for name, make in self._makers.items()}


def _name(make: Maker) -> str:
    return make.__name__.replace("_", " ")
