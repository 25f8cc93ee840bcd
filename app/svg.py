"""Parts of SVG plots: colours, lines, dots, texts, and round ends of axes. Places are in the units of the drawing."""

import math
from collections.abc import Iterable
from html import escape

BLUE, ORANGE, GREEN, GREY = "#0072b2", "#d55e00", "#009e73", "#8a8f98"  # Okabe-Ito, and a grey
_STEPS = (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 8.0, 10.0)


def line(points: Iterable[tuple[float, float]], colour: str, width: float = 1.5, **attributes: object) -> str:
    """Return a line through `points`; `attributes` are further ones of SVG, as `stroke_opacity`."""
    through = " ".join(f"{x:.1f},{y:.1f}" for x, y in points)
    return f'<polyline points="{through}" fill="none" stroke="{colour}" stroke-width="{width:g}"{_more(attributes)}/>'


def dot(place: Iterable[float], radius: float, colour: str, title: str = "") -> str:
    """Return a dot at a place (x, y); `title` is shown on hover."""
    x, y = place
    shown = f"<title>{escape(title)}</title>" if title else ""
    return f'<circle cx="{x:.1f}" cy="{y:.1f}" r="{radius:g}" fill="{colour}">{shown}</circle>'


def text(x: float, y: float, words: str, anchor: str = "middle", **attributes: object) -> str:
    """Return a text whose `anchor` (start, middle or end) is at a place."""
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}"{_more(attributes)}>{escape(words)}</text>'


def upright(x: float, y: float, words: str, **attributes: object) -> str:
    """Return a text that runs upwards, with its middle at a place."""
    turned = f'transform="translate({x:.1f} {y:.1f}) rotate(-90)"'
    return f'<text {turned} text-anchor="middle"{_more(attributes)}>{escape(words)}</text>'


def round_up(value: float) -> float:
    """Return the next 1, 1.5, 2, 3, 4, 5 or 8 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(max(value, 1e-9)))
    return next(step * power for step in _STEPS if step * power >= value * (1.0 - 1e-12))


def _more(attributes: dict[str, object]) -> str:
    return "".join(f' {name.replace("_", "-")}="{value}"' for name, value in attributes.items())
