"""Predictions per second of `predict_many`: `python -m benchmarks.many [--scenes N] [--repeats N]`.

Two kinds of scenes: the paper's case, a straight cable on a frictionless table with random grasp, displacement and
bending stiffness, marched on 9 x 13 control points with and without an error estimate; and a cable that hangs between
two grippers. Each number is the median over the repeats, in which the numbers of threads take turns. Every answer is
compared bit for bit with that of one thread.
"""

import argparse
import os
import time
from collections import defaultdict

import numpy as np

from benchmarks.machine import machine_line
from dlocore import (
    Cable,
    Environment,
    Grasp,
    Move,
    Points,
    Prediction,
    Quality,
    Scene,
    Straight,
    Table,
    predict_many,
    warm_up,
)
from dlocore.machine import usable_cores


def on_table(random: np.random.Generator, *, estimate: bool) -> Scene:
    """Return a random scene like the paper's case."""
    way = (float(random.uniform(-0.2, 0.2)), float(random.uniform(0.2, 0.5)), 0.0)
    stiffness = float(10.0 ** random.uniform(-3.0, -2.0))
    return Scene(
        cable=Cable(length=1.0, diameter=0.005, linear_density=0.05, bending_stiffness=stiffness),
        shape=Straight(),
        grasps=(Grasp(u=float(random.uniform(0.0, 1.0)), path=Move(displacement=way, duration=1.6)),),
        environment=Environment(drag=0.05, table=Table()),
        quality=Quality(n_u=9, n_t=13, method="march", estimate=estimate),
    )


def hanging(random: np.random.Generator) -> Scene:
    """Return a random scene of a cable between two grippers, one of which moves."""
    u = np.linspace(0.0, 1.0, 21)[:, None]
    arc = 0.8 * u * [1.0, 0.0, 0.0] - 1.1 * u * (1.0 - u) * [0.0, 0.0, 1.0]
    way = (float(random.uniform(-0.2, 0.05)), float(random.uniform(-0.2, 0.2)), 0.0)
    return Scene(
        cable=Cable.preset("paper"),
        shape=Points(points=arc),
        grasps=(Grasp(u=0.0), Grasp(u=1.0, path=Move(displacement=way, duration=1.6))),
        environment=Environment(drag=0.05),
        quality=Quality(n_u=13, n_t=19, method="march", estimate=False),
    )


def rates(scenes: list[Scene], threads: list[int], repeats: int) -> dict[int, float]:
    """Return predictions a second by number of threads."""
    found = defaultdict(list)
    expected = [answer.surface.control_points for answer in predict_many(scenes, threads=1) if _solved(answer)]
    assert len(expected) == len(scenes)
    for _ in range(repeats):
        for count in threads:
            began = time.perf_counter()
            answers = predict_many(scenes, threads=count)
            found[count].append(len(scenes) / (time.perf_counter() - began))
            for answer, control in zip(answers, expected, strict=True):
                assert _solved(answer)
                assert np.array_equal(answer.surface.control_points, control)
    return {count: float(np.median(times)) for count, times in found.items()}


def _solved(answer: object) -> bool:
    return isinstance(answer, Prediction)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", type=int, default=2000, help="scenes of each kind (default 2000)")
    parser.add_argument("--repeats", type=int, default=7, help="timed calls (default 7)")
    options = parser.parse_args()
    warm_up()
    random = np.random.default_rng(1)
    kinds = {
        "in the plane, 9 x 13, without estimate": lambda: on_table(random, estimate=False),
        "in the plane, 9 x 13, with estimate": lambda: on_table(random, estimate=True),
        "in space, 13 x 19, without estimate": lambda: hanging(random),
    }
    threads = sorted({1, usable_cores()})
    print("| predictions a second | " + " | ".join(f"{count} threads" for count in threads) + " |")
    print("|---" * (1 + len(threads)) + "|")
    for name, make in kinds.items():
        found = rates([make() for _ in range(options.scenes)], threads, options.repeats)
        print(f"| {name} | " + " | ".join(f"{found[count]:.0f}" for count in threads) + " |")
    print(f"({machine_line()}, load {os.getloadavg()[0]:.1f} at the end)")


if __name__ == "__main__":
    main()
