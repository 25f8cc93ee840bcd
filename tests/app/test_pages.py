"""The landing page as it is served: its files, and what they may do."""

import re

from fastapi.testclient import TestClient

from tests.app.conftest import ROOT


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
