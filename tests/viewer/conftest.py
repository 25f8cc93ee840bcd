import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass

import httpx
import pytest
import uvicorn
from fastapi import FastAPI

from app.main import create_app
from app.settings import Settings

MOST_SCENES = 4


@dataclass(frozen=True)
class Service:
    """A running service: its address and its application."""

    address: str
    app: FastAPI

    @property
    def socket(self) -> str:
        return self.address.replace("http", "ws") + "/scene"


@pytest.fixture(scope="session")
def service(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Service]:
    settings = Settings(
        data_dir=tmp_path_factory.mktemp("data"), allowed_origins=("https://friend.example",), max_scenes=MOST_SCENES
    )
    app = create_app(settings)
    server = uvicorn.Server(uvicorn.Config(app, port=0, log_level="warning", ws_per_message_deflate=False))
    thread = threading.Thread(target=server.run)
    thread.start()
    while not server.started:
        time.sleep(0.01)
    address = f"http://127.0.0.1:{server.servers[0].sockets[0].getsockname()[1]}"
    give_up = time.monotonic() + 540
    while httpx.get(f"{address}/ready").status_code != 200:
        assert time.monotonic() < give_up, "the service did not get ready"
        time.sleep(0.1)
    yield Service(address, app)
    server.should_exit = True
    thread.join(20)
    assert not thread.is_alive(), "the service did not stop"
