"""What `like` saves in predicting a similar scene: `python -m benchmarks.again [--random N] [--scenes NAME ...]`.

Every scene of the catalogue in which a gripper moves, and random ones, are predicted. They are then predicted again
with the target of the gripper moved by 1 % of the length: from the beginning (`predict(scene)`), and reusing what is
known (`predict(scene, like=known)`). Times are medians of three. The error is the largest distance to a march that is
refined until it no longer changes; it is judged only if that march is at least five times as accurate. One thread.
"""

import argparse
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from tqdm import tqdm

from benchmarks.catalogue import catalogue
from benchmarks.estimate import DEADLINE, HIGH, LOW, PATIENCE, SURER
from benchmarks.machine import machine_line
from benchmarks.paper_case import paper_scene
from benchmarks.robot_scenes import random_scene
from dlocore import Move, Prediction, Quality, Scene, SceneError, predict, warm_up
from dlocore.study.judge import Truth, finest_march, largest_error

ASKED: dict[str, Callable[[float], Quality]] = {
    "target 0.3 % of L": lambda length: Quality(target_error=3e-3 * length),
    "march 13 x 19": lambda length: Quality(n_u=13, n_t=19, method="march"),
}
WAY = 0.01  # of the length, by which a target is moved
REPEATS = 3


@dataclass(frozen=True)
class Row:
    """One scene and setting: times [s], estimates and errors [m], each from the beginning and from what is known."""

    setting: str
    times: tuple[float, float]
    estimates: tuple[float | None, float | None]
    errors: tuple[float, float]
    sure: float
    kept: bool


def moved(scene: Scene, random: np.random.Generator) -> Scene | None:
    """Return the scene with one target moved sideways, or None where no gripper moves."""
    movers = [i for i, g in enumerate(scene.grasps) if isinstance(g.path, Move)]
    if not movers:
        return None
    grasps = list(scene.grasps)
    grasp = grasps[movers[-1]]
    assert isinstance(grasp.path, Move)
    angle = random.uniform(0.0, 2.0 * np.pi)
    way = WAY * scene.cable.length * np.array([np.cos(angle), np.sin(angle), 0.0])
    path = replace(grasp.path, displacement=tuple(np.asarray(grasp.path.displacement) + way))
    grasps[movers[-1]] = replace(grasp, path=path)
    return replace(scene, grasps=tuple(grasps))


def timed(solve: Callable[[], Prediction], repeats: int = REPEATS) -> tuple[float, Prediction]:
    times = []
    for _ in range(repeats):
        began = time.thread_time()
        prediction = solve()
        times.append(time.thread_time() - began)
    return float(np.median(times)), prediction


def row(setting: str, scene: Scene, other: Scene, truth: Truth) -> Row:
    """Measure one setting of one scene and the other that is like it."""
    quality = ASKED[setting](scene.cable.length)
    known = predict(replace(scene, quality=quality), deadline=DEADLINE, keep_grid=True)
    new = replace(other, quality=quality)
    from_beginning, fresh = timed(partial(predict, new, deadline=DEADLINE, keep_grid=True))
    from_known, again = timed(partial(predict, new, like=known, deadline=DEADLINE, keep_grid=True))
    return Row(
        setting=setting,
        times=(from_beginning, from_known),
        estimates=(fresh.accuracy.error_estimate, again.accuracy.error_estimate),
        errors=(largest_error(fresh, truth), largest_error(again, truth)),
        sure=truth.moved if truth.status == "converged" else np.inf,
        kept="Solved from the beginning" not in again.message,
    )


def table(rows: list[Row]) -> str:
    """Return a Markdown table with a row for each setting."""
    lines = [
        "| setting | scenes | went on | times as fast, median (5 %, 95 %) | in 0.5-5 afresh | going on | "
        "true > 2 x estimate afresh | going on |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for setting in ASKED:
        group = [r for r in rows if r.setting == setting]
        kept = [r for r in group if r.kept]
        gains = np.array([r.times[0] / r.times[1] for r in kept])
        low, middle, high = np.quantile(gains, [0.05, 0.5, 0.95])
        inside, below = [], []
        for side in (0, 1):
            judged = [(r.estimates[side], r.errors[side]) for r in kept if r.errors[side] > SURER * r.sure]
            ratios = np.array([estimate / error for estimate, error in judged if estimate is not None])
            inside.append(f"{np.mean((ratios >= LOW) & (ratios <= HIGH)):.0%} of {len(ratios)}")
            below.append(f"{np.mean(ratios < 0.5):.1%}")
        lines.append(
            f"| {setting} | {len(group)} | {len(kept)} | {middle:.1f} ({low:.1f}, {high:.1f}) | {inside[0]} | "
            f"{inside[1]} | {below[0]} | {below[1]} |"
        )
    return "\n".join(lines)


def paper_case() -> str:
    """Return what a target moved by 1 cm takes in the paper's case, in words."""
    times = []
    for bending in (1e-3, 1e-2):
        for grasp in (0.0, 0.25, 0.5, 0.8):
            scene = paper_scene(bending, grasp, Quality(n_u=9, n_t=13, method="march"))
            known, new = predict(scene), moved(scene, np.random.default_rng(1))
            assert new is not None
            pairs = [timed(partial(predict, new, like=start), 41)[0] for start in (None, known)]
            times.append(pairs)
    fresh, again = 1e3 * np.median(times, axis=0)
    return f"The paper's case, 9 x 13, target moved by 1 cm: {again:.2f} ms, from the beginning {fresh:.2f} ms."


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", nargs="+", metavar="NAME", help="only scenes whose name contains one of these")
    parser.add_argument("--random", type=int, default=30, help="random scenes (default 30)")
    options = parser.parse_args()
    warm_up()
    print(paper_case())
    scenes = catalogue() | {f"random {seed}": random_scene(seed) for seed in range(options.random)}
    if options.scenes:
        scenes = {n: s for n, s in scenes.items() if any(part in n for part in options.scenes)}
    rows: list[Row] = []
    for i, (name, scene) in enumerate(tqdm(scenes.items(), file=sys.stderr, disable=not sys.stderr.isatty())):
        other = moved(scene, np.random.default_rng(i))
        if other is None:
            continue
        try:
            truth = finest_march(other, still=5e-6, patience=PATIENCE)
        except SceneError as error:
            print(f"{name}: {error}")
            continue
        for setting in ASKED:
            try:
                rows.append(row(setting, scene, other, truth))
            except SceneError:  # this grid has no room for the scene's features
                continue
    print(table(rows))
    print(machine_line())


if __name__ == "__main__":
    main()
