"""The token, the log, the metrics, and how the service stops."""

import json
import signal
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import httpx
import pytest
from fastapi.testclient import TestClient
from pydantic import ValidationError
from starlette.websockets import WebSocketDisconnect

from app.main import create_app
from app.settings import Settings
from tests.app.conftest import SLOW, paper_scene, put, start
from tests.app.live import SERVE, serving
from tests.app.test_bad_requests import the_problem
from tests.app.test_jobs import parsed

TOKEN = "a token that is hard to guess"
BEARER = {"authorization": f"Bearer {TOKEN}"}


@pytest.fixture(scope="module")
def guarded(tmp_path_factory: pytest.TempPathFactory) -> Iterator[TestClient]:
    origins = ("https://lab.example",)
    settings = Settings(data_dir=tmp_path_factory.mktemp("data"), token=TOKEN, allowed_origins=origins)
    with TestClient(create_app(settings)) as client:
        start(client)
        yield client


@pytest.mark.parametrize(
    "address", ["/", "/docs", "/openapi.json", "/metrics", "/scene/", "/rerun/", "/v1/predictions", "/v1/cables", "/no"]
)
def test_every_address_asks_for_the_token(guarded: TestClient, address: str) -> None:
    problem = guarded.get(address)
    the_problem(problem, 401)
    assert problem.headers["www-authenticate"].startswith("Bearer")
    assert TOKEN not in problem.text
    for wrong in ("Bearer", "Bearer x", f"Basic {TOKEN}", TOKEN, f"Bearer {TOKEN}x", "Bearer \xff"):
        assert guarded.get(address, headers={"authorization": wrong.encode("latin-1")}).status_code == 401
    assert guarded.get(address, headers=BEARER).status_code in (200, 404)


def test_the_scene_asks_for_the_token_too(guarded: TestClient) -> None:
    with pytest.raises(WebSocketDisconnect), guarded.websocket_connect("/scene", subprotocols=["viser-v1.1.1"]):
        pass
    with guarded.websocket_connect("/scene", subprotocols=["viser-v1.1.1"], headers=BEARER):
        pass


def test_health_needs_no_token(guarded: TestClient) -> None:
    assert guarded.get("/health").status_code == guarded.get("/ready").status_code == 200


def test_a_browser_gets_in_by_the_token_in_an_address_once(guarded: TestClient) -> None:
    welcome = guarded.get("/docs", params={"token": TOKEN, "a": "b c"}, follow_redirects=False)
    assert welcome.status_code == 303
    assert welcome.headers["location"] == "/docs?a=b+c"
    cookie = welcome.headers["set-cookie"]
    assert "HttpOnly" in cookie
    assert "SameSite=strict" in cookie
    assert TOKEN not in cookie
    value = cookie.split(";")[0]
    guarded.cookies.clear()
    assert guarded.get("/docs", headers={"cookie": value}).status_code == 200
    assert guarded.get("/docs", headers={"cookie": value[:-1]}).status_code == 401
    away = guarded.get("//evil.example/", params={"token": TOKEN}, follow_redirects=False)
    assert not away.headers["location"].startswith("//")
    guarded.cookies.clear()
    assert guarded.post("/v1/predictions", params={"token": TOKEN}, json=paper_scene()).status_code == 401


def test_another_origin_may_ask_for_leave_without_the_token(guarded: TestClient) -> None:
    asks = {
        "origin": "https://lab.example",
        "access-control-request-method": "POST",
        "access-control-request-headers": "authorization, content-type, prefer",
    }
    leave = guarded.options("/v1/predictions", headers=asks)
    assert leave.status_code == 200
    assert leave.headers["access-control-allow-origin"] == "https://lab.example"
    evil = {**asks, "origin": "https://evil.example", "access-control-request-method": "PUT"}
    problem = the_problem(guarded.options("/v1/predictions", headers=evil), 400)
    assert problem["type"].endswith("preflight-refused")
    assert "CORS origin, method. Allowed: origins https://lab.example; methods GET, POST, DELETE" in problem["detail"]
    assert "prefer" in problem["detail"]
    answer = guarded.get("/v1/predictions", headers={**BEARER, "origin": "https://lab.example"})
    assert "Location" in answer.headers["access-control-expose-headers"]


@pytest.mark.parametrize(
    ("given", "meant"),
    [
        ("https://lab.example/", "https://lab.example"),
        ("HTTPS://Lab.Example:443", "https://lab.example"),
        ("http://lab.example:8080", "http://lab.example:8080"),
        ("http://[::1]:80/", "http://[::1]"),
        ("chrome-extension://abcdef", "chrome-extension://abcdef"),
        ("*", "*"),
        ("null", "null"),
    ],
)
def test_an_allowed_origin_is_taken_as_browsers_send_it(given: str, meant: str) -> None:
    assert Settings(allowed_origins=(given,)).allowed_origins == (meant,)


