"""Whether a continued motion equals an unbroken one: `python -m benchmarks.chained [--seed S] [--begin N] [--end N]`.

Random hard scenes are predicted as a whole and in two parts; the second part starts from `shape_at` at the end of the
first. In the second part the grippers stand still if all paths have ended by then; otherwise they follow the rest of
their paths. Over the time of the second part, the distance between the two motions is compared with the sum of the
three error estimates, both as shares of the length.
"""

import argparse
from dataclasses import replace

import numpy as np

from benchmarks.hard.generator import draw
from benchmarks.machine import machine_line
from dlocore import ControlPoints, Grasp, Prediction, Quality, Scene, SceneError, Still, Waypoints, predict, warm_up
from dlocore.scene.paths import Path
from dlocore.shape.shape import start_curve

TARGET = 3e-3  # of the length
DEADLINE = 2.0  # [s] for each of the three
LATEST = 0.8  # of the horizon: where paths end later the motion is split in their middle
SMALL = 1e-3  # of the length: what is less than this apart is not asked for how far it may be
POSES = 257  # of the rest of a path


def split_time(scene: Scene) -> float:
    """Return the time [s] at which a motion is split: as its paths have ended, or half-way."""
    ended = max([0.3 * scene.horizon, *(g.start + g.path.duration for g in scene.grasps)])
    return ended if ended <= LATEST * scene.horizon else 0.5 * scene.horizon


def rest_of(path: Path, since: float, begin: np.ndarray) -> Path | None:
    """Return what is left of a path after `since` [s], from `begin` (3,) [m] on; None where it still turns."""
    if since >= path.duration:
        return Still()
    if path.rotation_at(np.zeros(1)) is not None:
        return None
    t = np.linspace(since, path.duration, POSES)
    positions = path.at(t, np.zeros(3))
    return Waypoints(times=t - since, positions=begin + positions - positions[0], start="moving")


def later(scene: Scene, t: float, shape: ControlPoints) -> Scene | None:
    """Return the rest of a scene after `t` [s], None where it can't be told."""
    curve = start_curve(shape, scene.cable.length)
    grasps = []
    for g in scene.grasps:
        if g.release_time is not None and g.release_time <= t:
            continue
        release = None if g.release_time is None else g.release_time - t
        if g.start > t:
            grasps.append(replace(g, grasp_time=g.start - t, release_time=release))
            continue
        path = rest_of(g.path, t - g.start, curve(g.u)[0])
        if path is None:
            return None
        grasps.append(Grasp(u=g.u, hold=g.hold, path=path, release_time=release))
    return replace(scene, shape=shape, grasps=tuple(grasps), horizon=scene.horizon - t)


def parts(seed: int, index: int) -> tuple[Prediction, Prediction, Prediction] | str:
    """Return the whole motion of a random scene and its two parts, or why they are not compared."""
    drawn = draw(seed, index)
    if not drawn.possible:
        return "not asked"
    try:
        scene = drawn.make()
        if scene.loads:
            return "not asked"
        scene = replace(scene, quality=Quality(target_error=TARGET * scene.cable.length))
        t = split_time(scene)
        if any(abs(at - t) < 1e-3 for g in scene.grasps for at in (g.grasp_time, g.release_time) if at is not None):
            return "not asked"
        whole = predict(scene, deadline=DEADLINE)
        first = predict(replace(scene, horizon=t), deadline=DEADLINE)
        if not whole.status == first.status == "converged":
            return "no success before"
        rest = later(scene, t, first.shape_at())
        if rest is None:
            return "not asked"
        second = predict(rest, deadline=DEADLINE)
    except SceneError as error:
        return f"refused: {error}"
    return (whole, first, second) if second.status == "converged" else f"second part {second.status}"


def compare(whole: Prediction, first: Prediction, second: Prediction) -> tuple[float, float]:
    """Return how far the second part is from the whole motion, and the estimates' sum, in parts of the length."""
    length, begin = whole.scene.cable.length, first.surface.horizon
    u, t = np.linspace(0.0, length, 65), np.linspace(0.0, second.surface.horizon, 33)
    off = np.linalg.norm(whole.surface.positions(u, begin + t) - second.surface.positions(u, t), axis=-1).max()
    told = sum(p.accuracy.error_estimate or 0.0 for p in (whole, first, second))
    return float(off / length), told / length


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=105)
    parser.add_argument("--begin", type=int, default=0, help="first index (default 0)")
    parser.add_argument("--end", type=int, default=1000, help="index after the last (default 1000)")
    options = parser.parse_args()
    warm_up()
    rows, why = list[tuple[float, float]](), dict[str, int]()
    for index in range(options.begin, options.end):
        found = parts(options.seed, index)
        if isinstance(found, str):
            why[found.split(":")[0]] = why.get(found.split(":")[0], 0) + 1
            if found.startswith(("refused", "second part stalled")):
                print(f"{index}: {found}", flush=True)
            continue
        off, told = compare(*found)
        rows.append((off, told))
        if off > max(2.0 * told, SMALL):
            notes = " ".join(p.message for p in found)
            aside = "given a side" if "as likely" in notes else ""
            print(f"{index}: {off:.2e} apart, estimates {told:.1e} together {aside}", flush=True)
    apart = np.array(rows).reshape(-1, 2)
    print(f"{len(apart)} compared; " + ", ".join(f"{name}: {count}" for name, count in sorted(why.items())))
    if len(apart):
        print("apart, of the length: median {:.1e}, 90 % {:.1e}, largest {:.1e}".format(
            *np.quantile(apart[:, 0], [0.5, 0.9, 1.0])))  # fmt: skip
    print(machine_line())


if __name__ == "__main__":
    main()
