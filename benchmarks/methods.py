"""The least squares compared with the march on the same grids: `python -m benchmarks.methods [--seed N] [--scenes N]`.

Takes those random hard scenes that have a given grid and a smooth motion. Prints how often the least squares converges
and, where it does, its largest error and its time relative to those of the march. The truth is a march to 0.1 % of the
length. Scenes for which the truth does not converge are left out of the errors. Scenes whose march shows no motion on
that grid, or whose least squares runs out of time, are left out entirely.
"""

import argparse
import itertools
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from benchmarks.hard.generator import draw
from benchmarks.machine import machine_line
from dlocore import Prediction, Quality, Scene, SceneError, predict, warm_up
from dlocore.front import automatic_method
from dlocore.problem.problem import pose

TRUE = 1e-3  # of the length
DEADLINE = 20.0  # [s]
SHARES = (10, 25, 50, 75, 90)  # percentiles


class Both(NamedTuple):
    """What both methods did on a scene.

    Attributes:
        converged: whether the least squares did.
        errors: its largest error and that of the march [lengths], or None.
        times: its time and that of the march [s].
    """

    converged: bool
    errors: tuple[float, float] | None
    times: tuple[float, float]


def given_grids(seed: int, count: int) -> Iterator[Scene]:
    """Return so many random scenes of smooth motions on given grids."""
    possible = (drawn.make() for drawn in (draw(seed, index) for index in itertools.count()) if drawn.possible)
    given = (scene for scene in possible if scene.quality.n_u is not None and scene.quality.method != "paper")
    asked = (replace(scene, quality=replace(scene.quality, method="auto")) for scene in given)
    smooth = (scene for scene in asked if automatic_method(pose(scene)) == "spacetime")
    return itertools.islice(smooth, count)


def measure(scene: Scene) -> Both | None:
    """Return what both methods do on a scene's grid, None where the march shows no motion on it or time is up."""
    quality = scene.quality

    def solved(asked: Quality) -> Prediction:
        return predict(replace(scene, quality=asked), deadline=DEADLINE, keep_grid=True)

    marched = solved(replace(quality, method="march", estimate=False))
    least = solved(replace(quality, method="spacetime", estimate=False))
    if marched.status != "converged" or least.status == "time_limit" or least.accuracy.method != "spacetime":
        return None
    times = least.accuracy.wall_time, marched.accuracy.wall_time
    length = float(scene.cable.length)
    true = solved(Quality(target_error=TRUE * length)) if least.status == "converged" else least
    if true.status != "converged":
        return Both(least.status == "converged", None, times)
    u, t = np.linspace(0.0, length, 65), np.linspace(0.0, true.surface.horizon, 65)

    def error(found: Prediction) -> float:
        apart = found.surface.positions(u, t) - true.surface.positions(u, t)
        return float(np.linalg.norm(apart, axis=-1).max()) / length

    return Both(least.status == "converged", (error(least), error(marched)), times)


def _row(name: str, ratios: NDArray[np.float64]) -> str:
    return f"| {name} | {len(ratios)} | " + " | ".join(f"{x:.2f}" for x in np.percentile(ratios, SHARES)) + " |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=36)
    parser.add_argument("--scenes", type=int, default=150)
    given = parser.parse_args()
    warm_up()
    found: list[Both] = []
    for scene in given_grids(given.seed, given.scenes):
        try:
            both = measure(scene)
        except SceneError:  # such as a start that does not settle on this grid
            continue
        if both is not None:
            found.append(both)
    solved = [both for both in found if both.converged]
    print(f"{len(solved)} of {len(found)} least squares converge")
    print("| least squares over march | scenes | " + " | ".join(f"{x} %" for x in SHARES) + " |")
    print("|---|---|" + "---|" * len(SHARES))
    pairs = [both.errors for both in solved if both.errors is not None]
    print(_row("largest error", np.array([least / march for least, march in pairs])))
    print(_row("time, where it converges", np.array([both.times[0] / both.times[1] for both in solved])))
    failed = [both.times[0] / both.times[1] for both in found if not both.converged]
    print(_row("time, where it does not", np.array(failed)))
    print(machine_line())


if __name__ == "__main__":
    main()
