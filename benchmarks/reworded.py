"""Whether scenes that say the same have the same answer: `python -m benchmarks.reworded [--seed S] [--end N]`.

Random hard scenes are predicted as they are, and with something added that changes nothing: an obstacle far away, a
load of no force, a release after the end, grasps in another order, a gravity that is turned by 1e-7, next to no drag,
effects switched on that were left out, the start as the control points of the answer. The answers are compared, in
parts of the length, with the sum of both estimates.
"""

import os

os.environ.update(OMP_NUM_THREADS="1", OPENBLAS_NUM_THREADS="1", MKL_NUM_THREADS="1", VECLIB_MAXIMUM_THREADS="1")

import argparse
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from typing import cast

import numpy as np
from numpy.typing import NDArray

from benchmarks.hard.generator import draw
from benchmarks.machine import machine_line
from dlocore import Load, Prediction, Quality, Scene, SceneError, Sphere, predict, warm_up

TARGET = 3e-3  # of the length
DEADLINES = 2.0, 4.0  # [s] as it is, and in other words
FAR = 100.0  # times the length
TURNED = 1e-7  # of gravity
LITTLE = 1e-9  # [N s^2/m^3]
SMALL = 1e-3  # of the length: what is less than this apart is not asked for how far it may be


def reworded(scene: Scene, found: Prediction, random: np.random.Generator) -> Iterator[tuple[str, Scene]]:
    """Yield scenes that say the same as one whose answer was `found`, and what was added."""
    around, length, horizon = scene.environment, scene.cable.length, scene.horizon
    way = (0.0, 0.0, -FAR * length) if around.table is None else (FAR * length, 0.0, 0.0)
    far = Sphere(center=way, radius=0.1 * length)
    yield "an obstacle far away", replace(scene, environment=replace(around, obstacles=(*around.obstacles, far)))
    load = Load(u=float(random.uniform(0.0, length)), force=(0.0, 0.0, 0.0))
    yield "a load of no force", replace(scene, loads=(*scene.loads, load))
    if scene.grasps:
        after = 1.0 + cast(float, horizon)
        held = tuple(g if g.release_time is not None else replace(g, release_time=after) for g in scene.grasps)
        yield "a release after the end", replace(scene, grasps=held, horizon=horizon)
    if len(scene.grasps) > 1:
        yield "another order of grasps", replace(scene, grasps=scene.grasps[::-1], horizon=horizon)
    gravity = cast(NDArray[np.float64], around.gravity)
    if around.table is None and gravity.any():  # without weight any little turns what nothing holds from turning
        off = TURNED * float(np.linalg.norm(gravity)) * random.normal(size=3)
        yield "gravity turned a little", replace(scene, environment=replace(around, gravity=gravity + off))
    drag = replace(around, drag_quadratic=around.drag_quadratic + LITTLE)
    yield "next to no drag", replace(scene, environment=drag)
    for effect in ("twist", "inertia", "self_contact"):
        if scene.effects.get(effect, "auto") == "auto":
            yield f"{effect} switched on", replace(scene, effects={**scene.effects, effect: "on"})
    if not scene.shape.settle:
        yield "its start as control points", replace(scene, shape=found.shape_at(0.0), horizon=horizon)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=112)
    parser.add_argument("--begin", type=int, default=0, help="first index (default 0)")
    parser.add_argument("--end", type=int, default=300, help="index after the last (default 300)")
    options = parser.parse_args()
    warm_up()
    scenes, same, apart, other = 0, Counter[str](), Counter[str](), Counter[str]()
    for index in range(options.begin, options.end):
        try:
            drawn = draw(options.seed, index)
            scene = drawn.make()
            length = scene.cable.length
            scene = replace(scene, quality=Quality(target_error=TARGET * length))
            found = predict(scene, deadline=DEADLINES[0])
        except SceneError:
            continue
        if not drawn.possible or found.status != "converged":
            continue
        scenes += 1
        u, t = np.linspace(0.0, length, 65), np.linspace(0.0, found.surface.horizon, 65)
        for name, words in reworded(scene, found, np.random.default_rng([options.seed, index])):
            try:
                answer = predict(words, deadline=DEADLINES[1])
            except SceneError as error:
                other[f"{name}: refused"] += 1
                print(f"{index}, {name}: {error}", flush=True)
                continue
            if answer.status != "converged":
                other[f"{name}: {answer.status}"] += 1
                continue
            away = answer.surface.positions(u, t) - found.surface.positions(u, t)
            off = float(np.linalg.norm(away, axis=-1).max()) / length
            told = sum(p.accuracy.error_estimate or 0.0 for p in (found, answer)) / length
            (apart if off > max(2.0 * told, SMALL) else same)[name] += 1
            if off > max(2.0 * told, SMALL):
                print(f"{index}, {name}: {off:.2e} apart, estimates {told:.1e}; {answer.message}", flush=True)
    print(f"{scenes} scenes, {same.total() + apart.total()} compared, {apart.total()} farther apart than told")
    for name in sorted(same | apart):
        print(f"  {name}: {same[name]} the same, {apart[name]} not")
    print("no success in other words: " + ", ".join(f"{name} {count}" for name, count in sorted(other.items())))
    print(machine_line())


if __name__ == "__main__":
    main()
