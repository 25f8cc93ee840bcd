"""Colours: ramps that are legible on light and dark backgrounds, and the quantities that they show."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

import numpy as np
from numpy.typing import NDArray

from dlocore import Prediction

Floats = NDArray[np.float64]
Colours = NDArray[np.uint8]

BRAND = (46, 107, 214)
STEEL = (128, 138, 154)
WARNING = (222, 72, 50)
REACTION = (213, 94, 0)
LOAD = (0, 140, 95)  # Okabe-Ito's bluish green, which is not in the ramp
OBSTACLE = (84, 152, 134)  # Okabe-Ito's bluish green, muted with grey
CONTACT = (230, 159, 0)
# from blue to amber, increasingly light, in steps that look about equal
_RAMP = np.array(
    [(46, 82, 190), (96, 84, 212), (150, 82, 206), (203, 88, 172), (236, 113, 118), (248, 150, 84), (248, 196, 88)],
    dtype=float,
)
# between Okabe-Ito's blue and vermilion, lightest at zero
_DIVERGING = np.array([(0, 92, 160), (64, 148, 205), (205, 210, 214), (232, 138, 72), (200, 76, 0)], dtype=float)


def ramp(values: Floats, *, signed: bool = False) -> Colours:
    """Return the colours (n, 3) of `values` (n,), 0 to 1. If they are signed, 0.5 stands for zero."""
    stops = _DIVERGING if signed else _RAMP
    x = np.clip(np.nan_to_num(values), 0.0, 1.0) * (len(stops) - 1)
    channels = [np.interp(x, np.arange(len(stops)), stops[:, channel]) for channel in range(3)]
    return np.rint(np.stack(channels, axis=-1)).astype(np.uint8)


def linear(colours: NDArray[np.integer]) -> Colours:
    """Convert sRGB colours to linear light, which the client expects for instances and vertices."""
    share = colours / 255.0
    light = np.where(share <= 0.04045, share / 12.92, ((share + 0.055) / 1.055) ** 2.4)
    return np.rint(255.0 * light).astype(np.uint8)


def colour(value: float) -> tuple[int, int, int]:
    """Return the colour of one value, 0 to 1."""
    r, g, b = ramp(np.array([value]))[0]
    return int(r), int(g), int(b)


def css_ramp(*, signed: bool = False) -> str:
    """Return the ramp as a CSS gradient."""
    stops = ", ".join(f"rgb({int(r)} {int(g)} {int(b)})" for r, g, b in (_DIVERGING if signed else _RAMP))
    return f"linear-gradient(90deg, {stops})"


@dataclass(frozen=True)
class Quantity:
    """What the cable's colour shows.

    Attributes:
        name: name on the panel.
        unit: unit of the shown values.
        values: prediction, u (k_u,) [m], t (k_t,) [s] -> (k_t, k_u).
        signed: whether the scale is symmetric about zero.
        scale: factor from the values to the unit.
    """

    name: str
    unit: str
    values: Callable[[Prediction, Floats, Floats], Floats]
    signed: bool = False
    scale: float = 1.0


def _time(_prediction: Prediction, u: Floats, t: Floats) -> Floats:
    return np.repeat(t[:, None], len(u), axis=1)


def _curvature(prediction: Prediction, u: Floats, t: Floats) -> Floats:
    return prediction.surface.curvature(u, t)


def _speed(prediction: Prediction, u: Floats, t: Floats) -> Floats:
    return np.linalg.norm(prediction.surface(u, t, dt=1)[..., :3], axis=-1)


def _twist(prediction: Prediction, u: Floats, t: Floats) -> Floats:
    return prediction.surface.twist_rate(u, t)


def _strain(prediction: Prediction, u: Floats, t: Floats) -> Floats:
    return prediction.stretch.along(u, t)


def _tension(prediction: Prediction, u: Floats, t: Floats) -> Floats:
    """Return the axial force by which the cable transmits the grippers' reactions [N]."""
    return cast(float, prediction.scene.cable.axial_stiffness) * prediction.stretch.along(u, t)


QUANTITIES = {
    quantity.name: quantity
    for quantity in (
        Quantity("time", "s", _time),
        Quantity("curvature", "1/m", _curvature),
        Quantity("speed", "m/s", _speed),
        Quantity("twist", "rad/m", _twist, signed=True),
        Quantity("axial strain", "µm/m", _strain, signed=True, scale=1e6),
        Quantity("reaction", "N, tension", _tension, signed=True),
    )
}


@dataclass(frozen=True)
class ColourScale:
    """A quantity with the range that its colours span, in units before `scale`."""

    quantity: Quantity
    low: float
    high: float

    @staticmethod
    def of(quantity: Quantity, prediction: Prediction) -> "ColourScale":
        """Span the whole prediction: from zero, or symmetric about it, to the largest value."""
        u = np.linspace(0.0, prediction.surface.length, 61)
        t = np.linspace(0.0, prediction.surface.horizon, 25)
        largest = max(float(np.abs(quantity.values(prediction, u, t)).max()), 1e-12)
        return ColourScale(quantity, -largest if quantity.signed else 0.0, largest)

    def colours(self, prediction: Prediction, u: Floats, t: Floats) -> Colours:
        """Return the colours of instances or vertices at `u` (k_u,) and `t` (k_t,); (k_t, k_u, 3), linear."""
        values = self.quantity.values(prediction, u, t)
        return linear(ramp((values - self.low) / (self.high - self.low), signed=self.quantity.signed))
