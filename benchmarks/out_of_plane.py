"""Planar motions that are drawn out of their plane: `python -m benchmarks.out_of_plane --seed 32 --count 500`.

The reference takes from the scene the plane in which it moves, as the march does, and can't tell whether a cable
stays in it. Here random scenes off a table that are solved in a plane, drawn as by `benchmarks.random_scenes` but with
quality "auto" and without contact of the cable with itself, are solved in space, too, with an acceleration across the
plane that moves a free cable by less than 10^-4 of its length. Those that this moves by more than twice what both
estimate are printed. Starts that settle are left out: any weight turns them. `--index 17` runs that one.
"""

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1", VECLIB_MAXIMUM_THREADS="1")

import argparse
from dataclasses import replace
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from benchmarks.hard.generator import draw
from benchmarks.machine import machine_line
from benchmarks.random_reference import solved
from dlocore import Quality, SceneError
from dlocore.events import moments

DEADLINE = 15.0  # [s]
PULL = 1e-4  # of the length over the square of the time: the acceleration across the plane


class Drawn(NamedTuple):
    """A planar motion: its families, what both solves estimate, and how far they are apart, parts of the length."""

    index: int
    families: tuple[str, ...]
    told: float
    apart: float

    @property
    def stays(self) -> bool:
        """Whether the two are as near as they tell, and as the acceleration itself moves a free cable."""
        return self.apart <= 2.0 * self.told + PULL


def draw_out(seed: int, index: int) -> Drawn | None:
    """Draw the scene of a seed and an index out of its plane; None where it has none, or one of the solves fails."""
    drawn = draw(seed, index)
    try:
        scene = drawn.make() if drawn.possible else None
    except SceneError:
        return None
    if scene is None or scene.environment.table is not None or scene.shape.settle:
        return None
    scene = replace(scene, quality=Quality(), effects={**scene.effects, "self_contact": "off"})
    flat = solved(scene, DEADLINE)
    if flat is None or flat.accuracy.dimensions == 3:
        return None
    length, horizon = scene.cable.length, flat.surface.horizon
    u, t = np.linspace(0.0, length, 33), np.linspace(0.0, horizon, moments(scene, 33))
    positions = flat.surface.positions(u, t)
    points = positions.reshape(-1, 3)
    normal = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2][2]
    gravity = cast(NDArray[np.float64], scene.environment.gravity) + PULL * length / horizon**2 * normal
    pulled = solved(replace(scene, environment=replace(scene.environment, gravity=gravity)), DEADLINE)
    if pulled is None:
        return None
    apart = np.linalg.norm(positions - pulled.surface.positions(u, t), axis=-1).max() / length
    told = sum(float(p.accuracy.error_estimate or 0.0) for p in (flat, pulled)) / length
    return Drawn(index, drawn.families, told, float(apart))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=500, help="scenes to draw (default 500)")
    parser.add_argument("--index", type=int, help="only this one")
    options = parser.parse_args()
    seen = leave = 0
    for index in range(options.count) if options.index is None else [options.index]:
        one = draw_out(options.seed, index)
        if one is None:
            continue
        seen += 1
        if not one.stays:
            leave += 1
            print(
                f"{one.index}: {one.apart:.2%} apart, estimates {one.told:.2%} ({', '.join(one.families)})", flush=True
            )
    print(f"{seen} motions in a plane; {leave} leave it")
    print(machine_line())


if __name__ == "__main__":
    main()
