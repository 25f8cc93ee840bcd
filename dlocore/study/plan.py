"""What a study measures."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Literal, NamedTuple

from dlocore.errors import SceneError, choice, repeated
from dlocore.scene.scene import Method, Quality, Scene, Switch
from dlocore.study.record import PARTS, Part
from dlocore.study.scenes import accuracy_scenes

Judge = Literal["march", "reference"]
JUDGES: tuple[Judge, ...] = ("march", "reference")
METHODS: tuple[Method, ...] = ("march", "spacetime", "paper")
GRIDS = ((7, 11), (9, 13), (13, 19), (17, 25), (25, 37), (33, 49))
MAX_RUNS = 5000
MAX_REPEATS = 100
_NO_CHANGE: Mapping[str, Switch] = {}


class Case(NamedTuple):
    """One run to be measured: the names of scene and set of effects, and the scene with its quality."""

    name: str
    effects: str
    scene: Scene


@dataclass(frozen=True, kw_only=True)
class StudyPlan:
    """Scenes over grids, thresholds, methods and sets of effects.

    Args:
        scenes: by name; their own quality is ignored. None: the paper's four grasps and a hanging cable.
        grids: (n_u, n_t) of each.
        methods: "march", "spacetime", "paper".
        deltas: thresholds on the update [m]; a march has none, and is measured once.
        effects: switches by effect, by the name of the set; they replace those of the scenes.
        repeats: timed calls of each solve, 1 to 100.
        estimate: whether the solves also estimate their error.
        judge: the truth for errors: "march", the project's own march refined until it no longer changes, or
            "reference", the independent step-by-step simulation, which takes from a second to minutes per scene.
        parts: which of "runs", "scaling" and "effects" are measured.

    Raises:
        SceneError: a value is not allowed.
    """

    scenes: Mapping[str, Scene] = field(default_factory=accuracy_scenes)
    grids: tuple[tuple[int, int], ...] = GRIDS
    methods: tuple[Method, ...] = ("march", "spacetime")
    deltas: tuple[float, ...] = (1e-5,)
    effects: Mapping[str, Mapping[str, Switch]] = field(default_factory=lambda: {"auto": _NO_CHANGE})
    repeats: int = 5
    estimate: bool = False
    judge: Judge = "march"
    parts: tuple[Part, ...] = PARTS

    def __post_init__(self) -> None:
        if not 1 <= self.repeats <= MAX_REPEATS:
            raise SceneError("repeats", self.repeats, f"1 to {MAX_REPEATS}")
        choice("judge", self.judge, JUDGES)
        for name, allowed in (("methods", METHODS), ("parts", PARTS)):
            for given in getattr(self, name):
                choice(name, given, allowed)
        for name in ("scenes", "grids", "methods", "deltas", "effects", "parts"):
            if not getattr(self, name):
                raise SceneError(name, "none", "at least one")
        for name in ("grids", "methods", "deltas", "parts"):
            twice = repeated(getattr(self, name))
            if twice is not None:
                raise SceneError(name, twice, "each once")
        if len(self.deltas) > 1 and set(self.methods) == {"march"}:
            raise SceneError("deltas", self.deltas, "one: a march has no threshold, and is measured once")
        for n_u, n_t in self.grids:
            try:
                Quality(n_u=n_u, n_t=n_t)
            except SceneError as error:
                raise SceneError("grids", f"{n_u}x{n_t}", f"for {error.field} {error.allowed}") from None
        for delta in self.deltas:
            try:
                Quality(n_u=n_u, n_t=n_t, delta=delta)
            except SceneError as error:
                raise SceneError("deltas", delta, error.allowed) from None
        if self.count > MAX_RUNS:
            raise SceneError("scenes", f"{self.count} runs", f"at most {MAX_RUNS} runs in one study")
        for _ in self.variants():  # a scene refuses switches that it can't have
            pass

    @property
    def count(self) -> int:
        """How many runs there are."""
        per_grid = sum(1 if method == "march" else len(self.deltas) for method in self.methods)
        return len(self.scenes) * len(self.effects) * len(self.grids) * per_grid

    def variants(self) -> Iterator[tuple[str, str, Scene]]:
        """Yield every scene with every set of effects: their names, and the scene."""
        for name, scene in self.scenes.items():
            for effects, switches in self.effects.items():
                yield name, effects, replace(scene, effects={**scene.effects, **switches})

    def cases(self, name: str, effects: str, scene: Scene) -> Iterator[Case]:
        """Yield the runs of a variant."""
        for method in self.methods:
            for n_u, n_t in self.grids:
                for delta in self.deltas[:1] if method == "march" else self.deltas:
                    quality = Quality(n_u=n_u, n_t=n_t, delta=delta, method=method, estimate=self.estimate)
                    yield Case(name, effects, replace(scene, quality=quality))
