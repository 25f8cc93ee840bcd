"""Two predictions of one random scene: how far they are apart, and whether their error estimates account for that."""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from benchmarks.hard.generator import draw
from dlocore import Prediction, Quality, Scene, SceneError, predict
from dlocore.problem.events import moments


class Drawn(NamedTuple):
    """A random scene that a cable can follow, with quality "auto", its index, and what makes it hard."""

    index: int
    families: tuple[str, ...]
    scene: Scene


class Pair(NamedTuple):
    """Two predictions of a scene: what each estimates and the largest distance anywhere, parts of the length."""

    index: int
    families: tuple[str, ...]
    estimates: tuple[float, float]
    apart: float

    @property
    def told(self) -> float:
        """Twice the sum of both estimates: so far they may be apart."""
        return 2.0 * sum(self.estimates)

    @property
    def is_told(self) -> bool:
        """Whether the estimates tell of the distance."""
        return self.apart <= self.told

    def line(self) -> str:
        """Return it in words."""
        estimates = " and ".join(f"{estimate:.2%}" for estimate in self.estimates)
        return f"{self.index}: estimates {estimates}, {self.apart:.2%} apart ({', '.join(self.families)})"


def drawn(seed: int, index: int) -> Drawn | None:
    """Return the scene of a seed and an index, as `benchmarks.random_scenes` draws it; None where it is impossible."""
    found = draw(seed, index)
    try:
        scene = found.make() if found.possible else None
    except SceneError:
        return None
    return None if scene is None else Drawn(index, found.families, replace(scene, quality=Quality()))


def solved(scene: Scene, deadline: float) -> Prediction | None:
    """Return a prediction that converged, or None."""
    try:
        found = predict(scene, deadline=deadline)
    except SceneError:
        return None
    return found if found.status == "converged" and found.accuracy.error_estimate is not None else None


def paired(one: Drawn, a: Prediction, b: Prediction) -> Pair:
    """Compare two predictions of a scene."""
    length = one.scene.cable.length
    u, t = np.linspace(0.0, length, 65), np.linspace(0.0, a.surface.horizon, moments(one.scene, 33))
    apart = np.linalg.norm(a.surface.positions(u, t) - b.surface.positions(u, t), axis=-1).max() / length
    told, other = (float(p.accuracy.error_estimate or 0.0) / length for p in (a, b))
    return Pair(one.index, one.families, (told, other), float(apart))


def scenes_parser(text: str | None, count: int) -> argparse.ArgumentParser:
    """Return a parser of `--seed`, `--count` and `--index`."""
    parser = argparse.ArgumentParser(description=text, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=count, help=f"scenes to draw (default {count})")
    parser.add_argument("--index", type=int, help="run only this scene")
    return parser


def indices(options: argparse.Namespace) -> Sequence[int]:
    """Return the indices of the scenes that are asked for."""
    return range(options.count) if options.index is None else [options.index]
