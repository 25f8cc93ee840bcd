"""Place the camera when a scene is opened."""

import numpy as np
from numpy.typing import NDArray

from app.viewer.draft import Draft
from dlocore import SplineSurface
from dlocore.shape.shape import StartCurve

Floats = NDArray[np.float64]
FIELD_OF_VIEW = 0.7  # rad, vertical
DISTANCE = 2.5  # distance from the middle, as a multiple of the radius of what is to be seen
SMALLEST = 0.2  # of the cable's length: half the smallest extent to show, to leave room for dragging a target
WIDE = 1.35  # width over height of a picture that shows a wide scene from `DISTANCE`; a narrower one needs more
PANEL = 320  # px, width of the docked panel
PHONE = 576  # px: on a page no wider than this, the panel is a sheet over the lower part of the picture
ROWS = 97  # times at which a motion is sampled
SHEET = 0.6  # share of the picture's height that the sheet covers
FROM_ABOVE = np.array([0.0, 0.66, -0.75])  # from the camera to what it looks at: a table
FROM_THE_SIDE = np.array([0.28, 0.90, -0.34])  # the same: a hanging cable


def extent(draft: Draft, start: StartCurve, shown: SplineSurface | None = None) -> Floats:
    """Return points (n, 3) [m] that should be visible: the start of the cable, the targets of its grippers, its motion.

    A small motion gets room around it for dragging a target.

    Args:
        draft: the scene.
        start: start curve of the scene.
        shown: the motion that is shown, if any.
    """
    curve = start(np.linspace(0.0, draft.length, 33))
    middle = 0.5 * (curve.min(axis=0) + curve.max(axis=0))
    room = SMALLEST * draft.length * np.array([1.0, 1.0, 0.0])
    points = [curve, middle[None] - room, middle[None] + room]
    for primitive in draft.primitives:
        path = primitive["path"]
        if path["kind"] == "move":
            points.append(start(primitive["u"]) + np.array(path["displacement"], dtype=float))
        elif path["kind"] == "waypoints":
            points.append(np.array(path["positions"], dtype=float))
    if shown is not None:
        points.append(shown.sample(33, ROWS)[2][..., :3].reshape(-1, 3))
    return np.concatenate(points)


def start_pose(points: Floats, page_width: int, page_height: int, *, on_table: bool) -> tuple[Floats, Floats]:
    """Return the camera's position and the point it looks at [m].

    Args:
        points: points that should be visible (n, 3) [m].
        page_width: width of the whole page including the panel [px].
        page_height: height of the whole page [px].
        on_table: whether there is a table, best seen from above.
    """
    low, high = points.min(axis=0), points.max(axis=0)
    middle = 0.5 * (low + high)
    phone = page_width <= PHONE
    view = FROM_ABOVE if on_table else FROM_THE_SIDE
    view = view / np.linalg.norm(view)
    aspect = max(page_width if phone else page_width - PANEL, 1) / max(page_height, 1)
    distance = DISTANCE * 0.5 * float(np.linalg.norm(high - low)) * max(1.0, WIDE / aspect)
    if phone:  # look at a nearer point, so that the cable appears above the sheet
        middle = middle - SHEET * np.tan(0.5 * FIELD_OF_VIEW) * distance * np.array([0.0, 1.0, 0.0])
    return middle - distance * view, middle
