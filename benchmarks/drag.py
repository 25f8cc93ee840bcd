"""Latency of the 3D scene: the time from a drag of a target to the prediction that shows it.

    python -m benchmarks.drag [--seconds 15] [--json FILE]

Starts the service and opens its 3D scene by the websocket, as a browser does. Drags the target of the paper's case
along a circle with 20 inputs per second, as the client's page sends them, and records for every input when the first
picture arrives that shows this input or a newer one. Then plays the motion and counts the poses per second.
"""

import argparse
import json
import math
import os
import time
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.health import service
from benchmarks.machine import machine_line
from tests.viewer.protocol_client import SceneClient

RATE = 20.0  # inputs a second
RADIUS = 0.12  # m, of the circle
TURN = 4.0  # s, for one round: targets 9 mm apart
SAME = 2e-3  # m between a target and the gripped point in the picture of it
GRIPPED = 12  # column of the drawn surface at u = 0.25 m


def target(k: int) -> tuple[float, float]:
    """Return the target of input `k` [m]."""
    angle = 2.0 * math.pi * k / (RATE * TURN)
    return 0.25 + RADIUS * math.sin(angle), 0.45 + RADIUS * math.cos(angle)


def dragged(client: SceneClient, seconds: float) -> dict[str, Any]:
    """Drag for `seconds`; return the latencies [ms] and the rate of new pictures."""
    sent: list[float] = []
    shown: list[float] = []  # when each input was in the picture, or a newer one
    pictures = 0
    client.drag("start")
    began = time.perf_counter()
    count = int(RATE * seconds)
    while len(shown) < count and time.perf_counter() - began < seconds + 10.0:
        now = time.perf_counter()
        if len(sent) < count and now >= began + len(sent) / RATE:
            client.drag("update", *target(len(sent)))
            sent.append(now)
        due = began + len(sent) / RATE if len(sent) < count else now + 0.1
        frames = client.frames
        client.take_one(max(due - time.perf_counter(), 0.0005))
        if client.frames == frames:
            continue
        arrived = time.perf_counter()
        gripped = client.final_shape[GRIPPED, :2]
        waiting = [k for k in range(len(shown), len(sent)) if np.hypot(*(gripped - target(k))) < SAME]
        if waiting:
            pictures += 1
            shown += [arrived] * (waiting[-1] + 1 - len(shown))
    client.drag("end")
    latency = 1e3 * (np.array(shown) - np.array(sent[: len(shown)]))
    return {
        "inputs": len(sent),
        "answered": len(shown),
        "pictures_per_second": pictures / (shown[-1] - began) if shown else 0.0,
        "latency_ms": {f"p{q}": float(np.percentile(latency, q)) for q in (50, 90, 95, 99)},
    }


def played(client: SceneClient, seconds: float) -> float:
    """Return how many poses of the cable a second come while the motion plays slowly."""
    client.set("Speed", "¼×")
    poses: set[bytes] = set()
    began = time.perf_counter()
    while time.perf_counter() - began < seconds:
        client.take_one(0.05)
        poses.add(client.cable.tobytes())
    return len(poses) / (time.perf_counter() - began)


def main() -> None:
    """Measure, and print what was found."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=float, default=15.0, help="duration of dragging")
    parser.add_argument("--json", type=Path, help="file to write the numbers to")
    options = parser.parse_args()
    with service() as address:
        found = measured(address, options.seconds)
    latency = found["drag"]["latency_ms"]
    print(machine_line())
    print(
        f"{found['drag']['inputs']} inputs at {RATE:g}/s: "
        + ", ".join(f"{name} {value:.1f} ms" for name, value in latency.items())
        + f"; {found['drag']['pictures_per_second']:.1f} new predictions a second"
    )
    print(f"playback: {found['poses_per_second']:.1f} poses a second; load average {found['load_average']:.2f}")
    if options.json is not None:
        options.json.write_text(json.dumps({"machine": machine_line(), **found}, indent=1) + "\n")


def measured(address: str, seconds: float) -> dict[str, Any]:
    """Return what a client of the service at `address` sees."""
    with SceneClient(address.replace("http", "ws") + "/scene") as client:
        client.wait_for(lambda: 'data-status="converged"' in client.card and "/cable" in client.nodes, timeout=60.0)
        dragged(client, 1.0)  # what is done for the first time takes longer
        client.refined()
        drag = dragged(client, seconds)
        client.refined()
        load = os.getloadavg()[0]
        return {"drag": drag, "poses_per_second": played(client, 4.0), "load_average": load}


if __name__ == "__main__":
    main()
