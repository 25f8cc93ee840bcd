"""Make docs/recording.png, a recording in the viewer of the service: `python docs/make_recording_picture.py ADDRESS`.

Needs a running service, Playwright and a Chromium (`DLO_CHROMIUM` names another one than the first on the path).
"""

import argparse
import json
from pathlib import Path
from urllib.request import Request, urlopen

from browser import FLAGS, chromium
from playwright.sync_api import sync_playwright

HERE = Path(__file__).parent
LOADED = 60_000  # ms
DRAWN = 8_000  # ms, for a software renderer to catch up
SCENE = {
    "cable": {
        "length": 1.0,
        "diameter": 0.005,
        "linear_density": 0.05,
        "bending_stiffness": 0.001,
    },
    "shape": {"kind": "straight", "start": [0, 0, 0], "direction": [1, 0, 0]},
    "primitives": [
        {
            "u": 0.25,
            "hold": "point",
            "path": {"kind": "move", "displacement": [0.0, 0.5, 0.0], "duration": 1.6, "profile": "minimum_jerk"},
        }
    ],
    "environment": {"drag": 0.05, "table": {"height": 0.0, "friction": 0.0}},
    "quality": {"n_u": 9, "n_t": 13, "delta": 1e-5},
}


def solved(address: str) -> str:
    """Solve the paper's case on the service and return the address of its recording in the viewer."""
    body = json.dumps(SCENE).encode()
    request = Request(f"{address}/v1/predictions", data=body, headers={"Content-Type": "application/json"})
    with urlopen(request) as response:
        return address + str(json.load(response)["links"]["viewer"])


def main() -> None:
    """Make the picture."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("address", nargs="?", default="http://127.0.0.1:8000")
    parser.add_argument("--output", type=Path, default=HERE / "recording.png")
    options = parser.parse_args()
    viewer = solved(options.address.rstrip("/"))
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium(), args=FLAGS)
        page = browser.new_page(viewport={"width": 1600, "height": 950})
        page.goto(viewer)
        page.wait_for_selector("canvas", timeout=LOADED)
        page.wait_for_timeout(DRAWN)
        page.screenshot(path=options.output)
        browser.close()


if __name__ == "__main__":
    main()
