"""Accept and Prefer: the form of an answer, and whether it waits for the solve."""

import io
from typing import Any

import msgpack
import numpy as np
import pytest
from fastapi.testclient import TestClient

from app.http.formats import EVENTS, JSON, MSGPACK, NPZ, negotiated
from app.http.preferences import preferences
from app.http.problems import ProblemError
from tests.app.conftest import paper_scene
from tests.app.test_bad_requests import the_problem

OFFERS = (JSON, NPZ, MSGPACK, EVENTS)


@pytest.mark.parametrize(
    ("accept", "form"),
    [
        (None, JSON),
        ("", JSON),
        ("*/*", JSON),
        ("application/*", JSON),
        ("application/x-npz", NPZ),
        ("Application/X-NPZ", NPZ),
        ("application/x-npz, application/json", JSON),
        ("application/x-npz, application/json;q=0.5", NPZ),
        ("application/x-npz;q=0.2, */*;q=0.1", NPZ),
        ("application/json;q=0, */*", NPZ),
        ("application/msgpack", MSGPACK),
        ("application/x-msgpack;q=0.9, application/json;q=0.8", MSGPACK),
        ("text/*", EVENTS),
        ("text/event-stream", EVENTS),
        ("text/html, application/xhtml+xml, */*;q=0.8", JSON),
        ("application/json; charset=utf-8", JSON),
    ],
)
def test_the_form_that_a_client_ranks_highest_is_taken(accept: str | None, form: str) -> None:
    assert negotiated(accept, OFFERS) == form


@pytest.mark.parametrize("accept", ["text/html", "application/json;q=0", "image/*", "json", "application/json;q=nan"])
def test_a_form_that_is_not_there_is_refused(accept: str) -> None:
    with pytest.raises(ProblemError) as raised:
        negotiated(accept, OFFERS)
    assert raised.value.status == 406


@pytest.mark.parametrize(
    ("header", "respond_async", "wait", "applied"),
    [
        (None, False, 0.0, ""),
        ("", False, 0.0, ""),
        ("respond-async", True, 0.0, "respond-async"),
        ("Respond-Async, wait=5", True, 5.0, "respond-async, wait=5"),
        ('return=minimal; foo="bar", respond-async', True, 0.0, "respond-async"),
        ("wait=5", False, 0.0, ""),
        ("respond-async, wait=-1", True, 0.0, "respond-async"),
        ("respond-async, wait=soon", True, 0.0, "respond-async"),
        (", ,;;=", False, 0.0, ""),
    ],
)
def test_preferences_are_read_and_what_is_unknown_is_passed_over(
    header: str | None, respond_async: bool, wait: float, applied: str
) -> None:
    wishes = preferences(header)
    assert (wishes.respond_async, wishes.wait, wishes.applied) == (respond_async, wait, applied)


def test_msgpack_and_npz_hold_what_json_holds(client: TestClient, answer: dict[str, Any]) -> None:
    address = answer["links"]["self"]
    packed = client.get(address, headers={"accept": "application/msgpack"})
    assert packed.headers["content-type"] == MSGPACK
    assert msgpack.unpackb(packed.content) == answer
    binary = client.get(address, headers={"accept": NPZ})
    with np.load(io.BytesIO(binary.content), allow_pickle=False) as arrays:
        for name in ("u", "t", "positions", "twist"):
            np.testing.assert_array_equal(arrays[name], answer["surface"][name])
    for response in (packed, binary):
        assert response.headers["vary"] == "Accept"


@pytest.mark.parametrize("form", [NPZ, MSGPACK])
@pytest.mark.parametrize(("query", "status"), [("", 201), ("?store=false", 200)])
def test_a_new_prediction_comes_in_the_form_asked_for(client: TestClient, form: str, query: str, status: int) -> None:
    response = client.post(f"/v1/predictions{query}", json=paper_scene(), headers={"accept": form})
    assert response.status_code == status
    assert response.headers["content-type"] == form


def test_every_address_refuses_a_form_that_it_has_not(client: TestClient, answer: dict[str, Any]) -> None:
    html = {"accept": "text/html"}
    before = client.get("/v1/predictions").json()["total"]
    points = [[0, 0], [1, 0], [2, 0], [3, 0]]
    for response in (
        client.post("/v1/predictions", json=paper_scene(), headers=html),
        client.get("/v1/predictions", headers=html),
        client.get(answer["links"]["self"], headers=html),
        client.get(answer["links"]["events"], headers={"accept": "application/json"}),
        client.post("/v1/predictions:batch", json={"scenes": [paper_scene()]}, headers=html),
        client.post("/v1/shapes:fit", json={"points": points}, headers=html),
    ):
        the_problem(response, 406)
    assert client.get("/v1/predictions").json()["total"] == before  # refused before anything was solved
