"""The service under load, out of time, and around the predictions."""

import json
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import anyio
import httpx
import numpy as np
import pytest
from fastapi.testclient import TestClient

from app.http.problems import ProblemError
from app.main import create_app
from app.schemas import PredictionRequest, to_scene
from app.service import service
from app.service.worker import Worker
from app.settings import Settings
from dlocore import Cancelled
from tests.app.conftest import ROOT, SLOW, paper_scene, start
from tests.app.test_bad_requests import the_problem


def scene_of(request: dict[str, Any]) -> Any:
    return to_scene(PredictionRequest.model_validate(request), lambda id: None)


def test_a_prediction_is_created_at_an_address(client: TestClient) -> None:
    response = client.post("/v1/predictions", json=paper_scene())
    assert response.status_code == 201
    assert response.headers["content-type"] == "application/json"
    assert response.headers["location"] == response.json()["links"]["self"]
    assert client.get(response.headers["location"]).content == response.content


def test_a_full_queue_is_answered_with_when_to_try_again(tmp_path: Path) -> None:
    settings = Settings(data_dir=tmp_path, workers=1, queue_size=1)
    with TestClient(create_app(settings)) as client:
        start(client)
        answers: list[httpx.Response] = []
        threads = [
            threading.Thread(target=lambda: answers.append(client.post("/v1/predictions", json=SLOW))) for _ in range(6)
        ]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        statuses = sorted(response.status_code for response in answers)
        assert statuses.count(201) >= 2  # the one that ran and the one that waited
        assert statuses.count(429) >= 1
        assert statuses.count(201) + statuses.count(429) == 6
        refused = next(response for response in answers if response.status_code == 429)
        the_problem(refused, 429)
        assert int(refused.headers["retry-after"]) >= 1
        assert client.post("/v1/predictions", json=paper_scene()).status_code == 201  # the queue is empty again


def test_a_solve_beyond_the_time_limit_offers_its_best_iterate(tmp_path: Path) -> None:
    with TestClient(create_app(Settings(data_dir=tmp_path, time_limit=0.05))) as client:
        problem = the_problem(start(client).post("/v1/predictions", json=SLOW), 504)
        best = client.get(problem["prediction"])
        assert best.status_code == 200
        assert best.json()["status"] == "time_limit"
        assert np.isfinite(best.json()["surface"]["positions"]).all()


class Asked(threading.Event):
    """A wish to cancel that comes up while the solve looks for it the `at`-th time, and counts the looks."""

    def __init__(self, at: int) -> None:
        super().__init__()
        self.at, self.looks = at, 0

    def is_set(self) -> bool:
        self.looks += 1
        return super().is_set() or self.looks >= self.at


def test_a_cancelled_solve_stops_at_its_next_look() -> None:
    async def run(cancelled: Asked) -> None:
        await Worker(workers=1, queue_size=0, time_limit=60.0).solve(scene_of(SLOW), cancelled)

    whole, cancelled = Asked(at=sys.maxsize), Asked(at=5)
    anyio.run(run, whole)
    with pytest.raises(ProblemError, match="cancelled"):
        anyio.run(run, cancelled)
    assert cancelled.looks == 5 < whole.looks / 3


def test_a_worker_shutting_down_cancels_and_refuses() -> None:
    async def run() -> None:
        worker = Worker(workers=1, queue_size=1, time_limit=60.0)

        async def solve() -> None:
            with pytest.raises(ProblemError, match="cancelled"):
                await worker.solve(scene_of(SLOW), threading.Event())

        async with anyio.create_task_group() as tasks:
            tasks.start_soon(solve)
            await anyio.sleep(0.05)
            worker.close()
            worker.cancel_all()
        with pytest.raises(ProblemError, match="shutting down"):
            worker.admit()

    anyio.run(run)


def test_a_full_queue_tells_when_those_before_will_be_done() -> None:
    worker = Worker(workers=1, queue_size=1, time_limit=60.0)
    worker._mean_time = 10.0
    for _ in range(2):
        worker.admit()
    with pytest.raises(ProblemError, match=r"Try again in 20 s") as refused:
        worker.admit()
    assert (refused.value.status, refused.value.headers) == (429, {"Retry-After": "20"})


def test_it_is_healthy_before_it_is_ready(tmp_path: Path) -> None:
    app = create_app(Settings(data_dir=tmp_path))
    with TestClient(app) as client:
        start(client)
        app.state.service.ready = False
        assert client.get("/health").json()["status"] == "ok"
        the_problem(client.get("/ready"), 503)
        refused = client.post("/v1/predictions", json=paper_scene())
        the_problem(refused, 503)
        assert int(refused.headers["retry-after"]) >= 1


