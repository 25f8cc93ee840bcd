"""Where the camera stands when a scene is opened."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
FIELD_OF_VIEW = 0.7  # rad, vertical
DISTANCE = 1.75  # from the middle, of the cable's length
WIDE = 1.2  # picture at least that much wider than high: the whole cable is in it from `DISTANCE`
PANEL = 320  # px that the docked panel takes
PHONE = 576  # px: a page no wider has its panel in a sheet over the lower part of the picture
SHEET = 0.6  # of the picture's height, that the sheet covers
VIEW = np.array([0.0, 0.66, -0.75])  # from the camera to what it looks at


def start_pose(length: float, page_width: int, page_height: int) -> tuple[Floats, Floats]:
    """Return the camera's position and the point it looks at [m], for a cable along x from the origin.

    Args:
        length: of the cable [m].
        page_width: of the whole page [px], the panel included.
        page_height: of the whole page [px].
    """
    phone = page_width <= PHONE
    aspect = max(page_width if phone else page_width - PANEL, 1) / max(page_height, 1)
    distance = DISTANCE * length * max(1.0, WIDE / aspect)
    middle = np.array([0.5 * length, 0.2 * length, 0.0])
    if phone:  # look at a nearer point of the table, so that the cable comes to lie above the sheet
        middle[1] -= SHEET * np.tan(0.5 * FIELD_OF_VIEW) * distance / -VIEW[2]
    return middle - distance * VIEW, middle
