"""Planar motions that leave their plane when disturbed: `python -m benchmarks.out_of_plane --seed 32 --count 500`.

Like the march, the reference takes the plane of the motion from the scene, so it can't show whether a cable stays in
that plane. Here random scenes without a table that are solved in a plane, drawn as by `benchmarks.random_scenes` but
with quality "auto" and without self-contact, are also solved in space, with an acceleration across the plane that moves
a free cable by less than 10^-4 of its length. A scene is printed if this moves it by more than twice the two error
estimates. Starts that settle are left out, because any weight turns them, and so are starts that get a bow, which takes
the place of the acceleration. `--index 17` runs only scene 17.
"""

from dataclasses import replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from benchmarks.machine import machine_line
from benchmarks.pairs import Pair, drawn, indices, paired, scenes_parser, solved
from dlocore.problem.problem import pose

DEADLINE = 15.0  # [s]
PULL = 1e-4  # of the length over the square of the time: the acceleration across the plane


def draw_out(seed: int, index: int) -> Pair | None:
    """Draw the scene of a seed and an index out of its plane; None where it has none, or one of the solves fails."""
    one = drawn(seed, index)
    if one is None or one.scene.environment.table is not None or one.scene.shape.settle:
        return None
    scene = replace(one.scene, effects={**one.scene.effects, "self_contact": "off"})
    flat = solved(scene, DEADLINE)
    if flat is None or flat.accuracy.dimensions == 3 or pose(flat.scene).start.bow:
        return None
    length, horizon = scene.cable.length, flat.surface.horizon
    u, t = np.linspace(0.0, length, 33), np.linspace(0.0, horizon, 33)
    points = flat.surface.positions(u, t).reshape(-1, 3)
    normal = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2][2]
    gravity = cast(NDArray[np.float64], scene.environment.gravity) + PULL * length / horizon**2 * normal
    pulled = solved(replace(scene, environment=replace(scene.environment, gravity=gravity)), DEADLINE)
    return None if pulled is None else paired(one._replace(scene=scene), flat, pulled)


def main() -> None:
    options = scenes_parser(__doc__, 500).parse_args()
    seen = leave = 0
    for index in indices(options):
        one = draw_out(options.seed, index)
        if one is None:
            continue
        seen += 1
        if one.apart > one.told + PULL:  # which moves a free cable by as much
            leave += 1
            print(one.line(), flush=True)
    print(f"{seen} motions in a plane; {leave} leave it")
    print(machine_line())


if __name__ == "__main__":
    main()
