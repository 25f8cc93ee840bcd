"""The ready scenes: listed, read, solved."""

import json
from typing import Any

import pytest
from fastapi.testclient import TestClient

from app.pages.gallery import examples
from tests.app.conftest import ROOT

JSON = {"Content-Type": "application/json"}
NAMES = [entry["name"] for entry in json.loads((ROOT / "static" / "gallery.json").read_text())]


def listed(client: TestClient) -> dict[str, dict[str, Any]]:
    response = client.get("/v1/examples")
    assert response.status_code == 200
    return {entry["name"]: entry for entry in response.json()["examples"]}


def test_every_scene_of_the_gallery_is_listed_in_its_order_and_none_lies_about_unlisted(client: TestClient) -> None:
    assert list(listed(client)) == NAMES
    files = {file.stem for file in (ROOT / "static" / "gallery").glob("*.json")}
    assert files == set(NAMES)


def test_titles_tell_the_scenes_apart(client: TestClient) -> None:
    titles = [entry["title"] for entry in listed(client).values()]
    assert all(titles)
    assert len(set(titles)) == len(titles)


def test_every_link_of_the_list_leads_somewhere(client: TestClient) -> None:
    for entry in listed(client).values():
        for address in entry["links"].values():
            assert client.get(address).status_code == 200, address
        assert client.get(entry["links"]["picture"]).headers["content-type"].startswith("image/svg+xml")


@pytest.mark.parametrize("name", NAMES)
def test_an_example_is_answered_as_its_file_and_converges_as_it_is(client: TestClient, name: str) -> None:
    response = client.get(f"/v1/examples/{name}")
    assert response.headers["content-type"] == "application/json"
    assert response.content == (ROOT / "static" / "gallery" / f"{name}.json").read_bytes()
    answer = client.post("/v1/predictions?store=false", content=response.content, headers=JSON)
    assert answer.status_code == 200, answer.text
    assert answer.json()["status"] == "converged"


CALLED_FOR = {
    "paper-25": {"inertia", "table"},
    "two-grippers": {"gravity"},
    "peg-with-friction": {"friction", "obstacles"},
    "keeps-its-bend": {"plasticity", "obstacles"},
    "twist-buckles": {"twist"},
}


@pytest.mark.parametrize("name", CALLED_FOR)
def test_an_example_shows_the_effect_it_is_there_for(client: TestClient, name: str) -> None:
    answer = client.post("/v1/predictions?store=false", content=examples()[name].document, headers=JSON).json()
    assert {effect["name"] for effect in answer["effects"] if effect["active"]} >= CALLED_FOR[name]


def test_a_name_that_is_none_is_answered_with_those_there_are(client: TestClient) -> None:
    response = client.get("/v1/examples/paper-26")
    assert response.status_code == 404
    assert response.headers["content-type"] == "application/problem+json"
    assert all(name in response.json()["detail"] for name in NAMES)
