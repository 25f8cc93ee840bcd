"""A recording in rerun's viewer, which the service itself serves: what it shows, and that it requests nothing else."""

import io
import time
from urllib.parse import urlsplit

import httpx
import numpy as np
import pytest
from PIL import Image
from playwright.sync_api import Page

from app.recording.style import BLUE, ORANGE, VERMILION, time_ramp

pytestmark = pytest.mark.browser
SIZE = {"width": 1600, "height": 950}
SHAPES, PLOTS, WORDS = ((80, 630, 0, 639), (96, 480, 660, 1118), (96, 480, 1124, 1598))  # top, bottom, left, right
MOTION = (96, 900, 0, 940)
MOTION_TAB = (370, 50)
PATIENCE = 90.0  # s: a software renderer compiles and draws it
SCENE = {
    "cable": {"length": 1.0, "diameter": 0.005, "linear_density": 0.05, "bending_stiffness": 1e-3},
    "shape": {"kind": "straight", "start": [0, 0, 0], "direction": [1, 0, 0]},
    "primitives": [
        {"u": 0.25, "hold": "point", "path": {"kind": "move", "displacement": [0, 0.5, 0], "duration": 1.6}}
    ],
    "environment": {"drag": 0.05, "table": {"height": 0.0, "friction": 0.0}},
    "quality": {"n_u": 9, "n_t": 13, "delta": 1e-5},
}


Region = tuple[int, int, int, int]


def coloured(picture: np.ndarray, colour: tuple[int, int, int], region: Region) -> int:
    """Count the pixels of a region that have the hue of a colour, however shaded."""
    top, bottom, left, right = region
    part = picture[top:bottom, left:right]
    brightest = part.max(axis=-1)
    away = np.abs(part / np.maximum(brightest, 1)[..., None] - np.array(colour) / max(colour)).max(axis=-1)
    return int(((away < 0.1) & (brightest > 80)).sum())


def dark(picture: np.ndarray, region: Region) -> int:
    """Count the dark pixels of a region, those of letters."""
    top, bottom, left, right = region
    return int((picture[top:bottom, left:right].max(axis=-1) < 90).sum())


def screenshot(page: Page) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(page.screenshot())).convert("RGB"), dtype=int)


def drawn(page: Page, *expected: tuple[tuple[int, int, int], Region, int], words: tuple[int, float]) -> np.ndarray:
    """Wait until every colour fills its region with its least number of pixels; return the picture.

    `words` gives the least and the most number of dark pixels: what a page shows is there only when what the page
    before showed is gone.
    """
    give_up = time.monotonic() + PATIENCE
    while True:
        picture = screenshot(page)
        found = [coloured(picture, colour, region) for colour, region, _ in expected]
        letters = dark(picture, WORDS)
        if words[0] <= letters <= words[1] and all(
            count >= least for count, (_, _, least) in zip(found, expected, strict=True)
        ):
            return picture
        assert time.monotonic() < give_up, f"the viewer does not show the recording: {found} pixels, {letters} of words"
        page.wait_for_timeout(500)


def test_the_link_of_an_answer_opens_its_recording(service, witness):
    answer = httpx.post(f"{service.address}/v1/predictions", json=SCENE, timeout=60).raise_for_status().json()
    page, answered = witness.page, set()
    page.on("response", lambda response: answered.add(urlsplit(response.url).netloc))
    page.set_viewport_size(SIZE)
    page.goto(service.address + answer["links"]["viewer"])
    halfway = tuple(time_ramp(np.array([0.5]))[0].tolist())
    net, shape = (ORANGE, SHAPES, 200), (halfway, SHAPES, 500)
    update, residual = (BLUE, PLOTS, 300), (VERMILION, PLOTS, 300)
    report = drawn(page, net, shape, update, residual, words=(2000, np.inf))
    page.mouse.click(*MOTION_TAB)
    path, reactions = (ORANGE, MOTION, 100), (VERMILION, MOTION, 100)  # of the grasp; along its path
    drawn(page, path, reactions, words=(0, dark(report, WORDS) / 2))  # the report is on the other tab
    here = urlsplit(service.address).netloc
    assert {host for host in answered if host} == {here}  # the page's policy refuses what else the viewer requests
