"""The number fields of the panel: a typed number is solved, or reported as not allowed."""

import json

import pytest
from protocol_client import SceneClient, connected

from app.viewer.number_field import read, written


@pytest.mark.parametrize(
    ("text", "number"),
    [("0.5", 0.5), ("0,5", 0.5), ("1e-4", 1e-4), ("1.5E2", 150.0), (" -.3 ", -0.3), ("−2", -2.0), ("3.", 3.0)],
)
def test_a_number_is_read_as_people_write_it(text, number):
    assert read(text) == number


@pytest.mark.parametrize("text", ["", "-", "1e", "1e-", "1.000,5", "1 2", "1_000", "nan", "inf", "five", "0x10"])
def test_what_is_no_number_is_none(text):
    assert read(text) is None


@pytest.mark.parametrize(
    ("number", "text"), [(1e-6, "1e-6"), (1e9, "1e9"), (0.30000000000000004, "0.3"), (-0.0, "0"), (1200.0, "1200")]
)
def test_a_number_is_written_short_and_read_again(number, text):
    assert written(number) == text
    assert read(text) == pytest.approx(number, rel=1e-7)


LABEL, DURATION = "EI [10⁻³ N m²]", "Duration [s]"


def typed(client: SceneClient, text: str) -> None:
    """Type into the field, which shows the text until the server changes it."""
    client.control(LABEL)[1]["value"] = text
    client.set(LABEL, text)


def test_a_power_of_ten_is_the_number_that_is_solved_and_stays_as_it_was_typed(service):
    with connected(service) as client:
        for text, stiffness in (("1e-1", 1e-4), ("1.5e2", 0.15), ("0,5", 5e-4)):
            typed(client, text)
            assert client.document["cable"]["bending_stiffness"] == pytest.approx(stiffness, rel=1e-9)
            assert client.control(LABEL)[1]["value"] == text


def test_what_is_not_allowed_is_told_and_the_field_shows_what_holds(service):
    with connected(service) as client:
        before = client.document
        for text in ("", "five", "1e", "0", "-1", "1e12"):
            typed(client, text)
            assert client.document == before
            assert client.control(LABEL)[1]["value"] == "1"
            assert client.notifications.pop() == f"{LABEL} is left at 1"
            assert client.notices.pop() == f"Got {text or 'nothing'}, allowed: a number from 1e-6 to 1e9."


def test_the_beginning_of_a_number_is_waited_for(service):
    with connected(service) as client:
        for text in ("1", "1e", "1e-", "1e-1"):
            typed(client, text)
            client.listen(0.6)  # s: longer than the pause after which a number counts as typed
        client.wait_for(lambda: '"bending_stiffness": 0.0001' in client.markdown("```json"))
        typed(client, "2e")
        client.wait_for(lambda: client.notifications == [f"{LABEL} is left at 0.1"])


def test_a_number_beside_a_slider_that_is_out_of_its_range_is_told_and_changes_nothing(service):
    with connected(service) as client:
        before = client.document
        for beyond in (-1.0, 20.0):
            client.control("Grasp u [m]")[1]["value"] = beyond
            client.set("Grasp u [m]", beyond)
            assert client.document == before
            client.wait_for(lambda: client.control("Grasp u [m]")[1]["value"] == 0.25)
            assert client.notifications.pop() == "Grasp u [m] is left at 0.25"
            assert client.notices.pop() == f"Got {beyond:g}, allowed: a number from 0 to 1."


def test_a_move_lasts_as_long_as_is_typed_and_another_duration_is_told(service):
    with connected(service) as client:
        before = client.document
        for text in ("0", "-1", "abc", "1e5"):
            client.set(DURATION, text)
            assert client.document == before
            assert client.notifications.pop() == f"{DURATION} is left at 1.6"
            assert client.notices.pop() == f"Got {text}, allowed: a number from 0.001 to 10000."
        client.set(DURATION, "25")
        assert client.document["primitives"][0]["path"]["duration"] == 25.0
        client.set("Changes", "Undo")
        client.wait_for(lambda: client.control(DURATION)[1]["value"] == "1.6")
        assert client.document == before
        before["primitives"][0]["path"]["duration"] = 0.05
        client.upload("Open a file …", "scene.json", json.dumps(before).encode())
        client.wait_for(lambda: client.control(DURATION)[1]["value"] == "0.05")


def test_a_target_error_is_at_most_as_long_as_the_cable_in_millimetres(service):
    with connected(service) as client:
        client.set("Ask for", "target error")
        before = client.document
        client.set("Target error [mm]", 2000)
        assert client.document == before
        client.wait_for(lambda: client.notices == ["Got 2000, allowed: a number from 0.001 to 1000."])
        client.set("Length [m]", 3)
        assert client.document["cable"]["length"] == 3.0
        client.set("Target error [mm]", 2000)
        assert client.document["quality"]["target_error"] == 2.0