def test_a_first_compile_is_told_of_and_stops_with_the_service(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    ended = threading.Event()

    def compile_for_minutes(cancelled: Callable[[], bool]) -> None:
        while not cancelled():
            time.sleep(0.01)
        ended.set()
        raise Cancelled

    monkeypatch.setattr(service, "warm_up", compile_for_minutes)
    app = create_app(Settings(data_dir=tmp_path))
    with TestClient(app) as client:
        app.state.service.compiled = False
        first = client.get("/ready")
        assert "minutes" in the_problem(first, 503)["detail"]
        app.state.service.compiled = True
        later = client.get("/ready")
        assert "seconds" in the_problem(later, 503)["detail"]
        assert int(first.headers["retry-after"]) > int(later.headers["retry-after"]) >= 1
        assert client.portal is not None
        client.portal.call(app.state.service.stop)
        assert ended.wait(5.0)
        assert "shutting down" in the_problem(client.get("/ready"), 503)["detail"]


def test_presets_are_listed_with_their_sources(client: TestClient) -> None:
    cables = client.get("/v1/cables").json()["cables"]
    assert {"paper", "black-wire"} <= {cable["name"] for cable in cables}
    for cable in cables:
        assert cable["source"]
        assert client.post("/v1/predictions", json=paper_scene(cable={"preset": cable["name"]})).status_code == 201


def test_openapi_describes_every_field_with_an_example(client: TestClient) -> None:
    document = client.get("/openapi.json").json()
    schemas = document["components"]["schemas"]
    for name, schema in schemas.items():
        for field, part in schema.get("properties", {}).items():
            if "const" not in part:
                shown = json.dumps(part)
                assert part.get("description") or "$ref" in part, f"{name}.{field}"
                assert "examples" in shown or "$ref" in shown, f"{name}.{field}"
    post = document["paths"]["/v1/predictions"]["post"]
    assert len(post["requestBody"]["content"]["application/json"]["examples"]) >= 3
    assert "PredictionResponse" in json.dumps(post["responses"]["201"])
    for path in document["paths"].values():
        for operation in path.values():
            for status, response in operation["responses"].items():
                if int(status) >= 400:
                    assert list(response["content"]) == ["application/problem+json"]
    open_to_all = {"/health", "/ready"}
    for address, path in document["paths"].items():
        for operation in path.values():
            assert ("401" in operation["responses"]) == (address not in open_to_all), address
    references = set(_references(document))
    assert {reference.rsplit("/", 1)[1] for reference in references} <= set(schemas)


def _references(node: Any) -> Iterator[str]:
    if isinstance(node, dict):
        for key, value in node.items():
            if key == "$ref":
                yield value
            else:
                yield from _references(value)
    elif isinstance(node, list):
        for item in node:
            yield from _references(item)


def test_the_docs_load_nothing_from_elsewhere(client: TestClient) -> None:
    page = client.get("/docs")
    assert page.status_code == 200
    assert "cdn" not in page.text
    for part in page.text.split('"'):
        if part.endswith((".js", ".css")):
            assert client.get(part).status_code == 200
    policy = page.headers["content-security-policy"]
    assert "default-src 'self'" in policy
    assert "http" not in policy


def test_another_origin_is_allowed_only_where_it_is_named(tmp_path: Path, client: TestClient) -> None:
    headers = {"origin": "https://lab.example"}
    assert "access-control-allow-origin" not in client.get("/health", headers=headers).headers
    settings = Settings(data_dir=tmp_path, allowed_origins=("https://lab.example",))
    allowed = TestClient(create_app(settings)).get("/health", headers=headers)
    assert allowed.headers["access-control-allow-origin"] == "https://lab.example"


def test_settings_come_from_the_environment(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("DLO_PORT", "9123")
    monkeypatch.setenv("DLO_ALLOWED_ORIGINS", '["https://lab.example"]')
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    monkeypatch.delenv("DLO_DATA_DIR", raising=False)
    settings = Settings()
    assert settings.port == 9123
    assert settings.allowed_origins == ("https://lab.example",)
    assert settings.data_dir == tmp_path / "dlo"
    assert settings.host == "127.0.0.1"


def test_serve_answers_on_its_port_and_stops_when_told(tmp_path: Path) -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    process = subprocess.Popen(
        [sys.executable, "-m", "app.cli", "serve", "--port", str(port)],
        env={**os.environ, "DLO_DATA_DIR": str(tmp_path), "PYTHONUNBUFFERED": "1"},
        cwd=ROOT,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    try:
        with httpx.Client(base_url=f"http://127.0.0.1:{port}", timeout=30) as http:
            give_up = time.monotonic() + 540
            while True:
                assert process.poll() is None
                assert time.monotonic() < give_up
                try:
                    if http.get("/ready").status_code == 200:
                        break
                except httpx.TransportError:
                    pass
                time.sleep(0.1)
            assert http.post("/v1/predictions", json=paper_scene()).status_code == 201
            with pytest.raises(httpx.ReadTimeout):  # a client that gives up
                http.post("/v1/predictions", json=SLOW, timeout=0.05)
            time.sleep(0.3)
            assert len(http.get("/v1/predictions").json()["predictions"]) == 1  # its solve was cancelled, not stored
        process.send_signal(signal.SIGTERM)
        output, _ = process.communicate(timeout=20)
        assert f"http://127.0.0.1:{port}/docs" in output
        assert f"http://127.0.0.1:{port}/scene/" in output
    finally:
        process.kill()
        process.wait()
