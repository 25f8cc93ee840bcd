"""Run random hard scenes and count what goes wrong: exceptions, NaN, hangs, broken laws, answers that lie.

    python -m benchmarks.random_scenes --seed 1 --count 50000 --jobs 2 --resume random-scenes.jsonl

Every scene is drawn from (seed, index) alone; `--index 17` runs that one and prints it as Python.
"""

import argparse
import json
import multiprocessing
import os
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
from benchmarks.hard.judge import WRONG, converges, is_undetermined, run
from benchmarks.machine import machine_line
from dlocore import SceneError, warm_up

HANG = 6.0  # times the deadline of a prediction, after which a process is ended: one scene may have three, ...
JUDGED = 60.0  # ... and this long is left for what the judge does besides [s]


class Job(NamedTuple):
    """A process that runs scenes, the end of its pipe, and what it runs since when."""

    process: BaseProcess
    pipe: Connection
    index: int
    since: float


def work(pipe: Connection, seed: int, share: float, deadline: float) -> None:
    """Run the scenes whose indices come through a pipe, and send their records back, until None comes."""
    while (index := pipe.recv()) is not None:
        pipe.send(run(draw(seed, index), deadline, is_checked(seed, index, share)))


def is_checked(seed: int, index: int, share: float) -> bool:
    """Tell whether a scene is among those compared with a refined march; drawn by the seed."""
    return bool(np.random.default_rng([seed, index, 1]).random() < share)


def run_all(seed: int, indices: list[int], jobs: int, share: float, deadline: float) -> Iterator[dict[str, Any]]:
    """Run scenes in `jobs` processes; end and replace those that hang or die."""
    context = multiprocessing.get_context("spawn")
    waiting = iter(indices)

    def start(index: int) -> Job:
        ours, theirs = context.Pipe()
        process = context.Process(target=work, args=(theirs, seed, share, deadline), daemon=True)
        process.start()
        theirs.close()
        ours.send(index)
        return Job(process, ours, index, time.monotonic())

    running = [start(index) for _, index in zip(range(jobs), waiting, strict=False)]
    try:
        while running:
            ready = wait([job.pipe for job in running], timeout=1.0)
            for job in list(running):
                late = time.monotonic() - job.since > HANG * deadline + JUDGED
                if job.pipe not in ready and not late:
                    continue
                record, alive = _take(job, job.pipe in ready, seed)
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


def summary(records: list[dict[str, Any]]) -> str:
    """Return the tables of a run."""
    lines = []
    possible = [r for r in records if r["possible"]]
    printed = [r for r in possible if r.get("method") == "paper"]
    judged = [r for r in possible if r.get("method") != "paper"]
    undetermined = [r for r in judged if is_undetermined(r)]
    told = sum(r["status"] != "converged" or (r["estimate"] or 0.0) > WRONG for r in undetermined)
    determined = [r for r in judged if not is_undetermined(r)]
    free = [r for r in determined if not r["families"][-1].endswith(("march", "grid", "odd"))]
    given = [r for r in determined if r["families"][-1].endswith(("march", "grid", "odd"))]
    lines.append(f"{len(records)} scenes, {len(possible)} of them possible, {len(printed)} of these by method paper")
    lines.append(f"undetermined: {len(undetermined)}, {told} of them told")
    for name, part in (("of the others", determined), ("grid free", free), ("grid given", given)):
        converged = sum(r["status"] == "converged" for r in part)
        lines.append(f"converged, {name}: {converged} of {len(part)}, {converged / max(1, len(part)):.2%}")
    either = sum(converges(r) for r in determined)
    share = f"{either} of {len(determined)}, {either / max(1, len(determined)):.2%}"
    lines.append(f"converged, as asked or to 1 % of the length on a free grid: {share}")
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
    parser.add_argument("--resume", type=Path, help="file of records to write, and to go on from")
    parser.add_argument("--check", type=int, default=300, help="scenes compared with a refined march")
    parser.add_argument("--deadline", type=float, default=30.0, help="seconds that a prediction is allowed")
    parser.add_argument("--index", type=int, help="run this scene alone and print it as Python")
    parser.add_argument("--summary", action="store_true", help="only print the summary of the file")
    options = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))  # so that no process is left behind
    os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"
    share = options.check / options.count
    if options.index is not None:
        drawn = draw(options.seed, options.index)
        record = run(drawn, options.deadline, True)
        if record["status"] != "refused":
            print(as_python(drawn.make()))
        print(json.dumps(record, indent=1))
        return
    records: list[dict[str, Any]] = []
    if options.resume is not None and options.resume.exists():
        records = [json.loads(line) for line in options.resume.read_text().splitlines()]
    done = {r["index"] for r in records}
    left = [] if options.summary else [i for i in range(options.count) if i not in done]
    if left:
        warm_up()  # so that no process compiles while its time runs
    for record in run_all(options.seed, left, options.jobs, share, options.deadline):
        records.append(record)
        if options.resume is not None:
            with options.resume.open("a") as file:
                file.write(json.dumps(record) + "\n")
    print(f"seed {options.seed}")
    print(summary(records))
    print(machine_line())


if __name__ == "__main__":
    main()
