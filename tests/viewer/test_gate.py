"""Who is let into the scene, how many at once, and what its page may do."""

import re
import threading
from collections.abc import Iterator
from types import SimpleNamespace

import httpx
import pytest
from protocol_client import SUBPROTOCOL, SceneClient, connected, opened, wait_for
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from app.pages.gallery import examples
from app.viewer import host
from app.viewer.draft import start_draft
from app.viewer.gateway import BEGIN_HEADER, KEY_HEADER
from tests.viewer.conftest import MOST_SCENES


@pytest.fixture
def slow_to_read(monkeypatch) -> Iterator[tuple[host.SceneHost, threading.Event]]:
    """A host with two places whose scenes do nothing, and the event for which it waits before it opens a stored run."""
    read = threading.Event()
    monkeypatch.setattr(host, "of_run", lambda *_: read.wait(10) and start_draft())
    monkeypatch.setattr(host, "Session", lambda *_: SimpleNamespace(tab="", close=lambda: None))
    scenes = host.SceneHost(SimpleNamespace(runs=None), most=2)
    yield scenes, read
    read.set()
    scenes.stop()


def coming(scenes: host.SceneHost) -> SceneClient:
    """Return a client that asks for a stored run."""
    headers = {KEY_HEADER: scenes.key, BEGIN_HEADER: "run-any"}
    return SceneClient(f"ws://127.0.0.1:{scenes.port}", additional_headers=headers)


def test_a_foreign_origin_is_refused(service):
    with pytest.raises(InvalidStatus) as refusal:
        SceneClient(service.socket, origin="https://evil.example")
    assert refusal.value.response.status_code == 403


@pytest.mark.parametrize("origin", ["same", "https://friend.example"])
def test_its_own_and_an_allowed_origin_are_let_in(service, origin):
    connected(service, origin=service.address if origin == "same" else origin).socket.close()


def test_the_inner_port_opens_no_scene(service):
    port = service.app.state.viewer_upstream.port
    with pytest.raises((ConnectionClosed, AssertionError)), SceneClient(f"ws://127.0.0.1:{port}") as client:
        client.wait_for(lambda: "/cable" in client.nodes, timeout=5)
    assert "/cable" not in client.nodes


def test_nobody_can_make_the_scene_publish_itself(service):
    with connected(service) as client:
        client.send(type="ShareUrlRequest")
        client.listen(0.3)
        assert service.app.state.viewer_upstream is not None
        server = service.app.state.viewer_upstream
        assert server.port
        client.drag("start")  # the connection still works
        client.drag("end")


def test_the_page_allows_nothing_from_other_hosts(service):
    page = httpx.get(f"{service.address}/scene/", follow_redirects=True)
    assert page.status_code == 200
    policy = page.headers["content-security-policy"]
    assert "default-src 'self'" in policy
    assert "http" not in policy
    assert "frame-ancestors 'self'" in policy


def test_a_wrong_protocol_version_ends_the_connection(service):
    with connect(service.socket, subprotocols=["viser-v0.0.1"], proxy=None) as socket, pytest.raises(ConnectionClosed):
        socket.recv(timeout=5)
    assert SUBPROTOCOL.startswith("viser-v")


def test_no_more_scenes_are_opened_than_allowed_and_a_page_says_so(service):
    upstream = service.app.state.viewer_upstream
    wait_for(lambda: not upstream.open_scenes())
    clients = [connected(service) for _ in range(MOST_SCENES)]
    try:
        page = httpx.get(f"{service.address}/scene/")
        assert page.status_code == 503
        assert "All scenes are taken" in page.text
        with pytest.raises(InvalidStatus):
            SceneClient(service.socket)
    finally:
        for client in clients:
            client.socket.close()
    wait_for(lambda: httpx.get(f"{service.address}/scene/", follow_redirects=True).status_code == 200)


def test_clients_that_come_at_once_take_no_more_places_than_there_are(slow_to_read):
    scenes, read = slow_to_read
    clients = [coming(scenes) for _ in range(6)]
    wait_for(lambda: len(scenes._server.get_clients()) == 6)
    read.set()
    wait_for(lambda: len(scenes._server.get_clients()) == 2)
    assert len(scenes.sessions) == 2
    for client in clients:
        client.socket.close()


