"""The 3D scene in a real browser: files, clicks, several tabs, exports."""

import json
from pathlib import Path
from time import monotonic
from urllib.parse import urlsplit

import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Locator, Page, expect
from test_browser import canvas, on_screen, open_scene

from app.pages.gallery import examples
from app.viewer.client_page import GONE, TITLE, client_page
from benchmarks.simulated_recordings import simulated
from dlocore.recordings import save_recording

pytestmark = pytest.mark.browser
NAME = "An arc"
PATIENCE = 60.0  # s: a renderer without a GPU
ARC = {
    "name": NAME,
    "cable": {"preset": "paper"},
    "shape": {"kind": "points", "points": [[x, 0.3 * x * (1 - x), 0] for x in np.linspace(0.02, 0.98, 9)]},
    "primitives": [{"u": 0.0, "path": {"kind": "move", "displacement": [0.1, 0.2, 0.0], "duration": 1.0}}],
    "environment": {"table": {"height": 0.0, "friction": 0.2}},
}


def field(page: Page, label: str) -> Locator:
    """Return the text field next to a label of the panel."""
    boxes = "[self::textarea or (self::input and not(@type = 'hidden' or @type = 'range'))]"
    return page.get_by_text(label, exact=True).locator(f"xpath=following::*{boxes}[1]")


def downloaded(page: Page, button: str) -> Path:
    """Press a button and return the file that the browser saves."""
    with page.expect_download() as saving:
        page.get_by_role("button", name=button).click()
    return saving.value.path()


def test_a_scene_is_loaded_from_a_file_and_saved_again(service, witness, tmp_path):
    page = open_scene(witness, service)
    page.get_by_role("tab", name="Files").click()
    file = tmp_path / "arc.json"
    file.write_text(json.dumps(ARC))
    with page.expect_file_chooser() as choosing:
        page.get_by_role("button", name="Open a file").click()
    choosing.value.set_files(file)
    expect(field(page, "Name")).to_have_value(NAME)
    expect(page.locator('[data-status="converged"]')).to_be_visible()
    assert json.loads(downloaded(page, "Download scene.json").read_bytes()) == ARC
    assert witness.errors == []


def test_a_saved_playback_plays_offline_and_asks_nobody(service, witness):
    page = open_scene(witness, service)
    page.get_by_role("tab", name="Files").click()
    file = downloaded(page, "Save playback.html")
    context = page.context.browser.new_context(viewport={"width": 400, "height": 300}, offline=True)
    page.close()  # two scenes at once are too much for a renderer without a GPU
    asked: list[str] = []
    errors: list[str] = []
    offline = context.new_page()
    offline.set_default_timeout(60_000)
    offline.on("request", lambda request: asked.append(request.url))
    offline.on("console", lambda message: errors.append(message.text) if message.type == "error" else None)
    page_file = file.with_suffix(".html")
    file.rename(page_file)
    try:
        offline.goto(page_file.as_uri())
        expect(offline.locator("canvas").first).to_be_visible()
        first = canvas(offline)
        offline.wait_for_timeout(500)
        give_up = 60
        while (np.abs(canvas(offline) - first).max(axis=2) > 30).sum() < 100:
            give_up -= 1
            assert give_up, "nothing moves in the saved playback"
            offline.wait_for_timeout(500)
    finally:
        context.close()  # a running playback would slow down all later tests
    assert [url for url in asked if urlsplit(url).scheme not in ("file", "data", "blob")] == []
    assert errors == []


def test_a_picture_of_the_scene_is_saved_larger_than_it_is_on_the_screen(service, witness):
    page = open_scene(witness, service)
    page.get_by_role("tab", name="Files").click()
    picture = Image.open(downloaded(page, "Save picture.png"))
    assert picture.size == (1920, 1080)
    assert np.asarray(picture.convert("L")).std() > 1.0  # something is drawn
    assert witness.errors == []


