"""Common to all parts of a recording: names, colours (Okabe-Ito or darker, one for each effect), making of chunks."""

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from rerun.chunk import Chunk

Floats = NDArray[np.float64]
Colour = tuple[int, int, int]
APPLICATION = "dlo"
STRIPS = 9  # times at which a whole motion is drawn
SAMPLES_U = 65
FORCE_TIMES = 17  # times of a motion at which the forces of its effects are evaluated
MAX_COORDINATE = 1e6  # m; a motion beyond it has diverged and isn't drawn

BLUE: Colour = (0, 114, 178)
ORANGE: Colour = (230, 159, 0)
GREEN: Colour = (0, 158, 115)
VERMILION: Colour = (213, 94, 0)
PURPLE: Colour = (204, 121, 167)
SKY: Colour = (86, 180, 233)
YELLOW: Colour = (240, 228, 66)
GREY: Colour = (150, 150, 150)
OBSTACLE: Colour = (118, 186, 166)  # green, lightened because solids are shaded
EFFECTS = {
    "inertia": BLUE,
    "damping": PURPLE,
    "drag": SKY,
    "gravity": GREEN,
    "stretch": VERMILION,
    "bend": ORANGE,
    "twist": YELLOW,
    "plasticity": (143, 85, 117),
    "table": (0, 80, 125),
    "friction": (149, 66, 0),
    "obstacles": OBSTACLE,
}
ENERGIES = {"kinetic": BLUE, "bend": ORANGE, "stretch": VERMILION, "gravity": GREEN, "twist": YELLOW}
EARLY, LATE = np.array([178, 214, 240.0]), np.array([0, 70, 140.0])  # ends of the ramp over the time of a motion


def chunk(entity: str, indexes: Iterable[Any], columns: Any) -> "Chunk":
    """Return one chunk; without indexes, its data show on every timeline."""
    import rerun as rr

    return rr.chunk.Chunk.from_columns(entity, indexes=indexes, columns=columns)


def axes_chunk() -> "Chunk":
    """Return the convention of the world frame."""
    import rerun as rr

    axes = rr.components.ViewCoordinates.RIGHT_HAND_Z_UP
    return chunk("/", [], rr.ViewCoordinates.columns(xyz=[axes]))


def line_style(entity: str, name: str, colour: Colour, *, width: float = 2.0) -> "Chunk":
    """Return name, colour and width of a plotted line."""
    import rerun as rr

    return chunk(entity, [], rr.SeriesLines.columns(names=[name], colors=[colour], widths=[width]))


def scalars(entity: str, indexes: Iterable[Any], values: Floats) -> "Chunk":
    """Return the values of a plotted line."""
    import rerun as rr

    return chunk(entity, indexes, rr.Scalars.columns(scalars=values))


def drawable(positions: Floats) -> bool:
    """Return whether positions [m] are finite and small enough to be drawn."""
    return bool(np.abs(positions).max() < MAX_COORDINATE)


def time_ramp(share: Floats) -> NDArray[np.uint8]:
    """Return the colours (k, 3) of instants at a `share` (k,) of the horizon, from light to dark."""
    share = share[:, None]
    return np.rint((1 - share) * EARLY + share * LATE).astype(np.uint8)
