"""How reliable the error estimate is: `python -m benchmarks.estimate [--truths FOLDER] [--scenes NAME ...]`.

Every scene of the catalogue, and random ones, are solved for several target errors and on given grids. The estimate of
each answer is compared with its true error: the largest distance, over cable and time, to a march that is refined until
it no longer changes. A motion that is unstable in its plane starts with a bow out of the plane on a free grid, and so
differs from the motion on a given grid; it is compared with an answer to a tenth of the smallest target. An answer is
judged only if the motion that it is compared with is at least five times as accurate.

For every setting the benchmark prints the number of judged answers, quantiles of estimate/true, the share of ratios in
0.5 to 5, and the share of true errors above twice the estimate; then every answer beyond these bounds. One thread.
`--truths` keeps the refined marches, which take most of the time: remove the folder when the model changes.
"""

import argparse
import json
import sys
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Protocol, TypeVar

import numpy as np
from tqdm import tqdm

from benchmarks.catalogue import catalogue
from benchmarks.machine import machine, machine_line
from benchmarks.robot_scenes import random_scene
from dlocore import Quality, Scene, SceneError, predict, warm_up
from dlocore.study.judge import Truth, as_truth, finest_march, largest_error

TARGETS = (1e-2, 3e-3, 1e-3)  # of the length
GRIDS = ((9, 13), (13, 19), (21, 31))
SURER = 5.0  # times as accurate as an answer, at least, is the truth that judges it
LOW, HIGH = 0.5, 5.0  # bounds of an honest ratio estimate/true
PATIENCE = 8.0  # [s] for the marches that make a truth, before the last
DEADLINE = 30.0  # [s] for one answer


class Answered(Protocol):
    """What was found, and the setting that was asked for."""

    @property
    def setting(self) -> str: ...


Asked = TypeVar("Asked", bound=Answered)


@dataclass(frozen=True)
class Row:
    """One answer: what was asked, what it says of its error, what the error is [m], and by how much the truth moved."""

    scene: str
    setting: str
    status: str
    method: str
    n_u: int
    n_t: int
    length: float
    estimate: float | None
    neglected: float
    error: float
    moved: float
    time: float
    estimate_time: float

    @property
    def judged(self) -> bool:
        return self.estimate is not None and self.error > SURER * self.moved

    @property
    def ratio(self) -> float:
        assert self.estimate is not None
        return self.estimate / self.error


def settings(length: float) -> dict[str, Quality]:
    """Return what is asked of a cable of some length."""
    asked = {f"target {100 * part:g} % of L": Quality(target_error=part * length) for part in TARGETS}
    asked |= {f"march {n_u} x {n_t}": Quality(n_u=n_u, n_t=n_t, method="march") for n_u, n_t in GRIDS}
    return asked | {f"spacetime {n_u} x {n_t}": Quality(n_u=n_u, n_t=n_t, method="spacetime") for n_u, n_t in GRIDS[:2]}


def truth_of(name: str, scene: Scene, folder: Path | None) -> Truth:
    """Return the converged motion of a scene, from `folder` where it was kept there."""
    file = None if folder is None else folder / f"{name.replace(' ', '_')}.npz"
    if file is not None and file.exists():
        kept = np.load(file)
        return Truth(
            positions=kept["positions"],
            moved=float(kept["moved"]),
            n_u=int(kept["n_u"]),
            n_t=int(kept["n_t"]),
            status=str(kept["status"]),  # type: ignore[arg-type]
        )
    truth = finest_march(scene, still=5e-6, patience=PATIENCE)
    if file is not None:
        file.parent.mkdir(parents=True, exist_ok=True)
        np.savez_compressed(file, **vars(truth))
    return truth


def bowed_truth(scene: Scene) -> Truth:
    """Return the motion of a scene that starts with a bow out of its plane, as free grids have it."""
    quality = Quality(target_error=0.1 * min(TARGETS) * scene.cable.length)
    return as_truth(predict(replace(scene, quality=quality)))


def rows(name: str, scene: Scene, given: Truth) -> Iterable[Row]:
    """Yield the answers to a scene, whose motion on given grids is known."""
    bowed: Truth | None = None
    for setting, quality in settings(scene.cable.length).items():
        try:
            answer = predict(replace(scene, quality=quality), deadline=DEADLINE, keep_grid=True)
        except SceneError:  # this grid has no room for the scene's features
            continue
        accuracy, truth = answer.accuracy, given
        if answer.level is not None and "side" in answer.level.posed.called_for:
            truth = bowed = bowed or bowed_truth(scene)
        yield Row(
            scene=name,
            setting=setting,
            status=answer.status,
            method=accuracy.method,
            n_u=accuracy.n_u,
            n_t=accuracy.n_t,
            length=scene.cable.length,
            estimate=accuracy.error_estimate,
            neglected=accuracy.neglected,
            error=largest_error(answer, truth),
            moved=truth.moved if truth.status == "converged" else np.inf,
            time=accuracy.wall_time,
            estimate_time=accuracy.phases.get("estimate", 0.0),
        )


