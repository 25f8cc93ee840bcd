"""schemathesis against the live service: whatever is sent, the answer is one that the OpenAPI document describes."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.app.live import serving

CONFIG = Path(__file__).parent / "schemathesis.toml"
# An answer with store=false carries an id and is no resource: reading it gives 404, which one check takes for a loss.
CHECKS = ["--checks=all", "--exclude-checks=ensure_resource_availability"]
OPTIONS = [*CHECKS, "--max-examples=12", "--seed=1", "--request-timeout=30", "--generation-database=none"]


@pytest.mark.slow
def test_every_answer_is_as_described_whatever_is_sent(tmp_path: Path) -> None:
    with serving(tmp_path, time_limit="5") as live:  # so that the odd hard scene among the examples costs little
        command = [sys.executable, "-m", "schemathesis.cli", "--config-file", str(CONFIG), "run", *OPTIONS]
        address = f"{live.url}/openapi.json"
        done = subprocess.run([*command, address], capture_output=True, text=True, timeout=500, cwd=tmp_path)
        log = live.log.read_text()
    assert done.returncode == 0, done.stdout[-20_000:] + done.stderr
    assert '"level": "error"' not in log
