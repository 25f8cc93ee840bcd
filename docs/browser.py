"""The browser that the pictures of the documentation are drawn with."""

import os
import shutil

FLAGS = ["--headless", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]


def chromium() -> str:
    """Return the path of a Chromium, that of `DLO_CHROMIUM` before all others.

    Raises:
        SystemExit: there is none.
    """
    names = [os.environ.get("DLO_CHROMIUM", ""), "chromium", "chromium-browser", "google-chrome"]
    path = next((found for name in names if name and (found := shutil.which(name))), None)
    if path is None:
        raise SystemExit("No Chromium found: install one, or name it in DLO_CHROMIUM.")
    return path
