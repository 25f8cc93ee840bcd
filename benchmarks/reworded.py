"""Whether equivalent scenes have the same answer: `python -m benchmarks.reworded [--seed S] [--end N]`.

Random hard scenes are predicted as they are, and with a change that should make no difference: an obstacle far away or
beside the cable, a load of zero force, a release after the end, a gripper that takes over from another one during its
path, grasps in another order, gravity turned by 1e-7, almost no drag, effects switched on that were left out, the start
given as the control points of the answer. They are also predicted as seen from a frame that drifts or falls. The
distance between the answers is compared with the sum of both error estimates, as shares of the length.
"""

import argparse
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple, cast

import numpy as np
from numpy.typing import NDArray

from benchmarks.hard.generator import draw
from benchmarks.machine import machine_line
from dlocore import (
    Grasp,
    Load,
    Move,
    Prediction,
    Quality,
    Scene,
    SceneError,
    Sphere,
    Still,
    Waypoints,
    predict,
    warm_up,
)

Floats = NDArray[np.float64]

TARGET = 3e-3  # of the length
DEADLINES = 2.0, 4.0  # [s] as it is, and in other words
FAR = 100.0  # times the length
TURNED = 1e-7  # of gravity
LITTLE = 1e-9  # [N s^2/m^3]
CLEAR = 0.02  # of the length, between the cable and an obstacle beside it
MOMENTS = 121  # at which the path of a gripper is written down as it is seen from another frame
FARTHEST = 100.0  # lengths that a frame falls
SMALL = 1e-3  # of the length: what is less than this apart is not asked for how far it may be


class Frame(NamedTuple):
    """A frame that moves by `velocity` t + `acceleration` t^2/2, (3,) [m/s] and (3,) [m/s^2]."""

    velocity: Floats
    acceleration: Floats

    def at(self, t: Floats) -> Floats:
        """Return where it is at times (k,) [s]; (k, 3) [m]."""
        return t[:, None] * self.velocity + 0.5 * t[:, None] ** 2 * self.acceleration


AT_REST = Frame(np.zeros(3), np.zeros(3))


def reworded(scene: Scene, found: Prediction, random: np.random.Generator) -> Iterator[tuple[str, Scene, Frame]]:
    """Yield scenes that say the same as one whose answer was `found`, what was added, and how their frame moves."""
    for name, words in added(scene, found, random):
        yield name, words, AT_REST
    around, length, horizon = scene.environment, scene.cable.length, found.surface.horizon
    unhindered = around.table is None and not around.obstacles and around.drag == around.drag_quadratic == 0.0
    if not unhindered or scene.shape.settle:
        return
    gravity = cast(Floats, around.gravity)
    falls = random.uniform(0.3, 1.0) * gravity + random.normal(size=3) * length / horizon**2
    falls *= min(1.0, FARTHEST * length / (0.5 * horizon**2 * float(np.linalg.norm(falls))))
    drift = random.normal(size=3) * length / horizon
    frames = {"a frame that drifts": Frame(drift, np.zeros(3)), "a frame that falls": Frame(np.zeros(3), falls)}
    for name, frame in frames.items():
        seen = seen_from(frame, scene, found)
        if seen is not None:
            yield name, seen, frame


def seen_from(frame: Frame, scene: Scene, found: Prediction) -> Scene | None:
    """Return a scene as a frame sees it that moves the other way; None where a path jumps, turns or has waypoints."""
    horizon, grasps = found.surface.horizon, list[Grasp]()
    for g in scene.grasps:
        path = g.path
        turns = getattr(path, "rotation", None) is not None or isinstance(path, Waypoints)
        if turns or g.start >= horizon or (isinstance(path, Move) and path.profile == "linear"):
            return None
        clock = np.linspace(0.0, horizon - g.start, MOMENTS)
        way = path.at(clock, found.surface.positions(g.u, g.start)[0, 0]) + frame.at(clock + g.start)
        grasps.append(replace(g, path=Waypoints(times=clock, positions=way, start="moving")))
    shape = found.shape_at(0.0)
    velocity = np.array(shape.velocity)
    velocity[:, :3] += frame.velocity
    around = replace(scene.environment, gravity=cast(Floats, scene.environment.gravity) + frame.acceleration)
    shape = replace(shape, velocity=velocity)
    return replace(scene, shape=shape, grasps=tuple(grasps), environment=around, horizon=horizon)


def taken_over(grasp: Grasp, horizon: float) -> tuple[Grasp, Grasp] | None:
    """Return a grasp as two, of which one takes over from the other on its way; None where no path tells the rest."""
    path = grasp.path
    at = 0.5 * (grasp.start + min(grasp.release_time or horizon, horizon))
    if isinstance(path, Move) and path.profile == "linear" and path.rotation is None:
        left = path.duration - (at - grasp.start)
        if left <= 0.0:
            return None
        path = replace(path, displacement=left / path.duration * cast(Floats, path.displacement), duration=left)
    elif not isinstance(path, Still):
        return None
    return replace(grasp, release_time=at), replace(grasp, path=path, grasp_time=at)


def beside(found: Prediction, random: np.random.Generator) -> Sphere | None:
    """Return a ball that the motion comes near to, but does not touch; None where there is no room for one."""
    cable = found.scene.cable
    u, t = np.linspace(0.0, cable.length, 101), np.linspace(0.0, found.surface.horizon, 65)
    places = found.surface.positions(u, t).reshape(-1, 3)
    middle = places[random.integers(len(places))] + 0.3 * cable.length * random.normal(size=3)
    room = float(np.linalg.norm(places - middle, axis=1).min()) - 0.5 * cable.diameter - CLEAR * cable.length
    return Sphere(center=middle, radius=room) if room > CLEAR * cable.length else None


def added(scene: Scene, found: Prediction, random: np.random.Generator) -> Iterator[tuple[str, Scene]]:
    """Yield scenes with something added that changes nothing, and what that is."""
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
    gravity = cast(Floats, around.gravity)
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
    over = taken_over(scene.grasps[0], found.surface.horizon) if scene.grasps else None
    if over is not None:
        yield "a gripper that takes over", replace(scene, grasps=(*over, *scene.grasps[1:]), horizon=horizon)
    ball = beside(found, random)
    if ball is not None and around.table is None and not scene.shape.settle:
        yield "an obstacle beside it", replace(scene, environment=replace(around, obstacles=(*around.obstacles, ball)))


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
        for name, words, frame in reworded(scene, found, np.random.default_rng([options.seed, index])):
            try:
                answer = predict(words, deadline=DEADLINES[1])
            except SceneError as error:
                other[f"{name}: refused"] += 1
                print(f"{index}, {name}: {error}", flush=True)
                continue
            if answer.status != "converged":
                other[f"{name}: {answer.status}"] += 1
                continue
            away = answer.surface.positions(u, t) - frame.at(t)[:, None] - found.surface.positions(u, t)
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
