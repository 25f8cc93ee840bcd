"""How reliable the estimated errors of forces are: `python -m benchmarks.force_errors [--scenes NAME ...]`.

Every scene of the catalogue with grippers, and random ones, are solved for several target errors and on given grids.
Between every two events, the force of each gripper is compared with that of a march to a fifty-thousandth of the
length, and its estimated error with the difference of the two. The force is not judged if the fine march may be off by
as much according to its own estimate: a force that rings at a jump of the velocity rings faster on every finer grid.

For every setting the benchmark prints the number of judged forces; the mean share of the time at which the true error
is within the estimated one; quantiles of estimate/true, both as root mean squares over the motion; and the shares of
ratios in 0.5 to 5, and below 0.5. Then every force beyond these bounds. One thread.
"""

import argparse
import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from tqdm import tqdm

from benchmarks.catalogue import catalogue
from benchmarks.estimate import HIGH, LOW, by_setting, honesty
from benchmarks.hard.laws import windows_of
from benchmarks.machine import machine_line
from benchmarks.robot_scenes import random_scene
from dlocore import GraspReaction, Prediction, Quality, Scene, SceneError, predict, warm_up
from dlocore.answer import compared
from dlocore.answer.compared import Series, parts_of

Floats = NDArray[np.float64]

TARGETS = (1e-2, 2e-3)  # of the length
GRIDS = ((13, 19), (21, 31))
TRUE = 2e-5  # of the length: target of what they are compared with
PATIENCE = 20.0  # [s] for one solve


@dataclass(frozen=True)
class Row:
    """The force of one gripper: root mean squares [N] of it and its errors, and when the true one is within."""

    scene: str
    setting: str
    u: float
    force: float
    estimate: float
    error: float
    within: float

    @property
    def ratio(self) -> float:
        return self.estimate / self.error


def settings(length: float) -> dict[str, Quality]:
    """Return what is asked of a cable of some length."""
    asked = {f"target {100 * part:g} % of L": Quality(target_error=part * length) for part in TARGETS}
    return asked | {f"march {n_u} x {n_t}": Quality(n_u=n_u, n_t=n_t, method="march") for n_u, n_t in GRIDS}


def solved(scene: Scene, quality: Quality) -> Prediction | None:
    """Return the answer on the grid it is asked for, None where the scene has none on it, or does not converge."""
    try:
        answer = predict(replace(scene, quality=quality), deadline=PATIENCE, keep_grid=True)
    except SceneError:
        return None
    return answer if answer.status == "converged" and answer.level is not None else None


def side(answer: Prediction) -> bool:
    """Tell whether a motion starts with a bow out of its plane, which makes it another one."""
    return answer.level is not None and "side" in answer.level.posed.called_for


def series(reaction: GraspReaction) -> Series:
    """Return a force over time, with what is between each two events."""
    return Series(reaction.times, parts_of([len(part) for part in windows_of(reaction.times)]), reaction.reaction)


def apart(own: GraspReaction, true: GraspReaction) -> tuple[Floats, Floats] | None:
    """Return how far two forces are apart and the estimate of the true one's error, at the times of the first (k,)."""
    error = compared.apart(series(own), series(true))
    if error is None or true.reaction_error is None:
        return None
    return error, np.interp(own.times, true.times, true.reaction_error)


def rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


def rows(name: str, scene: Scene) -> Iterator[Row]:
    """Yield the forces of a scene that can be judged."""
    truth = solved(scene, Quality(target_error=TRUE * scene.cable.length))
    if truth is None:
        return
    for setting, quality in settings(scene.cable.length).items():
        answer = solved(scene, quality)
        if answer is None or side(answer) != side(truth):
            continue
        for own, true in zip(answer.grasps, truth.grasps, strict=True):
            distance = apart(own, true)
            if distance is None or own.reaction_error is None:
                continue
            error, unsure = distance
            if rms(error) > rms(unsure):
                force = rms(np.linalg.norm(own.reaction, axis=1))
                within = float(np.mean(error <= own.reaction_error))
                yield Row(name, setting, own.u, force, rms(own.reaction_error), rms(error), within)


def summary(found: list[Row]) -> str:
    """Return a Markdown table with a row for each setting, and one for all."""
    lines = [
        "| setting | forces | within | ratio 5 % | 50 % | 95 % | in 0.5-5 | true > 2 x estimate |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for setting, group in by_setting(found):
        within = np.mean([row.within for row in group])
        lines.append(f"| {setting} | {len(group)} | {within:.0%} | {honesty([row.ratio for row in group])} |")
    return "\n".join(lines)


def offenders(found: list[Row]) -> str:
    """Return a Markdown table of the forces beyond the bounds, the most dishonest first."""
    lines = [
        "| scene | setting | u [m] | force [N] | estimate [N] | true [N] | ratio |",
        "|---|---|---|---|---|---|---|",
    ]
    lines += [
        f"| {row.scene} | {row.setting} | {row.u:.3g} | {row.force:.3g} | {row.estimate:.2g} | {row.error:.2g} | "
        f"{row.ratio:.2f} |"
        for row in sorted(found, key=lambda row: row.ratio)
        if not LOW <= row.ratio <= HIGH
    ]
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", nargs="+", metavar="NAME", help="only scenes whose name contains one of these")
    parser.add_argument("--random", type=int, default=40, help="random scenes (default 40)")
    options = parser.parse_args()
    warm_up()
    scenes = catalogue() | {f"random {seed}": random_scene(seed) for seed in range(options.random)}
    if options.scenes:
        scenes = {n: s for n, s in scenes.items() if any(part in n for part in options.scenes)}
    shown = tqdm(scenes.items(), unit=" scenes", file=sys.stderr, disable=not sys.stderr.isatty())
    found = [row for name, scene in shown if scene.grasps for row in rows(name, scene)]
    if not found:
        print("No force could be judged.")
        return
    print(f"{summary(found)}\n\n{offenders(found)}\n\n({machine_line()})")


if __name__ == "__main__":
    main()
