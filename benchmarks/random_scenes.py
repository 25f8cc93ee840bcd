"""Run random hard scenes and count what goes wrong: exceptions, NaN, hangs, violated laws, false answers.

    python -m benchmarks.random_scenes --seed 1 --count 50000 --jobs 2 --deadline 1 --again 400 --resume scenes.jsonl

Every scene is drawn from (seed, index) alone; `--index 17` runs only scene 17 and prints it as Python. With `--again N`
all scenes are run with the short `--deadline` and judged by the laws. Of those that do not converge within it, N that
the seed draws are run again with `--again-deadline` and checked for whether they determine their motion. Without
`--again`, all that do not converge are checked. With `--last-deadline`, those that fail in this second stage are run a
third time with that deadline. With `--images`, each scene is predicted as it is and as its images: turned, mirrored,
from the other end, and in other units. Only a table of the distances between these answers is then printed.
"""

import argparse
import json
import multiprocessing
import signal
import sys
import time
from collections import Counter
from collections.abc import Iterator
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from benchmarks.hard.generator import as_python, draw
from benchmarks.hard.judge import WRONG, Whose, by_a_march, is_undetermined, left_its_grid, run, tells
from benchmarks.hard.looks import LOOKS, look
from benchmarks.hard.looks import table as table_of_images
from benchmarks.hard.shares import GROWTHS, Strata, drawn_again, has_failed, in_place_of, is_left, share, strata
from benchmarks.machine import machine_line
from dlocore import SceneError, warm_up

HANG = 6.0  # times the deadline of a prediction, after which a process is ended: one scene may have three, ...
JUDGED = 60.0  # ... and this long is left for what the judge does besides [s]


COUNTED = {
    "exceptions": ("exception",),
    "not finite": ("not finite",),
    "hangs and crashes": ("hang", "crash"),
    "refused though possible": ("refused a possible scene",),
    "impossible but converged": ("converged on an impossible scene",),
    "lies": ("lie", "undetermined and not told"),
}


class Stage(NamedTuple):
    """How scenes are run.

    Attributes:
        seed: they are drawn from.
        deadline: time that a prediction is allowed [s].
        patience: time that each further solve of the judge is allowed [s].
        checked: share that is compared with refined marches.
        measured: whose sensitivity is measured, see `judge.run`.
        images: compare each scene with its images instead of judging it.
    """

    seed: int
    deadline: float
    patience: float
    checked: float
    measured: Whose
    images: bool = False

    def run(self, index: int) -> dict[str, Any]:
        """Run a scene and return its record."""
        drawn, checked = draw(self.seed, index), is_checked(self.seed, index, self.checked)
        if self.images:
            return look(drawn, self.deadline)
        return run(drawn, self.deadline, checked, patience=self.patience, measured=self.measured)

    @property
    def longest(self) -> float:
        """Time after which a scene hangs [s]."""
        solves = 1 + len(LOOKS) if self.images else HANG
        return solves * max(self.deadline, self.patience) + JUDGED


class Job(NamedTuple):
    """A process that runs scenes, the end of its pipe, and what it runs since when."""

    process: BaseProcess
    pipe: Connection
    index: int
    since: float


def work(pipe: Connection, stage: Stage) -> None:
    """Run the scenes whose indices come through a pipe, and send their records back, until None comes."""
    while (index := pipe.recv()) is not None:
        pipe.send(stage.run(index))


def is_checked(seed: int, index: int, part: float) -> bool:
    """Tell whether a scene is among those compared with a refined march; drawn by the seed."""
    return bool(np.random.default_rng([seed, index, 1]).random() < part)


