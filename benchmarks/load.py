"""Load on the service: `python -m benchmarks.load [--seconds 30] [--clients 32] [--predictions 2000] [--json FILE]`.

Starts the service on a free port of this machine, with a data directory of its own. First it requests `--predictions`
predictions of the paper's case one after another on a few connections, and measures the memory and threads of the
service before and after them. Then `--clients` clients send requests for `--seconds`, each as soon as its last one is
answered: every answer must be a 201, or a 429 if there are more requests than the queue holds. Ends with an error if an
answer is neither, or if memory or threads grew.
"""

import argparse
import asyncio
import json
import os
import socket
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import httpx
import numpy as np

from benchmarks.machine import machine, machine_line

SCENE = {
    "cable": {"length": 1.0, "diameter": 0.005, "linear_density": 0.05, "bending_stiffness": 1e-3},
    "shape": {"kind": "straight", "start": [0, 0, 0], "direction": [1, 0, 0]},
    "primitives": [
        {"u": 0.25, "hold": "point", "path": {"kind": "move", "displacement": [0, 0.5, 0], "duration": 1.6}}
    ],
    "environment": {"drag": 0.05, "table": {"height": 0.0, "friction": 0.0}},
    "quality": {"n_u": 9, "n_t": 13, "delta": 1e-5},
}
STORED = 200  # runs that the service keeps: full, and evicting, before the memory is first measured
STEADY = 4  # connections of the predictions that memory is measured over
LEAK = 10.0  # MB by which memory may differ: the heap's arenas settle by a few
START = 240.0  # s; the solver may have to be compiled
CLIENTS, SECONDS, PREDICTIONS = (1, 256), (1.0, 600.0), (100, 20_000)  # bounds


@dataclass(frozen=True)
class State:
    """Memory [MB] and threads of a process."""

    memory: float
    threads: int


@dataclass(frozen=True)
class Load:
    """What many clients saw: answers by status, predictions a second, latency of these [ms] by percentile."""

    clients: int
    seconds: float
    answers: dict[str, int]
    throughput: float
    latency: dict[str, float]


@contextmanager
def service(data: Path) -> Iterator[tuple[str, int]]:
    """Run the service; give its address and process id."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    command = [sys.executable, "-m", "uvicorn", "--factory", "app.main:create_app", "--port", str(port)]
    command += ["--log-level", "warning"]
    environment = {**os.environ, "DLO_DATA_DIR": str(data), "DLO_MAX_RUNS": str(STORED)}
    environment |= dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    process = subprocess.Popen(command, env=environment, cwd=Path(__file__).parents[1])
    try:
        address = f"http://127.0.0.1:{port}"
        give_up = time.monotonic() + START
        while not _is_ready(address):
            if process.poll() is not None or time.monotonic() > give_up:
                raise SystemExit("The service did not get ready.")
            time.sleep(0.2)
        yield address, process.pid
    finally:
        process.terminate()
        process.wait(30)


def _is_ready(address: str) -> bool:
    try:
        return httpx.get(f"{address}/ready").status_code == 200
    except httpx.TransportError:
        return False


def state(pid: int) -> State:
    """Return the memory and the threads of a process, from what Linux tells of it."""
    lines = dict(line.split(":", 1) for line in Path(f"/proc/{pid}/status").read_text().splitlines())
    return State(int(lines["VmRSS"].split()[0]) / 1024, int(lines["Threads"]))


async def predictions(address: str, count: int) -> Counter[str]:
    """Ask for `count` predictions on a few connections; return the answers by status."""
    answers: Counter[str] = Counter()
    left = iter(range(count))
    async with httpx.AsyncClient(base_url=address, timeout=60) as client:

        async def ask() -> None:
            for _ in left:
                answers[str((await client.post("/v1/predictions", json=SCENE)).status_code)] += 1

        await asyncio.gather(*(ask() for _ in range(STEADY)))
    return answers


async def load(address: str, clients: int, seconds: float) -> Load:
    """Ask on `clients` connections for `seconds`, each as soon as its last answer is there."""
    answers: Counter[str] = Counter()
    latencies: list[float] = []
    limits = httpx.Limits(max_connections=clients, max_keepalive_connections=clients)
    async with httpx.AsyncClient(base_url=address, timeout=60, limits=limits) as client:
        began = time.perf_counter()

        async def ask() -> None:
            while (asked := time.perf_counter()) - began < seconds:
                try:
                    status = (await client.post("/v1/predictions", json=SCENE)).status_code
                except httpx.TransportError as error:
                    answers[type(error).__name__] += 1
                    continue
                answers[str(status)] += 1
                if status == 201:
                    latencies.append(1e3 * (time.perf_counter() - asked))
                elif status == 429:
                    await asyncio.sleep(0.1)

        await asyncio.gather(*(ask() for _ in range(clients)))
        took = time.perf_counter() - began
    percentiles = {f"p{q}": float(np.percentile(latencies, q)) for q in (50, 90, 95, 99, 100)} if latencies else {}
    return Load(clients, took, dict(answers), len(latencies) / took, percentiles)


def bounded(low: float, high: float, kind: type) -> Any:
    """Return a reader of numbers from `low` to `high`."""

    def read(text: str) -> Any:
        value = kind(text)
        if not low <= value <= high:
            raise argparse.ArgumentTypeError(f"{text} is not from {low:g} to {high:g}")
        return value

    return read


def show(before: State, after: State, count: int, steady: Counter[str], run: Load) -> str:
    """Return the results in words."""
    latency = ", ".join(f"{name} {value:.0f} ms" for name, value in run.latency.items())
    return "\n".join(
        [
            f"memory and threads over {count} predictions (answers {dict(steady)}, at most {STORED} runs stored):",
            f"  before {before.memory:7.1f} MB, {before.threads} threads",
            f"  after  {after.memory:7.1f} MB, {after.threads} threads",
            f"{run.clients} clients for {run.seconds:.1f} s: answers {run.answers}",
            f"  {run.throughput:.1f} predictions/s; latency {latency}",
            machine_line(),
        ]
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--seconds", type=bounded(*SECONDS, float), default=30.0, help="duration of the load (default 30)"
    )
    parser.add_argument("--clients", type=bounded(*CLIENTS, int), default=32, help="clients at once (default 32)")
    parser.add_argument(
        "--predictions", type=bounded(*PREDICTIONS, int), default=2000, help="predictions (default 2000)"
    )
    parser.add_argument("--json", type=Path, help="file to write every result to")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as data, service(Path(data)) as (address, pid):
        asyncio.run(predictions(address, STORED + 100))
        before = state(pid)
        steady = asyncio.run(predictions(address, options.predictions))
        after = state(pid)
        run = asyncio.run(load(address, options.clients, options.seconds))
    print(show(before, after, options.predictions, steady, run))
    if options.json:
        content = {"machine": machine(), "before": asdict(before), "after": asdict(after), "load": asdict(run)}
        options.json.write_text(json.dumps(content, indent=1))
    wrong = {status for status in (*steady, *run.answers) if status not in ("201", "429")}
    if wrong:
        raise SystemExit(f"The service answered {', '.join(sorted(wrong))}.")
    if after.memory - before.memory > LEAK or after.threads > before.threads:
        raise SystemExit("The service leaks: memory or threads grew.")


if __name__ == "__main__":
    main()