def by_setting(found: list[Asked]) -> Iterator[tuple[str, list[Asked]]]:
    """Yield every setting and what was found with it, and at last all of it."""
    for setting in [*dict.fromkeys(row.setting for row in found), "all"]:
        yield setting, [row for row in found if setting in ("all", row.setting)]


def honesty(ratios: list[float]) -> str:
    """Return cells of a table: quantiles of ratios estimate/true, their share in LOW to HIGH, and that below LOW."""
    values = np.array(ratios)
    low, middle, high = np.quantile(values, [0.05, 0.5, 0.95])
    shares = f"{np.mean((values >= LOW) & (values <= HIGH)):.0%} | {np.mean(values < LOW):.1%}"
    return f"{low:.2f} | {middle:.2f} | {high:.2f} | {shares}"


def summary(found: list[Row]) -> str:
    """Return a Markdown table with a row for each setting, and one for all."""
    lines = [
        "| setting | answers | judged | ratio 5 % | 50 % | 95 % | in 0.5-5 | true > 2 x estimate | estimate's time |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for setting, group in by_setting(found):
        judged = [row for row in group if row.judged]
        if not judged:
            continue
        shares = [row.estimate_time / row.time for row in group if row.estimate_time]
        part = f"{np.median(shares):.0%}" if shares else "-"
        honest = honesty([row.ratio for row in judged])
        lines.append(f"| {setting} | {len(group)} | {len(judged)} | {honest} | {part} |")
    return "\n".join(lines)


def offenders(found: list[Row]) -> str:
    """Return a Markdown table of the judged answers beyond the bounds, the most dishonest first."""
    lines = [
        "| scene | setting | grid | status | estimate [mm] | of it neglected | true [mm] | ratio |",
        "|---|---|---|---|---|---|---|---|",
    ]
    beyond = [row for row in found if row.judged and not LOW <= row.ratio <= HIGH]
    lines += [
        f"| {row.scene} | {row.setting} | {row.n_u} x {row.n_t} | {row.status} | {1e3 * (row.estimate or 0.0):.3g} | "
        f"{1e3 * row.neglected:.2g} | {1e3 * row.error:.3g} | {row.ratio:.2f} |"
        for row in sorted(beyond, key=lambda row: row.ratio)
    ]
    return "\n".join(lines)


def unjudged(found: list[Row]) -> str:
    """Return why the other answers were not judged."""
    silent = sorted({row.scene for row in found if row.estimate is None})
    rest = [row for row in found if row.estimate is not None and not row.judged]
    scenes = {row.scene: row for row in rest}
    text = f"{len(silent)} scenes with answers that have no estimate: {', '.join(silent) or '-'}.\n"
    listed = ", ".join(f"{name} (truth moved {1e3 * row.moved:.2g} mm)" for name, row in scenes.items())
    return text + f"{len(rest)} answers too close to their truth to be judged, of: {listed or '-'}."


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenes", nargs="+", metavar="NAME", help="only scenes whose name contains one of these")
    parser.add_argument("--random", type=int, default=40, help="random scenes (default 40)")
    parser.add_argument("--first", type=int, default=0, help="seed of the first random scene (default 0)")
    parser.add_argument("--truths", type=Path, metavar="FOLDER", help="keep the converged motions in this folder")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write every answer to this file")
    options = parser.parse_args()
    warm_up()
    seeds = range(options.first, options.first + options.random)
    scenes = catalogue() | {f"random {seed}": random_scene(seed) for seed in seeds}
    if options.scenes:
        scenes = {n: s for n, s in scenes.items() if any(part in n for part in options.scenes)}
    found: list[Row] = []
    for name, scene in tqdm(scenes.items(), unit=" scenes", file=sys.stderr, disable=not sys.stderr.isatty()):
        try:
            truth = truth_of(name, scene, options.truths)
        except SceneError as error:
            print(f"{name}: {error}")
            continue
        found += rows(name, scene, truth)
    print(summary(found))
    print()
    print(offenders(found))
    print()
    print(unjudged(found))
    print(machine_line())
    if options.json:
        content = {"machine": machine(), "rows": [asdict(row) for row in found]}
        options.json.write_text(json.dumps(content, indent=1))


if __name__ == "__main__":
    main()
