"""How far the time that `plan` expects is from the time of the solve: `python -m benchmarks.expected_times`.

Scenes of the catalogue with the most common qualities ("auto", target errors of 1 % and 0.1 % of the length, and a
given grid), and random hard scenes. Each is solved once so that all code is loaded, and again if that was quick, within
`--deadline`.
"""

import argparse
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from benchmarks.catalogue import catalogue
from benchmarks.hard.generator import draw
from benchmarks.machine import machine_line
from dlocore import Quality, Scene, SceneError, plan, predict, warm_up

_QUICK = 0.5  # [s]
_SHARES = (10, 25, 50, 75, 90)


def asked(seed: int, count: int) -> Iterator[tuple[str, Scene]]:
    """Return the scenes and what is asked for of them."""
    for scene in catalogue().values():
        length = scene.cable.length
        yield "quality auto", replace(scene, quality=Quality())
        yield "target 1 % of L", replace(scene, quality=Quality(target_error=1e-2 * length))
        yield "target 0.1 % of L", replace(scene, quality=Quality(target_error=1e-3 * length))
        yield "13 x 19", replace(scene, quality=Quality(n_u=13, n_t=19))
    for index in range(count):
        drawn = draw(seed, index)
        if drawn.possible:
            scene = drawn.make()
            if scene.quality.method in ("auto", "march"):
                yield "random", scene


def ratio(scene: Scene, deadline: float) -> float:
    """Return the time of a solve over the expected one; NaN where the scene is refused as asked for."""
    try:
        expected = plan(scene).expected_time
        spent = predict(scene, deadline=deadline).accuracy.wall_time
        if spent < _QUICK:
            spent = predict(scene, deadline=deadline).accuracy.wall_time
    except SceneError:
        return np.nan
    return spent / expected


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=131, help="seed of the random scenes (default 131)")
    parser.add_argument("--random", type=int, default=150, help="random scenes drawn (default 150)")
    parser.add_argument("--deadline", type=float, default=6.0, help="time limit of each solve [s] (default 6)")
    options = parser.parse_args()
    warm_up()
    found: dict[str, list[float]] = {}
    for kind, scene in asked(options.seed, options.random):
        found.setdefault(kind, []).append(ratio(scene, options.deadline))
    print("| asked for | scenes | " + " | ".join(f"{share} %" for share in _SHARES) + " |")
    print("|---" * (2 + len(_SHARES)) + "|")
    for kind, ratios in found.items():
        known = [x for x in ratios if np.isfinite(x)]
        shares = " | ".join(f"{x:.2f}" for x in np.percentile(known, _SHARES))
        print(f"| {kind} | {len(known)} | {shares} |")
    print(f"({machine_line()})")


if __name__ == "__main__":
    main()
