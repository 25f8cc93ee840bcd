import io
from contextlib import suppress
from time import monotonic

import httpx
import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Frame, Page, TimeoutError, expect

from app.schemas import PredictionRequest, to_scene
from app.viewer.camera import FIELD_OF_VIEW, extent, start_pose
from app.viewer.draft import start_draft
from app.viewer.gizmo import SIZE
from dlocore import predict

pytestmark = pytest.mark.browser
PATIENCE = 120.0  # [s]
HANDLE = 1 / 7 + 0.225 / 2  # centre of the gizmo's square, of the gizmo's size along x and along y


def open_scene(witness, service) -> Page:
    page = witness.page
    page.goto(f"{service.address}/scene/")
    page.wait_for_selector('[data-status="converged"]')
    return page


def on_screen(page: Page, x: float, y: float) -> tuple[float, float]:
    """Project the point (x, y, 0) of the table onto the page, as the start camera sees it."""
    box = page.locator("canvas").first.bounding_box()
    assert box is not None
    size = page.viewport_size
    assert size is not None
    draft = start_draft()
    seen = extent(draft, draft.start(lambda id: None))
    eye, centre = start_pose(seen, size["width"], size["height"], on_table=True)
    forward = (centre - eye) / np.linalg.norm(centre - eye)
    right = np.cross(forward, [0, 0, 1])
    right /= np.linalg.norm(right)
    ray = np.array([x, y, 0.0]) - eye
    scale = 0.5 * box["height"] / np.tan(0.5 * FIELD_OF_VIEW) / (ray @ forward)
    up = np.cross(right, forward)
    return box["x"] + 0.5 * box["width"] + scale * (ray @ right), box["y"] + 0.5 * box["height"] - scale * (ray @ up)


def kept_run(page: Page | Frame) -> str:
    """Keep the shown run; return its id."""
    page.get_by_role("tab", name="Files").click()
    page.get_by_role("button", name="Keep this run").click()
    return page.locator("[data-run]").get_attribute("data-run") or ""


def canvas(page: Page) -> np.ndarray:
    """Return the picture of the 3D scene, left of the panel."""
    box = page.locator("canvas").first.bounding_box()
    assert box is not None
    return np.asarray(Image.open(io.BytesIO(page.screenshot(clip=box))).convert("RGB"), dtype=int)


def test_dragging_the_gizmo_changes_the_prediction_to_that_of_the_python_api(service, witness):
    page = open_scene(witness, service)
    offset = HANDLE * SIZE
    give_up, again = monotonic() + PATIENCE, 0.0
    away, dy = np.inf, 0.5
    while away > 0.02:  # a pixel is about 2 mm; until the drag has arrived, the earlier run is shown
        assert monotonic() < give_up, f"the drag ends {away} m from where it was let go"
        if dy == 0.5 and monotonic() > again:  # a slow renderer may have missed the hovering: try again
            x, y = on_screen(page, 0.25 + offset, 0.5 + offset)
            for k in range(4):  # the gizmo grabs what was hovered in an earlier frame
                page.mouse.move(x + k % 2, y)
                page.wait_for_timeout(150 if again == 0.0 else 1000)
            page.mouse.down()
            page.mouse.move(*on_screen(page, 0.40 + offset, 0.30 + offset), steps=8)
            page.mouse.up()
            again = monotonic() + 0.125 * PATIENCE
        page.wait_for_timeout(500)
        page.wait_for_selector('[data-status="converged"]:not(:has-text("Preview"))')
        base = f"{service.address}/v1/predictions/{kept_run(page)}"
        scene = httpx.get(f"{base}/scene.json").json()
        dx, dy, dz = scene["primitives"][0]["path"]["displacement"]
        away = max(abs(dx - 0.15), abs(dy - 0.30))
    assert dz == 0
    request = PredictionRequest.model_validate(scene)
    surface = predict(to_scene(request, lambda id: None)).surface
    document = httpx.get(base).json()["surface"]
    expected = surface.positions(document["u"], document["t"])
    assert np.abs(np.array(document["positions"]) - expected).max() < 1e-9
    assert witness.errors == []


def test_playback_moves_the_cable_and_pause_holds_it(service, witness):
    page = open_scene(witness, service)
    page.get_by_role("button", name="Pause").click()
    give_up = monotonic() + PATIENCE
    still = moved = canvas(page)
    while moved is still or np.abs(moved - still).max() > 0:  # pictures drawn before the click may still come
        assert monotonic() < give_up, "the pause does not hold the cable"
        still = canvas(page)
        page.wait_for_timeout(1500)
        moved = canvas(page)
    page.wait_for_timeout(1500)
    assert np.abs(canvas(page) - still).max() == 0
    page.get_by_role("button", name="Play").click()
    while (np.abs(canvas(page) - still).max(axis=2) > 30).sum() < 100:  # a slow renderer takes its time
        assert monotonic() < give_up, "nothing moves"
        page.wait_for_timeout(500)
    assert witness.errors == []


def choose(page: Page, label: str, option: str) -> None:
    """Choose an option of a list; a list closes if the panel is redrawn at that moment."""
    give_up = monotonic() + PATIENCE
    chosen = page.get_by_role("combobox", name=label)
    while chosen.input_value() != option:
        assert monotonic() < give_up, f"{option} can't be chosen"
        chosen.click()
        with suppress(TimeoutError):
            page.get_by_role("option", name=option).click(timeout=5000)


def test_an_impossible_target_is_said_in_the_panel(service, witness):
    page = open_scene(witness, service)
    page.get_by_role("button", name="Add").first.click()
    expect(page.get_by_role("combobox", name="Gripper")).to_have_value("2 at 1 m")
    choose(page, "Motion", "moves")
    target = page.get_by_text("Target [m]").locator("xpath=ancestor::*[.//input][1]").locator("input").nth(1)
    target.fill("0.9")
    target.press("Enter")
    expect(page.locator('[data-status="impossible"]')).to_contain_text("farther apart than the cable between them")
    assert witness.errors == []
