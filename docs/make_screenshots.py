"""Make docs/scene*.png and docs/landing-*.png from a running service: `python docs/make_screenshots.py http://127.0.0.1:8000`.

Needs Playwright and a Chromium (`DLO_CHROMIUM` names another one than the first on the path).
"""

import argparse
from pathlib import Path

from browser import FLAGS, chromium
from playwright.sync_api import Browser, Page, sync_playwright

HERE = Path(__file__).parent
FIRST_SOLVE = 120_000  # ms; the solver may have to be compiled
WAIT = 2500  # ms, for a software renderer to catch up


def scene(browser: Browser, address: str) -> None:
    """Draw the scene alone: the paper's case with another target, in dark; and three ready scenes."""
    page = opened(browser, f"{address}/scene/?darkMode")
    target = page.get_by_text("Target [m]").locator("xpath=ancestor::*[.//input][1]").locator("input")
    for box, value in ((target.nth(0), "0.42"), (target.nth(1), "0.48")):
        box.fill(value)
        box.press("Enter")
        page.wait_for_timeout(500)
    drawn(page, "1.05", "Quality", "scene.png")
    page = opened(browser, f"{address}/scene/?example=two-grippers")
    drawn(page, "0.7", "Scene", "scene-two-grippers.png")
    page = opened(browser, f"{address}/scene/?example=twist-buckles&darkMode")
    choose(page, "Colour", "twist")
    drawn(page, "1.7", "View", "scene-twist.png")
    page = opened(browser, f"{address}/scene/?example=peg-with-friction")
    page.get_by_role("tab", name="Effects").click()
    page.get_by_role("button", name="Measure what each costs").click()
    page.locator("[data-effect=obstacles]").get_by_text("It ").wait_for(timeout=FIRST_SOLVE)
    choose(page, "Colour", "curvature")
    drawn(page, "1.4", "Effects", "scene-peg.png")


def opened(browser: Browser, url: str) -> Page:
    """Open a scene and wait for its first prediction."""
    page = browser.new_page(viewport={"width": 1280, "height": 800})
    page.goto(url)
    page.wait_for_selector('[data-status="converged"]', timeout=FIRST_SOLVE)
    return page


def choose(page: Page, label: str, option: str) -> None:
    """Choose an option of the view."""
    page.get_by_role("tab", name="View").click()
    page.get_by_role("combobox", name=label).click()
    page.get_by_role("option", name=option).click()


def drawn(page: Page, time: str, tab: str, file: str) -> None:
    """Draw a scene at a time [s], with a tab of its panel open."""
    page.get_by_role("button", name="Pause").click()
    page.get_by_role("button", name="Play").wait_for()
    page.wait_for_timeout(WAIT)  # what was played before it paused may still come, and write the time again
    box = page.locator("input[type=text]").first
    box.fill(time)
    box.press("Enter")
    page.get_by_role("tab", name=tab).click()
    settle(page)
    page.screenshot(path=HERE / file)
    page.close()


def landing(browser: Browser, address: str) -> None:
    """Draw the gallery of the landing page and what accuracy costs, in dark, with its motion stopped."""
    page = browser.new_page(viewport={"width": 1400, "height": 900}, color_scheme="dark")
    page.goto(address)
    frame = page.frame_locator("#scene")
    frame.locator('[data-status="converged"]').wait_for(timeout=FIRST_SOLVE)
    frame.get_by_role("button", name="Pause").click()
    settle(page)
    for part in ("gallery", "speed"):
        page.locator(f"#{part}").screenshot(path=HERE / f"landing-{part}.png")


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
