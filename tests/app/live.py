"""A service in a process of its own, for tests of connections and signals."""

import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import httpx

from tests.app.conftest import ROOT


@dataclass(frozen=True)
class Live:
    """A running service: its address, its process, and the file of its log."""

    url: str
    process: subprocess.Popen[str]
    log: Path


SERVE = ("app.cli", "serve")


@contextmanager
def serving(directory: Path, command: Sequence[str] = SERVE, **settings: str) -> Iterator[Live]:
    """Serve on a free port with the given ``DLO_`` settings; killed at the end unless it has stopped."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    log = directory / "log"
    variables = {f"DLO_{name.upper()}": value for name, value in settings.items()}
    with log.open("w") as errors:
        process = subprocess.Popen(
            [sys.executable, "-m", *command, "--port", str(port)],
            env={**os.environ, "DLO_DATA_DIR": str(directory / "data"), **variables},
            cwd=ROOT,
            stdout=subprocess.DEVNULL,
            stderr=errors,
            text=True,
        )
    url = f"http://127.0.0.1:{port}"
    try:
        give_up = time.monotonic() + 540
        while not _ready(url):
            assert process.poll() is None, log.read_text()
            assert time.monotonic() < give_up
            time.sleep(0.1)
        yield Live(url, process, log)
    finally:
        process.kill()
        process.wait()


def _ready(url: str) -> bool:
    try:
        return httpx.get(f"{url}/ready").status_code == 200
    except httpx.TransportError:
        return False