@pytest.mark.parametrize(
    "given",
    ["lab.example", "https://lab.example/app", "https://", "https://*.lab.example", "https://me@lab.example", ""],
)
def test_an_allowed_origin_that_no_browser_sends_is_refused(given: str) -> None:
    with pytest.raises(
        ValidationError, match="is not an origin such as https://host or http://host:port, without a path"
    ):
        Settings(allowed_origins=("https://lab.example", given))


LOCAL, ALLOWED, SCENE = "http://127.0.0.1:8000", "https://lab.example", "ws://127.0.0.1:8000/scene"


def connecting(data_dir: Path, **settings: Any) -> TestClient:
    """Return a client that connects to a loopback address; the solver is not started."""
    return TestClient(create_app(Settings(data_dir=data_dir, **settings)), base_url=LOCAL)


@pytest.fixture(scope="module")
def local(tmp_path_factory: pytest.TempPathFactory) -> TestClient:
    return connecting(tmp_path_factory.mktemp("data"), allowed_origins=(ALLOWED,))


def refusal_of_the_scene(client: TestClient, headers: dict[str, str]) -> int:
    with pytest.raises(WebSocketDisconnect) as end, client.websocket_connect(SCENE, headers=headers):
        pass
    return end.value.code


@pytest.mark.parametrize(
    "host", ["evil.example", "evil.example:8000", "127.0.0.1.evil.example", "[::1", "@", "10.0.0.1", "testserver"]
)
def test_a_page_whose_name_leads_here_for_a_moment_is_refused(local: TestClient, host: str) -> None:
    for address in ("/", "/docs", "/v1/cables", "/scene/", "/v1/calibration", "/no"):
        problem = the_problem(local.get(address, headers={"host": host}), 403)
        assert problem["type"].endswith("unknown-host")
        assert "Allowed: localhost, a loopback address, lab.example." in problem["detail"]
    assert refusal_of_the_scene(local, {"host": host}) == 1008
    assert local.get("/health", headers={"host": host}).status_code != 403


@pytest.mark.parametrize(
    "host", ["localhost", "LOCALHOST:8000", "127.0.0.1:8000", "127.8.8.8", "[::1]:8000", "lab.example"]
)
def test_names_of_this_machine_and_of_allowed_origins_are_known(local: TestClient, host: str) -> None:
    assert local.get("/v1/cables", headers={"host": host}).status_code == 200


@pytest.mark.parametrize(
    "settings", [{"token": TOKEN}, {"host": "0.0.0.0"}, {"allowed_origins": ("*",)}], ids=["token", "open", "all"]
)
def test_any_name_will_do_with_a_token_on_an_open_address_or_where_all_are_allowed(
    tmp_path: Path, settings: dict[str, Any]
) -> None:
    headers = {"host": "dlo.example", "origin": "https://dlo.example", **BEARER}
    client = connecting(tmp_path, **settings)
    assert client.get("/v1/cables", headers=headers).status_code == 200
    assert client.post("/v1/cables", headers=headers).status_code == 405


@pytest.mark.parametrize("origin", ["https://evil.example", "http://127.0.0.1:9000", "null", ""])
def test_what_changes_something_is_refused_to_pages_of_other_sites(local: TestClient, origin: str) -> None:
    headers = {"origin": origin}
    for method in ("POST", "DELETE"):
        problem = the_problem(local.request(method, "/v1/calibration", headers=headers), 403)
        assert problem["type"].endswith("other-origin")
        assert "Allowed: that of the service's own pages, https://lab.example." in problem["detail"]
    assert local.get("/v1/cables", headers=headers).status_code == 200
    assert refusal_of_the_scene(local, headers) == 1008


@pytest.mark.parametrize("headers", [{}, {"origin": LOCAL}, {"origin": ALLOWED}], ids=["none", "its own", "allowed"])
def test_programs_and_its_own_pages_may_change_something(local: TestClient, headers: dict[str, str]) -> None:
    assert local.post("/v1/cables", headers=headers).status_code == 405
    assert refusal_of_the_scene(local, {"host": "127.0.0.1:8000", **headers}) == 1013  # the scene is not running


def samples(text: str) -> dict[str, float]:
    return {line.rsplit(" ", 1)[0]: float(line.rsplit(" ", 1)[1]) for line in text.splitlines() if line[:1] != "#"}


