"""Typing into the panel of the 3D scene, key by key."""

import json

import pytest
from playwright.sync_api import Page, expect
from test_browser import open_scene
from test_scene import downloaded

from app.viewer.client_page import PLAIN_NUMBERS

pytestmark = pytest.mark.browser
BETWEEN_KEYS = 150  # ms: like a person, so that the field is redrawn between two keys


def typed(page: Page, label: str, number: int, text: str):
    """Replace the text in one of the fields next to a label by typing; return the field."""
    beside = page.get_by_text(label, exact=True).locator("xpath=ancestor::*[.//input][1]")
    field = beside.locator("input").nth(number)
    field.click()
    field.press("Control+a")
    field.press_sequentially(text, delay=BETWEEN_KEYS)
    return field


def solved_target(page: Page) -> list[float]:
    """Return the displacement of the gripper in the solved scene."""
    page.wait_for_timeout(1000)
    page.wait_for_selector('[data-status="converged"]:not(:has-text("Preview"))')
    page.get_by_role("tab", name="Files").click()
    scene = json.loads(downloaded(page, "Download scene.json").read_bytes())
    page.get_by_role("tab", name="Scene").click()
    return scene["primitives"][0]["path"]["displacement"]


def test_negative_fractions_are_typed_into_the_target(service, witness):
    page = open_scene(witness, service)
    for text in ("-0.05", "-.3"):
        target = typed(page, "Target [m]", 1, text)
        expect(target).to_have_value(f"{float(text)}")
        assert solved_target(page) == [0.0, float(text), 0.0]
        expect(target).to_have_value(f"{float(text)}")
    target = typed(page, "Target [m]", 1, "-0.")
    target.press("Tab")
    expect(target).to_have_value("0")
    assert solved_target(page) == [0.0, 0.0, 0.0]
    assert witness.errors == []


def test_a_power_of_ten_is_typed_and_what_is_out_of_range_is_told(service, witness):
    page = open_scene(witness, service)
    stiffness = typed(page, "EI [10⁻³ N m²]", 0, "1e-1")
    solved_target(page)
    expect(stiffness).to_have_value("1e-1")
    stiffness.fill("1e20")  # pasted, because slow typing would also enter the numbers 1 and 1e2
    expect(page.get_by_text("Got 1e20, allowed: a number from 1e-6 to 1e9.")).to_be_visible()
    expect(stiffness).to_have_value("0.1")
    assert witness.errors == []


def test_a_power_of_ten_in_a_vector_is_refused_from_its_e_on(service, witness):
    page = open_scene(witness, service)
    target = typed(page, "Target [m]", 1, "0.25e-1")
    expect(target).to_have_value("0.25")
    assert target.evaluate("field => field.validationMessage") == PLAIN_NUMBERS
    target.press("Backspace")
    target.press_sequentially("1", delay=BETWEEN_KEYS)
    expect(target).to_have_value("0.21")
    assert target.evaluate("field => field.validationMessage") == ""
    assert solved_target(page) == [0.0, 0.21, 0.0]
    typed(page, "Target [m]", 1, "0.3E")
    target = typed(page, "Target [m]", 1, "-0.4")
    expect(target).to_have_value("-0.4")
    assert witness.errors == []


def test_what_is_deleted_from_a_number_leaves_the_rest_as_it_was_typed(service, witness):
    page = open_scene(witness, service)
    for text, digit, expected in (("0.2", "5", 0.5), ("1.05", "7", 1.07), ("-0.07", "3", -0.03)):
        target = typed(page, "Target [m]", 1, text)
        target.press("Backspace")
        page.wait_for_timeout(BETWEEN_KEYS)
        expect(target).to_have_value(text[:-1])
        target.press(digit)
        expect(target).to_have_value(f"{expected}")
    assert solved_target(page) == [0.0, -0.03, 0.0]
    target.press("End")
    target.press("Backspace")
    target.press("Tab")
    expect(target).to_have_value("0")
    assert solved_target(page) == [0.0, 0.0, 0.0]
    target.fill("0.50")  # pasted
    assert solved_target(page) == [0.0, 0.5, 0.0]
    assert witness.errors == []


def test_a_target_is_typed_to_a_tenth_of_a_millimetre(service, witness):
    page = open_scene(witness, service)
    target = typed(page, "Target [m]", 1, "-0.1234")
    assert solved_target(page) == [0.0, -0.1234, 0.0]
    assert target.evaluate("field => field.scrollWidth <= field.clientWidth")
    assert witness.errors == []


def test_a_number_beyond_the_end_of_a_slider_is_told_when_its_field_is_left(service, witness):
    page = open_scene(witness, service)
    place = page.get_by_text("Grasp u [m]", exact=True).locator("xpath=ancestor::*[.//input][1]")
    field = place.locator("input[inputmode]")
    for leave in ("Tab", None):
        field.click()
        field.press("Control+a")
        field.press_sequentially("7", delay=BETWEEN_KEYS)
        if leave is not None:
            field.press(leave)
        expect(page.get_by_text("Got 7, allowed: a number from 0 to 1.")).to_be_visible()
        expect(field).to_have_value("0.25")
        page.get_by_text("Grasp u [m] is left at 0.25").locator("xpath=following::button[1]").click()
    assert witness.errors == []


def test_what_is_not_possible_stays_in_view_when_the_panel_is_scrolled(service, witness):
    page = open_scene(witness, service)
    typed(page, "Target [m]", 1, "900")
    told = page.locator("[data-status=impossible]")
    told.hover()
    page.mouse.wheel(0, 2000)
    expect(page.get_by_role("button", name="Add a force")).to_be_in_viewport()
    expect(told).to_be_in_viewport(ratio=1)
    assert witness.errors == []
