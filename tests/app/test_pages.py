"""The landing page as it is served: its files, and what they may do."""

import re

import pytest
from fastapi.testclient import TestClient

from tests.app.conftest import ROOT
from tests.app.test_bad_requests import the_problem

BROWSER = "text/html,application/xhtml+xml,application/xml;q=0.9,*/*;q=0.8"  # what one accepts of an address


def test_pages_run_no_script_but_their_own_files(client: TestClient) -> None:
    policy = client.get("/").headers["content-security-policy"]
    assert "script-src 'self'" in policy
    assert "default-src 'none'" in policy
    assert "unsafe" not in policy
    page = client.get("/").text
    assert not re.search(r"<script(?![^>]*\bsrc=)|\son\w+=|\sstyle=|<style", page)


def test_a_changed_file_is_not_taken_from_the_cache_of_a_browser(client: TestClient) -> None:
    for name in ["", *(file.name for file in (ROOT / "static").glob("*.js"))]:
        first = client.get(f"/{name}")
        assert first.headers["cache-control"] == "no-cache"
        assert client.get(f"/{name}", headers={"If-None-Match": first.headers["etag"]}).status_code == 304


def test_every_module_that_a_script_imports_is_there(client: TestClient) -> None:
    for file in (ROOT / "static").glob("*.js"):
        for name in re.findall(r'from "\./([^"]+)"', file.read_text()):
            answer = client.get(f"/{name}")
            assert answer.status_code == 200, name
            assert "javascript" in answer.headers["content-type"]


def test_no_link_opens_the_viewer_of_recordings_without_one(client: TestClient) -> None:
    assert "/rerun" not in client.get("/").text  # those of runs are `links.viewer`


@pytest.mark.parametrize("address", ["/nope", "/a/page/that/is/none", "/gallery"])
def test_a_browser_is_told_by_a_page_that_there_is_none(client: TestClient, address: str) -> None:
    answer = client.get(address, headers={"Accept": BROWSER})
    assert answer.status_code == 404
    assert answer.headers["content-type"].startswith("text/html")
    assert answer.headers["vary"] == "Accept"
    assert 'href="/"' in answer.text


@pytest.mark.parametrize("accept", ["*/*", "application/json", "image/png", "application/json, text/html"])
def test_a_program_is_told_by_a_problem_that_there_is_no_page(client: TestClient, accept: str) -> None:
    the_problem(client.get("/nope", headers={"Accept": accept}), 404)


def test_a_browser_gets_the_problems_of_the_api(client: TestClient) -> None:
    the_problem(client.get("/v1/nope", headers={"Accept": BROWSER}), 404)


@pytest.mark.parametrize(
    ("address", "target"),
    [
        ("/scene", "/scene/"),
        ("/scene?example=paper-25&darkMode", "/scene/?example=paper-25&darkMode"),
        ("/scene/paper-25?darkMode", "/scene/paper-25/?darkMode"),
    ],
)
def test_the_scene_is_found_without_its_slash(client: TestClient, address: str, target: str) -> None:
    answer = client.get(address, follow_redirects=False)
    assert answer.status_code == 307
    assert answer.headers["location"] == target
    assert client.get(target).status_code == 200


@pytest.mark.parametrize(
    "address", ["/", "/health", "/ready", "/metrics", "/docs", "/scene", "/scene/", "/rerun/", "/openapi.json", "/no"]
)
def test_head_is_answered_as_get_without_its_body(client: TestClient, address: str) -> None:
    whole = client.get(address, follow_redirects=False)
    head = client.head(address, follow_redirects=False)
    assert head.status_code == whole.status_code
    assert head.content == b""
    assert "content-length" in head.headers
    assert head.headers.get("content-type") == whole.headers.get("content-type")


def test_a_head_of_the_api_is_refused_with_the_methods_there_are(client: TestClient) -> None:
    assert client.head("/v1/predictions").headers["allow"] == "GET, POST"
    assert client.post("/health").headers["allow"] == "GET, HEAD"
