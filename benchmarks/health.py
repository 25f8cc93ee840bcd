"""How fast ``/health`` answers while two solves run: median, 99th percentile and worst of 1,000 requests.

    python -m benchmarks.health

Starts a separate service on the loopback address with one worker for each core. Two clients post the finest grid over
and over, and a third one requests ``/health`` every few milliseconds.
"""

import argparse
import os
import socket
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import httpx

from benchmarks.machine import machine_line

REQUESTS, CLIENTS, PAUSE = 1000, 2, 0.01  # s
SCENE = {
    "cable": {"preset": "paper"},
    "shape": {"kind": "straight"},
    "primitives": [{"u": 0.25, "path": {"kind": "move", "displacement": [0, 0.5, 0], "duration": 1.6}}],
    "environment": {"drag": 0.05, "table": {}},
    "quality": {"n_u": 129, "n_t": 513, "method": "march"},
}


@contextmanager
def service() -> Iterator[str]:
    """Serve on a free port; gives the address."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    with tempfile.TemporaryDirectory() as data:
        process = subprocess.Popen(
            [sys.executable, "-m", "app.cli", "serve", "--port", str(port)],
            env={**os.environ, "DLO_DATA_DIR": data},
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        try:
            address = f"http://127.0.0.1:{port}"
            while True:
                try:
                    if httpx.get(f"{address}/ready").status_code == 200:
                        break
                except httpx.TransportError:
                    pass
                time.sleep(0.2)
            yield address
        finally:
            process.terminate()
            process.wait(timeout=30)


def measure(address: str, solving: bool) -> list[float]:
    """Return the times of the requests in rising order [s], while solves run or not."""
    done = threading.Event()

    def solve() -> None:
        with httpx.Client(base_url=address, timeout=120) as http:
            while not done.is_set():
                http.post("/v1/predictions?store=false", json=SCENE).raise_for_status()

    threads = [threading.Thread(target=solve) for _ in range(CLIENTS if solving else 0)]
    for thread in threads:
        thread.start()
    times = []
    with httpx.Client(base_url=address, timeout=60) as http:
        for _ in range(REQUESTS):
            began = time.perf_counter()
            http.get("/health").raise_for_status()
            times.append(time.perf_counter() - began)
            time.sleep(PAUSE)
    done.set()
    for thread in threads:
        thread.join()
    return sorted(times)


def main() -> None:
    argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter).parse_args()
    """Measure and print."""
    print(f"/health, {REQUESTS} requests; {machine_line()}")
    with service() as address:
        for solving in (False, True):
            times = [1e3 * t for t in measure(address, solving)]
            what = f"{CLIENTS} solves running" if solving else "idle"
            middle = statistics.median(times)
            centile = times[int(0.99 * len(times))]
            tail = f"99 % {centile:6.2f} ms, worst {times[-1]:6.2f} ms"
            print(f"{what:18} median {middle:6.2f} ms, {tail}")


if __name__ == "__main__":
    main()
