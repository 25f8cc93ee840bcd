import json
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from fastapi.testclient import TestClient

from app.main import create_app
from app.settings import Settings

ROOT = Path(__file__).parent.parent.parent
SCENES = Path(__file__).parent / "scenes"


def contract_scene(name: str) -> dict[str, Any]:
    scene: dict[str, Any] = json.loads((SCENES / f"{name}.json").read_text())
    return scene


def paper_scene(**parts: Any) -> dict[str, Any]:
    """Return the paper's case at quality "auto", with the given top-level parts replaced."""
    return {**contract_scene("paper-fig1"), "quality": "auto", **parts}


SLOW = paper_scene(quality={"n_u": 129, "n_t": 257, "method": "march"}, effects={"twist": "on"})  # most of a second


def put(scene: dict[str, Any], path: str, value: Any) -> dict[str, Any]:
    """Return a deep copy of `scene` with the value at `path` (keys and indices joined by dots) replaced."""
    scene = json.loads(json.dumps(scene))
    *parents, last = [int(key) if key.isdigit() else key for key in path.split(".")]
    node: Any = scene
    for key in parents:
        node = node[key]
    if value is ABSENT:
        del node[last]
    elif isinstance(node, list) and last == len(node):
        node.append(value)
    else:
        node[last] = value
    return scene


class _Absent:
    """Stands for a field that is left out; its name is the same in every process, as parallel tests need."""

    def __repr__(self) -> str:
        return "absent"


ABSENT = _Absent()


def start(client: TestClient) -> TestClient:
    """Wait until the service is ready; its kernels may have to be compiled."""
    give_up = time.monotonic() + 540
    while client.get("/ready").status_code != 200:
        assert time.monotonic() < give_up, "the service did not get ready"
        time.sleep(0.1)
    return client


@pytest.fixture(scope="session")
def client(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    settings = Settings(data_dir=tmp_path_factory.mktemp("data"))
    with TestClient(create_app(settings), raise_server_exceptions=False) as client:
        yield start(client)


@pytest.fixture(scope="session")
def answer(client: TestClient) -> dict[str, Any]:
    """The stored prediction of the paper's case; tests only read it."""
    response = client.post("/v1/predictions", json=paper_scene())
    assert response.status_code == 201, response.text
    document: dict[str, Any] = response.json()
    return document
