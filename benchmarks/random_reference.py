"""Random hard scenes against the step-by-step reference: `python -m benchmarks.random_reference --seed 1 --count 400`.

Scenes as `benchmarks.random_scenes` draws them, with quality "auto" and without contact of the cable with itself, which
the reference does not know. Counted are those that both solve within their deadlines; each whose largest distance
anywhere is more than twice what both estimate is printed. `--index 17` runs that one.
"""

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1", VECLIB_MAXIMUM_THREADS="1")

import argparse
import multiprocessing
from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from benchmarks.hard.generator import draw
from benchmarks.machine import machine_line
from dlocore import Prediction, Quality, Scene, SceneError, predict, warm_up
from dlocore.events import moments

TARGET = 3e-3  # of the length: that of the reference
DEADLINES = 10.0, 15.0  # [s] of the predictor and the reference
PATIENT = 300.0, 300.0  # [s]: the same where what is found must not depend on the machine
WRONG = 1e-2  # of the length


class Compared(NamedTuple):
    """A scene that both solve: its families, both estimates and the largest distance, parts of the length."""

    index: int
    families: tuple[str, ...]
    told: float
    reference: float
    apart: float

    @property
    def is_told(self) -> bool:
        """Whether the distance is within twice the sum of the estimates."""
        return self.apart <= 2.0 * (self.told + self.reference)


def solved(scene: Scene, deadline: float) -> Prediction | None:
    """Return a prediction that converged, or None."""
    try:
        found = predict(scene, deadline=deadline)
    except SceneError:
        return None
    return found if found.status == "converged" and found.accuracy.error_estimate is not None else None


def compare(seed: int, index: int, deadlines: tuple[float, float] = DEADLINES) -> Compared | None:
    """Compare the scene of a seed and an index, None where it can't be followed or one of the two does not solve it."""
    drawn = draw(seed, index)
    if not drawn.possible:
        return None
    try:
        scene = drawn.make()
    except SceneError:
        return None
    length = scene.cable.length
    scene = replace(scene, quality=Quality(), effects={**scene.effects, "self_contact": "off"})
    found = solved(scene, deadlines[0])
    if found is None:
        return None
    quality = Quality(method="reference", target_error=max(TARGET * length, 1e-6))
    reference = solved(replace(scene, quality=quality), deadlines[1])
    if reference is None:
        return None
    u, t = np.linspace(0.0, length, 65), np.linspace(0.0, found.surface.horizon, moments(scene, 33))
    apart = np.linalg.norm(found.surface.positions(u, t) - reference.surface.positions(u, t), axis=-1).max()
    told, sure = (float(p.accuracy.error_estimate or 0.0) / length for p in (found, reference))
    return Compared(index, drawn.families, told, sure, float(apart) / length)


def report(results: Iterable[Compared | None]) -> None:
    """Print the scenes whose distance the estimates do not tell of as they come, and then how many there are."""
    seen = []
    for one in results:
        if one is None:
            continue
        seen.append(one)
        if not one.is_told:
            print(f"{one.index}: estimates {one.told:.2%} and {one.reference:.2%}, {one.apart:.2%} apart", end="")
            print(f" ({', '.join(one.families)})", flush=True)
    if not seen:
        print("none that both solve")
        return
    near = sum(one.apart <= WRONG for one in seen)
    print(f"{len(seen)} scenes that both solve; {near} within {WRONG:.0%} of the length")
    print(f"within twice the sum of both estimates: {sum(one.is_told for one in seen)}")
    wrong = [one.index for one in seen if one.apart > WRONG and not one.is_told]
    print(f"beyond {WRONG:.0%} of the length, and not told: {wrong or 'none'}")
    print(f"median distance {np.median([one.apart for one in seen]):.2%} of the length")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=400, help="scenes to draw (default 400)")
    parser.add_argument("--jobs", type=int, default=1, help="processes (default 1)")
    parser.add_argument("--index", type=int, help="only this one")
    options = parser.parse_args()
    indices = range(options.count) if options.index is None else [options.index]
    with multiprocessing.get_context("spawn").Pool(options.jobs, warm_up) as pool:
        report(pool.imap(partial(compare, options.seed), indices))
    print(machine_line())


if __name__ == "__main__":
    main()
