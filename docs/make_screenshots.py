"""Make docs/scene.png and docs/landing*.png from a running service: `python docs/make_screenshots.py http://127.0.0.1:8000`.

Needs Playwright and a Chromium (`DLO_CHROMIUM` names another one than the first on the path).
"""

import argparse
import os
import shutil
from pathlib import Path

from playwright.sync_api import Browser, Page, sync_playwright

HERE = Path(__file__).parent
FLAGS = ["--headless", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
FIRST_SOLVE = 120_000  # ms; the solver may have to be compiled
WAIT = 2500  # ms, for a software renderer to catch up


def chromium() -> str:
    """Return the path of a Chromium."""
    names = [os.environ.get("DLO_CHROMIUM", ""), "chromium", "chromium-browser", "google-chrome"]
    path = next((found for name in names if name and (found := shutil.which(name))), None)
    if path is None:
        raise SystemExit("No Chromium found: install one, or name it in DLO_CHROMIUM.")
    return path


def scene(browser: Browser, address: str) -> None:
    """Draw the scene alone, in dark, with the target somewhere else and the cable near the end of its motion."""
    page = browser.new_page(viewport={"width": 1280, "height": 760})
    page.goto(f"{address}/scene/?darkMode")
    page.wait_for_selector('[data-status="converged"]', timeout=FIRST_SOLVE)
    target = page.get_by_text("Target x, y [m]").locator("xpath=ancestor::*[.//input][1]").locator("input")
    for box, value in ((target.nth(0), "0.42"), (target.nth(1), "0.48")):
        box.fill(value)
        box.press("Enter")
        page.wait_for_timeout(500)
    page.get_by_role("button", name="Pause").click()
    time = page.locator("input[type=text]").first
    time.click()
    time.press("Control+a")
    page.keyboard.type("1.05")
    time.press("Tab")
    page.get_by_role("tab", name="Result").click()
    settle(page)
    page.screenshot(path=HERE / "scene.png")


def landing(browser: Browser, address: str) -> None:
    """Draw the top of the landing page in light, on a phone too, and in dark its gallery and what accuracy costs."""
    page = browser.new_page(viewport={"width": 1400, "height": 900}, color_scheme="light")
    show(page, address)
    page.screenshot(path=HERE / "landing.png")
    page.emulate_media(color_scheme="dark")
    for part in ("gallery", "speed"):
        page.locator(f"#{part}").screenshot(path=HERE / f"landing-{part}.png")
    phone = browser.new_page(viewport={"width": 390, "height": 844}, color_scheme="light")
    show(phone, address)
    phone.screenshot(path=HERE / "landing-phone.png")


def show(page: Page, address: str) -> None:
    """Open the landing page with its motion stopped."""
    page.goto(address)
    frame = page.frame_locator("#scene")
    frame.locator('[data-status="converged"]').wait_for(timeout=FIRST_SOLVE)
    frame.get_by_role("button", name="Pause").click()
    settle(page)


def settle(page: Page) -> None:
    """Wait until everything is drawn, without the client's note that no graphics card draws it."""
    for frame in (frame for frame in page.frames if "/scene/" in frame.url):  # the page itself takes no such styles
        frame.add_style_tag(content="[class*='Notification'] { display: none !important; }")
    page.wait_for_timeout(WAIT)


def main() -> None:
    """Make the pictures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("address", nargs="?", default="http://127.0.0.1:8000")
    address = parser.parse_args().address.rstrip("/")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium(), args=FLAGS)
        scene(browser, address)
        landing(browser, address)
        browser.close()


if __name__ == "__main__":
    main()
