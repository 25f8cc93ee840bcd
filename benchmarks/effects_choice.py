"""What the automatic choice of effects costs and saves: `python -m benchmarks.effects_choice [--scenes NAME ...]`.

Every scene of the catalogue is solved with the automatically chosen effects and with all effects on, to the same target
error of 0.2 % of the length. Then each effect is left out of a scene that calls for it. Both tables are Markdown. Times
are the processor's, medians of whole calls of `predict` after a first one that is not counted. One thread.
"""

import argparse
import os
import time
from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from benchmarks.catalogue import catalogue
from benchmarks.machine import machine_line
from dlocore import Prediction, Scene, SceneError, SplineSurface, predict, warm_up
from dlocore.scene.scene import EFFECTS

WITHIN = 0.01  # of the length: two answers that are no farther apart count as the same
DEADLINE = 60.0  # [s] for one solve
PATIENCE = 20.0  # [s] for the repeats of one scene

# a scene that calls for the effect; without axial stiffness a cable has no length, so that stretch is always simulated
CALLS_FOR = {
    "inertia": "whip of a hanging cord",
    "drag": "weightless swing with quadratic drag",
    "damping": "whip of a hanging cord",
    "gravity": "two grippers carry a hanging cable",
    "bend": "two grippers bend a wire in the plane",
    "twist": "clamped bow turned out of its plane",
    "plasticity": "wire bent for good in the plane",
    "table": "cable dropped onto the table",
    "friction": "seen cable moved at its middle and released",
    "obstacles": "pushed sideways into a wall",
    "self_contact": "pinched hairpin on a table",
}


@dataclass(frozen=True)
class Timed:
    """A prediction and the median processor time of a whole call [s]; or why the scene was refused."""

    prediction: Prediction | None
    median: float
    refused: str = ""

    @property
    def status(self) -> str:
        """The status in a word."""
        return "refused" if self.prediction is None else self.prediction.status


def measured(scene: Scene, repeats: int) -> Timed:
    """Solve once uncounted, then up to `repeats` times as long as patience lasts, but once at least."""
    try:
        prediction = predict(scene, deadline=DEADLINE)
    except SceneError as error:
        return Timed(None, np.nan, str(error))
    times: list[float] = []
    while len(times) < repeats and (not times or sum(times) < PATIENCE):
        began = time.process_time()
        prediction = predict(scene, deadline=DEADLINE)
        times.append(time.process_time() - began)
    return Timed(prediction, float(np.median(times)))


def apart(a: SplineSurface, b: SplineSurface) -> float:
    """Return the largest distance of two surfaces of the same cable and horizon, on 33 x 101 points [m]."""
    return float(np.linalg.norm(a.sample()[2][..., :3] - b.sample()[2][..., :3], axis=-1).max())


def choice_rows(scenes: dict[str, Scene], repeats: int) -> Iterable[tuple[list[str], float | None, float | None]]:
    """Yield for each scene the cells of its row, the distance as a part of the length, and the ratio of the times."""
    for name, scene in scenes.items():
        chosen = measured(scene, repeats)
        full = measured(replace(scene, effects=dict.fromkeys(EFFECTS, "on")), repeats)
        distance = ratio = None
        if chosen.prediction is not None and full.prediction is not None:
            distance = apart(chosen.prediction.surface, full.prediction.surface) / scene.cable.length
            ratio = full.median / chosen.median
        active = chosen.prediction.effects if chosen.prediction is not None else ()
        cells = [
            name,
            chosen.status if chosen.status == full.status else f"{chosen.status}, {full.status}",
            f"{1e3 * chosen.median:.1f}",
            f"{1e3 * full.median:.1f}",
            "-" if ratio is None else f"{ratio:.1f}",
            "-" if distance is None else f"{100 * distance:.2f}",
            ", ".join(effect.name for effect in active if effect.active) or chosen.refused or "-",
        ]
        yield cells, distance, ratio


def print_choice(scenes: dict[str, Scene], repeats: int) -> None:
    """Print what the automatic choice does on each scene, and in how many it does not matter."""
    print("| scene | status | chosen [ms] | all on [ms] | ratio | distance [% of L] | chosen effects |")
    print("|---|---|---|---|---|---|---|")
    distances, ratios = [], []
    for cells, distance, ratio in choice_rows(scenes, repeats):
        print("| " + " | ".join(cells) + " |", flush=True)
        if distance is not None and ratio is not None:
            distances.append(distance)
            ratios.append(ratio)
    print()
    if not distances:
        print("No scene was solved both ways.")
        return
    same = sum(distance <= WITHIN for distance in distances)
    print(
        f"{same} of {len(distances)} scenes are within {WITHIN:.0%} of the length ({same / len(distances):.0%}); "
        f"with everything on a solve takes {np.median(ratios):.1f} times as long (median), "
        f"from {min(ratios):.1f} to {max(ratios):.1f} times."
    )


def print_effects(scenes: dict[str, Scene], repeats: int) -> None:
    """Print what each effect costs, and what leaving it out does to the shape."""
    print("| effect | scene | with [ms] | added [ms] | largest distance without it [mm] |")
    print("|---|---|---|---|---|")
    for effect, name in CALLS_FOR.items():
        if name not in scenes:
            continue
        scene = scenes[name]
        present = measured(replace(scene, effects={effect: "on"}), repeats)
        absent = measured(replace(scene, effects={effect: "off"}), repeats)
        if present.prediction is None or absent.prediction is None:
            print(f"| {effect} | {name} | {present.refused or absent.refused} | - | - |", flush=True)
            continue
        distance = apart(present.prediction.surface, absent.prediction.surface)
        added = 1e3 * (present.median - absent.median)
        print(
            f"| {effect} | {name} | {1e3 * present.median:.1f} | {added:+.1f} | {1e3 * distance:.3g} |",
            flush=True,
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", nargs="+", metavar="NAME", help="only scenes whose name contains one of these")
    parser.add_argument("--repeats", type=int, default=5, help="most timed calls of each scene (default 5)")
    options = parser.parse_args()
    warm_up()
    scenes = catalogue()
    if options.scenes:
        scenes = {n: s for n, s in scenes.items() if any(part in n for part in options.scenes)}
    print_choice(scenes, options.repeats)
    print()
    print_effects(scenes, options.repeats)
    print()
    print(f"{machine_line()}, load average {os.getloadavg()[0]:.1f} after.")


if __name__ == "__main__":
    main()