def test_a_click_on_the_cable_takes_hold_of_it_there(service, witness):
    page = open_scene(witness, service)
    page.get_by_role("button", name="Pause").click()
    page.get_by_role(
        "button", name="Play", exact=True
    ).wait_for()  # after that, the playback no longer changes the time
    time = page.locator("input[type=text]").first
    time.fill("0")
    time.press("Enter")
    expect(time).to_have_value("0")
    grasp = field(page, "Grasp u [m]")
    expect(grasp).to_have_value("0.25")
    give_up = monotonic() + PATIENCE
    while abs(float(grasp.input_value()) - 0.7) > 0.02:  # a pixel is about 2 mm
        assert monotonic() < give_up, f"taken hold of at {grasp.input_value()} m"
        page.mouse.click(*on_screen(page, 0.7, 0.0))  # until the picture of t = 0 is there, it hits another place
        page.wait_for_timeout(1000)
    assert witness.errors == []


def test_two_tabs_have_their_own_scenes(service, witness):
    one = open_scene(witness, service)
    other = one.context.new_page()
    other.goto(f"{service.address}/scene/")
    other.wait_for_selector('[data-status="converged"]')
    for page, count in ((one, 2), (other, 1)):
        if page is one:
            page.bring_to_front()
            page.get_by_role("button", name="Add").first.click()
            expect(page.get_by_role("combobox", name="Gripper")).to_have_value("2 at 1 m")
        page.bring_to_front()
        page.get_by_role("tab", name="Files").click()
        assert len(json.loads(downloaded(page, "Download scene.json").read_bytes())["primitives"]) == count
    assert witness.errors == []


def test_a_ready_scene_opens_by_its_address_and_asks_no_other_host(service, witness):
    name, example = next(iter(examples().items()))
    page = witness.page
    page.goto(f"{service.address}/scene/?example={name}")
    page.wait_for_selector('[data-status="converged"]')
    page.get_by_role("tab", name="Files").click()
    document = json.loads(downloaded(page, "Download scene.json").read_bytes())
    assert document == json.loads(example.document)
    assert witness.errors == []
    assert witness.hosts == {urlsplit(service.address).netloc}


def test_a_recording_is_opened_and_its_error_is_read_on_the_timeline(service, witness, tmp_path):
    file = tmp_path / "shaken.npz"
    save_recording(simulated(6, 1.2), file)
    page = open_scene(witness, service)
    page.get_by_role("tab", name="Files").click()
    with page.expect_file_chooser() as choosing:
        page.get_by_role("button", name="Open a recording").click()
    choosing.value.set_files(file)
    expect(page.locator("[data-error]")).to_contain_text("mm from the measured markers")
    expect(page.get_by_role("img", name="error over time")).to_be_visible()
    page.get_by_role("button", name="Identify the cable").click()
    expect(page.get_by_role("button", name="Stop")).to_be_visible()
    expect(page.locator('[data-identify="converged"]')).to_contain_text("95 % intervals", timeout=240_000)
    page.get_by_role("button", name="Keep as a preset").click()
    page.get_by_role("tab", name="Scene").click()
    expect(page.get_by_role("combobox", name="Preset")).to_have_value("my cable")
    assert witness.errors == []


def test_the_page_has_a_title_and_says_where_its_service_is_gone(witness):
    nowhere = "http://127.0.0.1:9"
    page = witness.page
    page.route(f"{nowhere}/**", lambda route: route.fulfill(body=client_page(), content_type="text/html"))
    page.goto(f"{nowhere}/scene/new/tab/")
    expect(page).to_have_title(TITLE)
    told = "[...document.querySelectorAll('div')].map(div => getComputedStyle(div, '::before').content)"
    page.wait_for_function(f"{told}.filter(words => words.includes('{GONE}')).length === 1")


def test_no_control_lies_under_the_scrollbar_of_the_panel(service, witness):
    page = open_scene(witness, service)
    bar = page.locator('.mantine-ScrollArea-scrollbar[data-orientation="vertical"]').first.bounding_box()
    play = page.get_by_role("button", name="Pause").bounding_box()
    assert bar is not None
    assert play is not None
    assert play["x"] + play["width"] <= bar["x"]
