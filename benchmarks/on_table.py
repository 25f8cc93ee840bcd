"""Random motions among obstacles on a table: `python -m benchmarks.on_table --seed 1 --count 60`.

A cable of 0.4 to 2 m lies on a table, straight, bowed or wavy. Grippers lift it, carry it in an arc or bring two of its
points together, beside and over posts, boxes, bars and balls (`benchmarks/table_scenes.py`). Each possible scene is
predicted with quality "auto" and a deadline. The scenes that do not converge are printed, then how many converge and
the time this took. With `--reference`, the converged ones are compared with the step-by-step reference. `--index 17`
runs only scene 17.
"""

import multiprocessing
import time
from collections import Counter
from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from benchmarks.machine import machine_line
from benchmarks.pairs import Pair, indices, paired, scenes_parser, solved
from benchmarks.random_reference import TARGET, WRONG
from benchmarks.table_scenes import draw
from dlocore import Quality, SceneError, predict, warm_up

DEADLINE = 12.0  # [s]
PATIENCE = 25.0  # [s] of the reference


class Outcome(NamedTuple):
    """What became of a scene: status, time [s], message, number of obstacles, and how far it is from the reference."""

    index: int
    families: tuple[str, ...]
    status: str
    took: float
    message: str
    obstacles: int
    pair: Pair | None = None


def run(seed: int, reference: bool, index: int) -> Outcome | None:
    """Predict the scene of a seed and an index; None where it is refused."""
    try:
        drawn = draw(seed, index)
        scene, begun = drawn.scene, time.perf_counter()
        found = predict(scene, deadline=DEADLINE)
    except SceneError:
        return None
    obstacles = len(scene.environment.obstacles)
    one = Outcome(index, drawn.families, found.status, time.perf_counter() - begun, found.message, obstacles)
    if not reference or found.status != "converged":
        return one
    quality = Quality(method="reference", target_error=TARGET * scene.cable.length)
    other = solved(replace(scene, quality=quality), PATIENCE)
    return one if other is None else one._replace(pair=paired(drawn, found, other))


def report(outcomes: Iterable[Outcome | None]) -> None:
    """Print what does not converge, or is not told, as it comes, and then how many do and what that took."""
    seen = []
    for one in outcomes:
        if one is None:
            continue
        seen.append(one)
        if one.status != "converged":
            print(
                f"{one.index}: {one.status} after {one.took:.1f} s ({', '.join(one.families)}): {one.message}",
                flush=True,
            )
        if one.pair is not None and not one.pair.is_told:
            print(f"not told: {one.pair.line()}", flush=True)
    if not seen:
        print("none that a cable can follow")
        return
    print(", ".join(f"{count} {status}" for status, count in Counter(one.status for one in seen).most_common()))
    for name, some in (("with obstacles", True), ("without", False)):
        took = [one.took for one in seen if (one.obstacles > 0) == some]
        if took:
            within = np.quantile(took, [0.5, 0.9])
            print(f"{name}: {len(took)}, median {within[0]:.2f} s, 90 % {within[1]:.2f} s, in all {sum(took):.0f} s")
    pairs = [one.pair for one in seen if one.pair is not None]
    if pairs:
        near = sum(pair.apart <= WRONG for pair in pairs)
        print(f"{len(pairs)} that the reference solves, too: {near} within {WRONG:.0%} of the length of it")


def main() -> None:
    parser = scenes_parser(__doc__, 60)
    parser.add_argument("--reference", action="store_true", help="compare with the step-by-step reference")
    parser.add_argument("--jobs", type=int, default=1, help="processes (default 1)")
    options = parser.parse_args()
    with multiprocessing.get_context("spawn").Pool(options.jobs, warm_up) as pool:
        report(pool.imap(partial(run, options.seed, options.reference), indices(options)))
    print(machine_line())


if __name__ == "__main__":
    main()