def test_what_was_solved_is_counted(tmp_path: Path) -> None:
    with TestClient(create_app(Settings(data_dir=tmp_path))) as client:
        start(client)
        for _ in range(3):
            iterations = len(client.post("/v1/predictions", json=paper_scene()).json()["iterations"])
        client.post("/v1/predictions", json=put(paper_scene(), "primitives.0.u", 2))  # not solved, so not counted
        address = client.post("/v1/predictions", json=SLOW, headers={"prefer": "respond-async"}).headers["location"]
        time.sleep(0.05)
        running = samples(client.get("/metrics").text)
        client.delete(address)
        response = client.get("/metrics")
        found = samples(response.text)
    assert response.headers["content-type"].startswith("text/plain; version=0.0.4")
    assert found['dlo_solves_total{method="march",status="converged"}'] == 3
    assert found['dlo_solves_total{method="march",status="cancelled"}'] == 1
    assert found['dlo_iterations_total{method="march"}'] == 3 * iterations
    assert found['dlo_solve_seconds_count{method="march"}'] == 3
    assert found["dlo_stored_runs"] == 3
    assert running["dlo_running"] == 1
    assert found["dlo_running"] == found["dlo_queue_depth"] == 0


def logged(path: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in path.read_text().splitlines()]


def test_the_log_is_json_with_the_run_and_a_stop_lets_a_solve_finish(tmp_path: Path) -> None:
    with serving(tmp_path, token=TOKEN) as live, httpx.Client(base_url=live.url, headers=BEARER, timeout=60) as http:
        document = http.post("/v1/predictions", json=paper_scene()).json()
        http.get("/v1/predictions", params={"token": TOKEN})
        slow = http.post("/v1/predictions", json=SLOW, headers={"prefer": "respond-async"}).json()
        live.process.send_signal(signal.SIGTERM)
        live.process.wait(timeout=20)
    lines = logged(live.log)
    solved = next(line for line in lines if line["message"] == "solved")
    assert solved["run"] == document["id"]
    assert solved["status"] == "converged"
    assert solved["seconds"] == pytest.approx(document["accuracy"]["wall_time"], abs=1e-5)
    posts = [line for line in lines if line["logger"] == "dlo.access" and line["method"] == "POST"]
    assert [(line["status"], line["run"]) for line in posts] == [(201, document["id"]), (202, slow["id"])]
    assert TOKEN not in live.log.read_text()
    with serving(tmp_path) as live, httpx.Client(base_url=live.url) as http:
        stored = {run["id"] for run in http.get("/v1/predictions").json()["predictions"]}
    assert stored == {document["id"], slow["id"]}  # it was let finish, and both were found again


def test_a_stop_without_grace_cancels(tmp_path: Path) -> None:
    with serving(tmp_path, shutdown_grace="0") as live, httpx.Client(base_url=live.url, timeout=60) as http:
        slower = put(SLOW, "quality.n_t", 513)
        http.post("/v1/predictions", json=slower, headers={"prefer": "respond-async"})
        live.process.send_signal(signal.SIGTERM)
        live.process.wait(timeout=10)
    assert any("cancelling" in line["message"] for line in logged(live.log))
    assert not any(line["message"] == "solved" for line in logged(live.log))


@pytest.mark.parametrize("command", [SERVE, ("uvicorn", "app.main:app")], ids=["dlo", "uvicorn"])
def test_a_stop_answers_everyone_whose_solve_it_cancels(tmp_path: Path, command: tuple[str, ...]) -> None:
    slower = put(SLOW, "quality.n_t", 513)
    studies: dict[str, Any] = {"repeats": 100}
    limits = {"shutdown_grace": "0.2", "workers": "1"}
    with (
        serving(tmp_path, command, **limits) as live,
        httpx.Client(base_url=live.url, timeout=60) as http,
        ThreadPoolExecutor() as clients,
    ):
        direct = clients.submit(http.post, "/v1/predictions", json=slower)
        batch = clients.submit(http.post, "/v1/predictions:batch", json={"scenes": [slower] * 20})
        events = {"accept": "text/event-stream"}
        followed = clients.submit(http.post, "/v1/predictions", json=slower, headers=events)
        measured = clients.submit(http.post, "/v1/studies", json=studies, headers=events)
        while samples(http.get("/metrics").text)["dlo_queue_depth"] < 2:
            time.sleep(0.01)
        time.sleep(0.1)  # until the study is taken up
        live.process.send_signal(signal.SIGTERM)
        the_problem(direct.result(), 503)
        for answer in (followed.result(), measured.result()):
            assert parsed(answer.text)[-1][0] == "error"
            assert parsed(answer.text)[-1][2]["type"] == "urn:dlo:problem:cancelled"
        problems = [json.loads(line)["problem"] for line in batch.result().text.splitlines()]
        assert [problem["status"] for problem in problems] == [503] * 20
        live.process.wait(timeout=20)
    assert "Traceback" not in live.log.read_text()
