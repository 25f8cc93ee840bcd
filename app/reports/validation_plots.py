"""Plots of a validation, as SVG files: the errors of the predicted windows, and their growth over time."""

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app import svg

Floats = NDArray[np.float64]

MODELS = {"scalars": svg.ORANGE, "bends": svg.BLUE}
GROUND = "#ffffff"  # the plots have their own background, since pages may be dark
WIDTH, HEIGHT, LEFT, TOP, BOTTOM, GAP = 760.0, 300.0, 56.0, 34.0, 40.0, 14.0


def plots_of(documents: Sequence[Mapping[str, Any]], published: Mapping[str, float]) -> dict[str, str]:
    """Return the plots by file name; none if no cable was predicted.

    Args:
        documents: the documents that `dlo validate --json` writes.
        published: published L1 of other methods by cable [m].
    """
    cables = [one for one in documents if "cable" in one]
    if not cables:
        return {}
    return {"validation-windows.svg": _windows(cables, published), "validation-time.svg": _over_time(cables)}


def _windows(cables: Sequence[Mapping[str, Any]], published: Mapping[str, float]) -> str:
    """Return the plot of the L1 of every predicted window by cable and model: dots, and their mean as a line."""
    names = list(dict.fromkeys(str(one["cable"]) for one in cables))
    most = svg.round_up(1e3 * max(max(one["windows"].values()) for one in cables))
    parts = [*_axis(most, "L1 of a window [mm]"), *_legend(cables, "published")]
    width = (WIDTH - LEFT - GAP) / len(names)
    for k, name in enumerate(names):
        middle = LEFT + (k + 0.5) * width
        parts.append(svg.text(middle, HEIGHT - BOTTOM + 18, name))
        if name in published:
            y = _down(1e3 * published[name], most)
            parts.append(_level(middle - 0.42 * width, middle + 0.42 * width, y, svg.GREY, dash=True))
        for one in (one for one in cables if one["cable"] == name):
            model, values = str(one["model"]), 1e3 * np.array(list(one["windows"].values()))
            shift = width * (-0.2 if model == "scalars" else 0.2)
            for j, value in enumerate(values):
                x = middle + shift + 0.11 * width * (j / max(len(values) - 1, 1) - 0.5) * 2.0
                parts.append(svg.dot((x, _down(value, most)), 2.6, MODELS[model]))
            y = _down(float(values.mean()), most)
            parts.append(_level(middle + shift - 0.15 * width, middle + shift + 0.15 * width, y, MODELS[model]))
    return _drawing("L1 of the predicted windows of each cable", parts)


def _over_time(cables: Sequence[Mapping[str, Any]]) -> str:
    """Return the plot of the mean distance of the free markers over time, averaged over windows, a panel per cable."""
    names = list(dict.fromkeys(str(one["cable"]) for one in cables))
    means = [1e3 * np.nanmean(np.array(list(one["over_time"].values()), dtype=float), axis=0) for one in cables]
    most = svg.round_up(max(float(np.nanmax(mean)) for mean in means))
    parts = [*_axis(most, "mean distance of a free marker [mm]"), *_legend(cables)]
    width = (WIDTH - LEFT - GAP) / len(names)
    for one, mean in zip(cables, means, strict=True):
        left = LEFT + names.index(str(one["cable"])) * width + 0.04 * width
        x = left + 0.92 * width * np.linspace(0.0, 1.0, len(mean))
        points = [(a, _down(b, most)) for a, b in zip(x[::4], mean[::4], strict=True)]
        parts.append(svg.line(points, MODELS[str(one["model"])]))
    for k, name in enumerate(names):
        left = LEFT + k * width
        parts.append(svg.text(left + 0.5 * width, HEIGHT - BOTTOM + 18, f"{name}, 0 to 5 s"))
        parts.append(_rule(left, TOP, left, HEIGHT - BOTTOM))
    return _drawing("Distance from the prediction over time", parts)


def _axis(most: float, label: str) -> list[str]:
    parts = []
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):
        y = _down(share * most, most)
        parts += [_rule(LEFT, y, WIDTH - GAP, y), svg.text(LEFT - 6, y + 4, f"{share * most:g}", "end")]
    return [*parts, svg.upright(14, 0.5 * (TOP + HEIGHT - BOTTOM), label)]


def _legend(cables: Sequence[Mapping[str, Any]], more: str = "") -> list[str]:
    parts, x = [], LEFT
    for model in [m for m in MODELS if any(one["model"] == m for one in cables)]:
        parts += [_level(x, x + 20, 17, MODELS[model]), svg.text(x + 26, 21, model, "start")]
        x += 100.0
    if more:
        parts += [_level(x, x + 20, 17, svg.GREY, dash=True), svg.text(x + 26, 21, more, "start")]
    return parts


def _down(value: float, most: float) -> float:
    return HEIGHT - BOTTOM - (HEIGHT - BOTTOM - TOP) * value / most


def _rule(x0: float, y0: float, x1: float, y1: float) -> str:
    return svg.line([(x0, y0), (x1, y1)], "#dddddd", 1.0)


def _level(x0: float, x1: float, y: float, colour: str, *, dash: bool = False) -> str:
    return svg.line([(x0, y), (x1, y)], colour, 2.0, **({"stroke_dasharray": "5 3"} if dash else {}))


def _drawing(title: str, parts: list[str]) -> str:
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH:.0f} {HEIGHT:.0f}" role="img" '
        f'font-family="system-ui, sans-serif" font-size="12" fill="#333"><title>{escape(title)}</title>'
        f'<rect width="100%" height="100%" fill="{GROUND}"/>{"".join(parts)}</svg>\n'
    )