def run_all(stage: Stage, indices: list[int], jobs: int) -> Iterator[dict[str, Any]]:
    """Run scenes in `jobs` processes; end and replace those that hang or die."""
    context = multiprocessing.get_context("spawn")
    waiting = iter(indices)

    def start(index: int) -> Job:
        ours, theirs = context.Pipe()
        process = context.Process(target=work, args=(theirs, stage), daemon=True)
        process.start()
        theirs.close()
        ours.send(index)
        return Job(process, ours, index, time.monotonic())

    running = [start(index) for _, index in zip(range(jobs), waiting, strict=False)]
    try:
        while running:
            ready = wait([job.pipe for job in running], timeout=1.0)
            for job in list(running):
                late = time.monotonic() - job.since > stage.longest
                if job.pipe not in ready and not late:
                    continue
                record, alive = _take(job, job.pipe in ready, stage.seed)
                index = next(waiting, None)
                running.remove(job)
                if alive:
                    job.pipe.send(index)
                else:
                    job.process.kill()
                if index is not None:
                    running.append(job._replace(index=index, since=time.monotonic()) if alive else start(index))
                yield record
    finally:
        for job in running:
            job.process.kill()


def _take(job: Job, ready: bool, seed: int) -> tuple[dict[str, Any], bool]:
    """Return the record of a job, and whether its process can go on."""
    if not ready:
        return _lost(job.index, seed, "hang"), False
    try:
        return job.pipe.recv(), True
    except EOFError:
        return _lost(job.index, seed, "crash"), False


def _lost(index: int, seed: int, how: str) -> dict[str, Any]:
    """Return the record of a scene whose process hung or crashed, or which could not even be drawn."""
    families, possible, message = ("numbers: none",), True, ""
    try:
        drawn = draw(seed, index)
        families, possible = drawn.families, drawn.possible
    except SceneError as error:
        message = f"not drawn: {error}"
    return {
        "index": index, "families": families, "possible": possible, "status": how,
        "message": message, "seconds": 0.0, "faults": [how],
    }  # fmt: skip


def counts(records: list[dict[str, Any]]) -> list[str]:
    """Return how often happened what never may; undetermined scenes that do not tell are lies, too."""
    judged = [r for r in records if r.get("method") != "paper"]
    lines = []
    for name, faults in COUNTED.items():
        found = [r["index"] for r in judged if set(faults) & set(r["faults"])]
        lines.append(_listed(name, found))
    return lines


def _listed(name: str, found: list[int]) -> str:
    return f"{name}: {len(found)}{': ' if found else ''}{' '.join(map(str, found[:8]))}"


def in_the_end(seed: int, first: list[dict[str, Any]], again: list[dict[str, Any]]) -> list[str]:
    """Return the share that converges given the time of a later stage, by what counts as determined."""
    lines = []
    for growth in GROWTHS:
        found = strata(seed, first, again, growth)
        middle, low, high = share(found)
        ran = found.again_converged + found.again_failed + found.again_excluded
        lines += [
            f"converged in the end, but for scenes shown to amplify a change of the start more than {growth:.0e} times "
            f"({WRONG / growth * 1e6:.0f} um on a metre moves the motion by 1 % of the length): "
            f"{middle:.2%}, 95 % interval {low:.2%} to {high:.2%}",
            f"    {found.converged} converged in the first stage, {found.lost} failed for good; of {found.left} others "
            f"{ran} were run again: {found.again_converged} converged, {found.again_failed} did not, "
            f"{found.again_excluded} are left out",
            "    without those that converge by a march in place of a least squares that was asked for: "
            f"{share(strata(seed, first, again, growth, as_asked=True))[0]:.2%}",
        ]
    return lines


