"""What the automatic choice of effects leaves out: `python -m benchmarks.left_out --seed 40 --count 200`.

Random scenes, drawn as by `benchmarks.random_scenes` but with quality "auto" and all effects "auto", are solved as they
are, and again with each effect that was left out switched on, one at a time. Those that this moves by more than twice
what both estimate, and by more than 0.1 % of the length, are printed: there the choice was wrong and did not say so.
Answers that tell of strands which cross are passed over. `--index 17` runs that one.
"""

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1", VECLIB_MAXIMUM_THREADS="1")

import argparse
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from benchmarks.hard.generator import draw
from benchmarks.machine import machine_line
from benchmarks.random_reference import solved
from dlocore import Quality, SceneError
from dlocore.events import moments

DEADLINE = 15.0  # [s]
MATTERS = 1e-3  # of the length
CROSSED = "strands cross"  # words of an answer that tells of strands that go through each other


class LeftOut(NamedTuple):
    """An effect that was left out, why, what both solves estimate, and how far they are apart, parts of the length."""

    index: int
    families: tuple[str, ...]
    effect: str
    reason: str
    told: float
    apart: float

    @property
    def is_told(self) -> bool:
        """Whether the two are as near as they tell."""
        return self.apart <= max(2.0 * self.told, MATTERS)


def switch_on(seed: int, index: int) -> Iterator[LeftOut]:
    """Yield what each effect does that was left out of the scene of a seed and an index."""
    drawn = draw(seed, index)
    try:
        scene = drawn.make() if drawn.possible else None
    except SceneError:
        return
    if scene is None:
        return
    scene = replace(scene, quality=Quality(), effects={})
    found = solved(scene, DEADLINE)
    if found is None or CROSSED in found.message:
        return
    length = scene.cable.length
    u, t = np.linspace(0.0, length, 33), np.linspace(0.0, found.surface.horizon, moments(scene, 33))
    positions = found.surface.positions(u, t)
    for effect in found.effects:
        if effect.active:
            continue
        whole = solved(replace(scene, effects={effect.name: "on"}), DEADLINE)
        if whole is None or not next(e.active for e in whole.effects if e.name == effect.name):
            continue
        apart = np.linalg.norm(positions - whole.surface.positions(u, t), axis=-1).max() / length
        told = sum(float(p.accuracy.error_estimate or 0.0) for p in (found, whole)) / length
        yield LeftOut(index, drawn.families, effect.name, effect.reason, told, float(apart))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=200, help="scenes to draw (default 200)")
    parser.add_argument("--index", type=int, help="only this one")
    options = parser.parse_args()
    seen: Counter[str] = Counter()
    wrong: Counter[str] = Counter()
    for index in range(options.count) if options.index is None else [options.index]:
        for one in switch_on(options.seed, index):
            seen[one.effect] += 1
            if not one.is_told:
                wrong[one.effect] += 1
                print(
                    f"{one.index}: {one.effect} ({one.reason}), {one.apart:.2%} apart, estimates {one.told:.2%} "
                    f"({', '.join(one.families)})",
                    flush=True,
                )
    print("| left out | times | moves it by more than is told |")
    print("|---|---|---|")
    for effect, count in sorted(seen.items()):
        print(f"| {effect} | {count} | {wrong[effect]} |")
    print(machine_line())


if __name__ == "__main__":
    main()
