"""The predictor compared with the step-by-step reference: `python -m benchmarks.reference [scene ...]`.

Each scene is solved by the march that `auto` takes for the target error, 0.1 % of the length, and by
`method="reference"` for a third of it. The table has the estimated error of the reference, the march's own estimate,
the largest distance between the two anywhere, and their times. The scenes are the example requests of the API and those
of the catalogue that are named here, in the plane and in space, with every effect that the reference has.

With `--equal-error`, times are compared at the same error: settings are found with which the reference, and a single
simulation of a rod, err as little as the march (`benchmarks/equal_error.py`).
"""

import argparse
import time
from dataclasses import replace
from typing import Any

import numpy as np

from app.schemas import PredictionRequest, to_scene
from app.schemas.request import EXAMPLES
from benchmarks.catalogue import catalogue
from benchmarks.equal_error import compare
from benchmarks.machine import machine_line
from dlocore import Prediction, Quality, Scene, predict

TARGET = 1e-3  # of the length
FINER = 3.0  # times: the reference
PATIENCE = 120.0  # [s]: the deadline of the reference
SCENES = (
    "paper case at a quarter",
    "two grippers bend a wire in the plane",
    "weightless swing with quadratic drag",
    "a force instead of a gripper",
    "ends brought together in the plane",
    "hung by one end and carried sideways",
    "two grippers carry a hanging cable",
    "clamped hanging cable with one end moved",
    "cantilever lifted and turned down",
    "whip of a hanging cord",
    "long cable with a hanging load",
    "released by one of two grippers",
    "gripper twists a bowed cable by half a turn",
    "wrist rolls a hanging bow",
    "clamped bow turned out of its plane",
    "coil memory of a cable in space",
    "wire bent for good in the plane",
    "cable dragged along itself",
    "short cable pulled slowly over a rough table",
    "fast pull over a slightly rough table",
    "dragged against a peg",
    "end lifted from the table",
    "lowered over a bar",
)


def examples() -> dict[str, Scene]:
    """Return the scenes of the API's example requests, by name."""

    def nothing_stored(run: str) -> Any:
        raise LookupError(run)

    requests = {name: PredictionRequest.model_validate(example["value"]) for name, example in EXAMPLES.items()}
    return {f"example {name}": to_scene(request, nothing_stored) for name, request in requests.items()}


def solved(scene: Scene, quality: Quality, deadline: float | None = None) -> tuple[Prediction, float]:
    """Return a prediction and the processor time that it took [s]."""
    began = time.process_time()
    prediction = predict(replace(scene, quality=quality), deadline=deadline)
    return prediction, time.process_time() - began


def distance(a: Prediction, b: Prediction) -> float:
    """Return the largest distance of two motions [m] on 65 x 101 points."""
    u, t = np.linspace(0.0, a.surface.length, 101), np.linspace(0.0, a.surface.horizon, 65)
    return float(np.linalg.norm(a.surface.positions(u, t) - b.surface.positions(u, t), axis=-1).max())


def at_equal_error(names: list[str]) -> None:
    """Print what the march, the reference and the fastest single rod take that err as little."""
    found = examples() | catalogue()
    print("lengths in mm, processor times in ms; target 0.1 % of the length")
    print(
        "| scene | march | truth moved | time | reference | time | ratio | march alone | rod | edges | time | ratio |"
    )
    print("|" + "---|" * 12)
    ratios: tuple[list[float], list[float]] = ([], [])
    for name in names or [*examples(), *SCENES]:
        equal = compare(found[name], TARGET * found[name].cable.length, PATIENCE)
        cells = [name, *(f"{1e3 * x:.3g}" for x in (equal.error, equal.unsure, equal.march))]
        if equal.reference is None:
            cells += ["not reached", "", ""]
        else:
            seconds, error = equal.reference
            ratios[0].append(seconds / equal.march)
            cells += [f"{1e3 * error:.3g}", f"{1e3 * seconds:.3g}", f"{ratios[0][-1]:.3g}"]
        cells.append(f"{1e3 * equal.alone:.3g}")
        if equal.rod is None:
            cells += ["not reached", "", "", ""]
        else:
            ratios[1].append(equal.rod.seconds / equal.alone)
            cells += [f"{1e3 * equal.rod.error:.3g}", str(equal.rod.elements)]
            cells += [f"{1e3 * equal.rod.seconds:.3g}", f"{ratios[1][-1]:.3g}"]
        print("| " + " | ".join(cells) + " |", flush=True)
    for what, of in zip(("reference over march", "single rod over march alone"), ratios, strict=True):
        if of:
            over = f"at least 100 in {sum(x >= 100.0 for x in of)} of {len(of)}"
            print(f"\n{what}: median {np.median(of):.3g}, {min(of):.2g} to {max(of):.3g}, {over}")
    print(machine_line())


def main(names: list[str]) -> None:
    found = examples() | catalogue()
    print("lengths in mm, processor times in s; target 0.1 % of the length, the reference a third of it")
    print("| scene | reference | estimate | rods to | time | march | estimate | distance | time |")
    print("|---|---|---|---|---|---|---|---|---|")
    for name in names or [*examples(), *SCENES]:
        scene, length = found[name], found[name].cable.length
        solved(scene, Quality(target_error=TARGET * length))  # compiled before it is timed
        march, spent = solved(scene, Quality(target_error=TARGET * length))
        judge, took = solved(scene, Quality(method="reference", target_error=TARGET * length / FINER), PATIENCE)
        estimates = [
            "-" if p.accuracy.error_estimate is None else f"{1e3 * p.accuracy.error_estimate:.2g}"
            for p in (judge, march)
        ]
        rods = judge.iterations[-1].note.split(" elements")[0].removeprefix("rod of ") if judge.iterations else "-"
        cells = (
            name, judge.status, estimates[0], rods, f"{took:.2g}",
            march.status, estimates[1], f"{1e3 * distance(judge, march):.2g}", f"{spent:.2g}",
        )  # fmt: skip
        print("| " + " | ".join(cells) + " |", flush=True)
    print(machine_line())


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "scenes", nargs="*", metavar="SCENE", help="names of scenes; absent: those that this file names"
    )
    parser.add_argument("--equal-error", action="store_true", help="compare times at the same error")
    options = parser.parse_args()
    scenes = options.scenes
    unknown = set(scenes) - set(examples() | catalogue())
    if unknown:
        parser.error(f"no such scene: {', '.join(sorted(unknown))}")
    solved(catalogue()[SCENES[0]], Quality(method="reference", target_error=0.1))  # compiled before it is timed
    at_equal_error(scenes) if options.equal_error else main(scenes)