def summary(records: list[dict[str, Any]]) -> str:
    """Return the tables of a run of one stage."""
    lines = []
    possible = [r for r in records if r["possible"]]
    printed = [r for r in possible if r.get("method") == "paper"]
    judged = [r for r in possible if r.get("method") != "paper"]
    undetermined = [r for r in judged if is_undetermined(r)]
    told = sum(map(tells, undetermined))
    determined = [r for r in judged if not is_undetermined(r)]
    free = [r for r in determined if not r["families"][-1].endswith(("march", "grid", "odd"))]
    given = [r for r in determined if r["families"][-1].endswith(("march", "grid", "odd"))]
    lines.append(f"{len(records)} scenes, {len(possible)} of them possible, {len(printed)} of these by method paper")
    shown = [r["index"] for r in records if r.get("shown")]
    lines.append(_listed("impossible, as their motion shows", shown))
    lines.append(f"undetermined: {len(undetermined)}, {told} of them told")
    for name, part in (("of the others", determined), ("grid free", free), ("grid given", given)):
        count = sum(r["status"] == "converged" for r in part)
        _, low, high = share(Strata(count, len(part) - count, 0, 0, 0, 0))
        lines.append(f"converged, {name}: {_part(count, len(part))}, 95 % interval {low:.2%} to {high:.2%}")
    finer = sum(r["status"] == "converged" and left_its_grid(r) for r in given)
    lines.append(f"of them on finer grids than the one given, as that erred too much or failed: {finer}")
    good = [r for r in determined if r["status"] == "converged" or by_a_march(r)]
    asked = sum(not by_a_march(r) for r in good)
    lines.append(f"converged, as asked: {_part(asked, len(determined))}")
    lines.append(f"converged, as asked or by a march in place of a least squares: {_part(len(good), len(determined))}")
    steady = [r for r in judged if not is_undetermined(r, GROWTHS[1])]
    least = _part(sum(r["status"] == "converged" for r in steady), len(steady))
    lines.append(f"converged, but for those shown to amplify a start's change over {GROWTHS[1]:.0e} times: {least}")
    ended = Counter(r["status"] for r in determined if r["status"] != "converged")
    lines.append(f"the others ended: {', '.join(f'{count} {status}' for status, count in ended.most_common())}")
    seconds = np.array([r["seconds"] for r in records])
    lines.append(
        f"CPU time: median {np.median(seconds) * 1e3:.0f} ms, mean {seconds.mean() * 1e3:.0f} ms, "
        f"worst {seconds.max():.1f} s"
    )
    checked = [r for r in judged if "reference" in r]
    compared = [r for r in checked if r["reference"] == "converged" and r["status"] == "converged"]
    right = sum(r["error"] < 0.01 for r in compared)
    lines.append(
        f"compared with a refined march: {len(checked)}; both converged: {len(compared)}; "
        f"within 1 % of the length: {right}"
    )
    for name, part in (("free", free), ("given", given)):
        sure = [r for r in compared if r in part and r["apart"] <= WRONG]
        near = sum(r["error"] < WRONG for r in sure)
        lines.append(f"of those whose references agree, grid {name}, within 1 %: {_part(near, len(sure))}")
    lines += ["", "faults (scenes, first indices):"]
    found = Counter(f for r in judged + [r for r in records if not r["possible"]] for f in r["faults"])
    for fault, count in found.most_common():
        first = [r["index"] for r in records if fault in r["faults"]][:8]
        lines.append(f"  {count:6d}  {fault:34} {' '.join(map(str, first))}")
    lines += ["", "converged by family:"]
    lines += _shares(judged, lambda r: r["families"])
    lines += ["", "converged by set of effects:"]
    sets = Counter(_set(r) for r in judged if "effects" in r)
    frequent = {name for name, count in sets.items() if count >= max(3, len(judged) // 200)}
    lines += _shares([r for r in judged if "effects" in r and _set(r) in frequent], lambda r: [_set(r)])
    lines += ["", "slowest:"]
    for r in sorted(records, key=lambda r: -r["seconds"])[:10]:
        lines.append(f"  {r['seconds']:7.2f} s  {r['index']:6d}  {r['status']:14} {', '.join(r['families'])}")
    lines += ["", "impossible scenes:"]
    ends = Counter((r["families"][0], r["status"]) for r in records if not r["possible"])
    lines += [f"  {count:6d}  {name:44} {status}" for (name, status), count in sorted(ends.items())]
    return "\n".join(lines)


def _part(count: int, total: int) -> str:
    return f"{count} of {total}, {count / max(1, total):.2%}"


def _set(record: dict[str, Any]) -> str:
    return " ".join(e for e in record["effects"] if e not in ("inertia", "stretch", "bend"))


def _shares(records: list[dict[str, Any]], kinds: Any) -> list[str]:
    total: Counter[str] = Counter(kind for r in records for kind in kinds(r))
    good: Counter[str] = Counter(kind for r in records if r["status"] == "converged" for kind in kinds(r))
    return [f"  {good[kind] / total[kind]:7.1%} of {total[kind]:6d}  {kind}" for kind in sorted(total)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--jobs", type=int, default=1)
    parser.add_argument("--resume", type=Path, help="file of records to write and to continue")
    parser.add_argument("--check", type=int, default=300, help="scenes compared with a refined march")
    parser.add_argument("--deadline", type=float, default=30.0, help="time limit of a prediction [s]")
    parser.add_argument(
        "--again", type=int, default=0, help="number of scenes to run again of those that do not converge"
    )
    parser.add_argument(
        "--again-deadline", type=float, default=60.0, help="time limit of a prediction in the second run [s]"
    )
    parser.add_argument("--last-deadline", type=float, help="time limit of a third run of those that fail again [s]")
    parser.add_argument(
        "--measure", choices=("failed", "all"), default="failed",
        help="scenes whose start is disturbed in a run of one stage, in addition to those compared (default: failed)",
    )  # fmt: skip
    parser.add_argument("--images", action="store_true", help="compare each scene with its images, and do nothing else")
    parser.add_argument("--index", type=int, help="run this scene alone and print it as Python")
    parser.add_argument("--summary", action="store_true", help="only print the summary of the file")
    options = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # so that no process is left behind
    staged = options.again > 0
    if options.last_deadline is not None and not staged:
        parser.error("--last-deadline is for those that fail in a second stage: give --again too")
    patience = options.again_deadline if staged else options.deadline
    part = options.check / options.count
    if options.index is not None:
        drawn = draw(options.seed, options.index)
        record = run(drawn, options.deadline, True, patience=patience)
        if record["status"] != "refused":
            print(as_python(drawn.make()))
        print(json.dumps(record, indent=1))
        return
    records = _read(options.resume)

    def of_stage(number: int) -> list[dict[str, Any]]:
        return [r for r in records if r["stage"] == number]

    def add(stage: Stage, indices: list[int], number: int) -> list[dict[str, Any]]:
        done = {r["index"] for r in of_stage(number)}
        left = [] if options.summary else [i for i in indices if i not in done]
        if left:
            warm_up()  # so that no process compiles while its time runs
        for record in run_all(stage, left, options.jobs):
            records.append({**record, "stage": number})
            if options.resume is not None:
                with options.resume.open("a") as file:
                    file.write(json.dumps(records[-1]) + "\n")
        return of_stage(number)

    measured: Whose = "checked" if staged else options.measure
    once = Stage(options.seed, options.deadline, patience, part, measured, options.images)
    first = add(once, list(range(options.count)), 1)
    if options.images:
        print("\n".join([f"seed {options.seed}, {len(first)} scenes", "", table_of_images(first), "", machine_line()]))
        return
    again: list[dict[str, Any]] = []
    last: list[dict[str, Any]] = []
    if staged:
        left = [r["index"] for r in first if is_left(r)]
        twice = once._replace(deadline=options.again_deadline, checked=0.0, measured="all")
        again = add(twice, drawn_again(options.seed, left, options.again), 2)
        if options.last_deadline is not None:
            thrice = twice._replace(deadline=options.last_deadline)
            last = add(thrice, [r["index"] for r in again if has_failed(r)], 3)
    print("\n".join([f"seed {options.seed}", *counts(records), "", summary(first)]))
    for some, deadline in ((again, options.again_deadline), (last, options.last_deadline)):
        if some:
            again = in_place_of(again, some)
            print("\n".join(["", f"run again with {deadline:g} s:", *in_the_end(options.seed, first, again)]))
            print(summary(some))
    print(machine_line())


def _read(file: Path | None) -> list[dict[str, Any]]:
    """Return the records in a file; the last line may have been cut off."""
    if file is None or not file.exists():
        return []
    lines = file.read_text().splitlines(keepends=True)
    whole = [line for line in lines if line.endswith("\n")]
    if len(whole) < len(lines):
        file.write_text("".join(whole))
    return [json.loads(line) for line in whole]


if __name__ == "__main__":
    main()