def test_a_client_that_leaves_while_its_run_is_read_takes_no_place(slow_to_read):
    scenes, read = slow_to_read
    leaving = coming(scenes)
    wait_for(scenes._server.get_clients)
    leaving.socket.close()
    wait_for(lambda: not scenes._server.get_clients())
    read.set()
    with coming(scenes):
        wait_for(lambda: scenes.sessions)
        assert len(scenes.sessions) == 1
        assert list(scenes.sessions) == list(scenes._server.get_clients())


def test_the_address_of_an_example_leads_to_it(service):
    for name in examples():
        for address, query in (("/scene/", {"example": name}), (f"/scene/{name}/", {})):
            answer = httpx.get(service.address + address, params={**query, "darkMode": ""})
            assert answer.status_code == 307
            assert re.fullmatch(rf"/scene/{name}/[\w-]+/\?darkMode=", answer.headers["location"])
            assert httpx.get(service.address + answer.headers["location"]).status_code == 200


@pytest.mark.parametrize("name", ["nothing", "..", "%2e%2e", "a<b>", "paper-25.json"])
def test_an_unknown_example_is_said_to_be_unknown(service, name):
    page = httpx.get(f"{service.address}/scene/", params={"example": name}, follow_redirects=True)
    assert page.status_code == 404
    assert "<b>" not in page.text


def test_solves_of_the_scene_are_counted_with_all_others(service):
    def solves() -> float:
        lines = httpx.get(f"{service.address}/metrics").text.splitlines()
        return sum(float(line.split()[-1]) for line in lines if line.startswith("dlo_solves_total{"))

    before = solves()
    with connected(service) as client:
        client.drag("start")
        client.drag("update", 0.3, 0.3)
        client.drag("end")
        # the first one and a refined one; a drag as short as this may end before its preview begins
        client.wait_for(lambda: solves() >= before + 2)


def test_the_scene_offers_the_ready_scenes_of_the_gallery_in_its_order(service):
    with connected(service) as client:
        assert list(client.control("Example")[1]["options"][1:]) == list(examples())


def test_a_kept_run_is_opened_in_the_scene_again(service):
    with connected(service) as client:
        client.refined()
        client.set("Name", "kept")
        client.set("Table friction", 0.2)
        client.wait_for(lambda: '"friction": 0.2' in client.markdown("```json"))
        client.refined()
        client.press("Keep this run")
        links = client.wait_for(lambda: client.html("data-run"))
        kept = client.document
    (address,) = re.findall(r'href="(/scene/[^"]+)"[^>]*>open in the scene', links)
    answer = httpx.get(f"{service.address}{address}&darkMode")
    assert answer.status_code == 307
    path = answer.headers["location"]
    assert httpx.get(service.address + path).status_code == 200
    with opened(service, path.split("?")[0]) as client:
        client.refined()
        assert client.document == kept
        assert client.notifications == []
    run = address.partition("=")[2]
    assert httpx.delete(f"{service.address}/v1/predictions/{run}").is_success
    for gone in (run, "nonsense", "../..", "f" * 28):
        page = httpx.get(f"{service.address}/scene/", params={"run": gone})
        assert page.status_code == 404
        assert "There is no such run" in page.text
    with connected(service, f"run-{run}", tab="another") as client:
        client.wait_for(lambda: client.notifications == ["The run can't be opened"])


def test_a_run_that_goes_on_from_one_that_is_gone_is_not_opened(service):
    scene = start_draft().document
    first = httpx.post(f"{service.address}/v1/predictions", json=scene).json()["id"]
    later = {**scene, "shape": {"kind": "prediction", "id": first}}
    answer = httpx.post(f"{service.address}/v1/predictions", json=later)
    assert answer.is_success, answer.text
    httpx.delete(f"{service.address}/v1/predictions/{first}")
    with connected(service, f"run-{answer.json()['id']}") as client:
        client.wait_for(lambda: client.notifications == ["The run can't be opened"])


def test_a_tab_of_before_a_restart_says_that_its_scene_is_lost(service):
    with connected(service, tab="of-another-era") as client:
        client.wait_for(lambda: client.notifications == ["The service was restarted"])
    with connected(service) as client:
        client.listen(0.5)
        assert client.notifications == []
