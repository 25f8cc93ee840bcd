"""Plots of a validation, as SVG files: the errors of the predicted windows, and their growth over time."""

from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

MODELS = {"scalars": "#d55e00", "bends": "#0072b2"}  # Okabe-Ito
GREY, GROUND = "#8a8f98", "#ffffff"  # the plots have their own background, since pages may be dark
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
    most = _round_up(1e3 * max(max(one["windows"].values()) for one in cables))
    parts = [*_axis(most, "L1 of a window [mm]"), *_legend(cables, "published")]
    width = (WIDTH - LEFT - GAP) / len(names)
    for k, name in enumerate(names):
        middle = LEFT + (k + 0.5) * width
        parts.append(_text(middle, HEIGHT - BOTTOM + 18, name, "middle"))
        if name in published:
            y = _down(1e3 * published[name], most)
            parts.append(_line(middle - 0.42 * width, y, middle + 0.42 * width, y, GREY, dash=True))
        for one in (one for one in cables if one["cable"] == name):
            model, values = str(one["model"]), 1e3 * np.array(list(one["windows"].values()))
            shift = width * (-0.2 if model == "scalars" else 0.2)
            for j, value in enumerate(values):
                x = middle + shift + 0.11 * width * (j / max(len(values) - 1, 1) - 0.5) * 2.0
                parts.append(f'<circle cx="{x:.1f}" cy="{_down(value, most):.1f}" r="2.6" fill="{MODELS[model]}"/>')
            y = _down(float(values.mean()), most)
            parts.append(_line(middle + shift - 0.15 * width, y, middle + shift + 0.15 * width, y, MODELS[model]))
    return _svg("L1 of the predicted windows of each cable", parts)


def _over_time(cables: Sequence[Mapping[str, Any]]) -> str:
    """Return the plot of the mean distance of the free markers over time, averaged over windows, a panel per cable."""
    names = list(dict.fromkeys(str(one["cable"]) for one in cables))
    means = [1e3 * np.nanmean(np.array(list(one["over_time"].values()), dtype=float), axis=0) for one in cables]
    most = _round_up(max(float(np.nanmax(mean)) for mean in means))
    parts = [*_axis(most, "mean distance of a free marker [mm]"), *_legend(cables)]
    width = (WIDTH - LEFT - GAP) / len(names)
    for one, mean in zip(cables, means, strict=True):
        left = LEFT + names.index(str(one["cable"])) * width + 0.04 * width
        x = left + 0.92 * width * np.linspace(0.0, 1.0, len(mean))
        points = " ".join(f"{a:.1f},{_down(b, most):.1f}" for a, b in zip(x[::4], mean[::4], strict=True))
        colour = MODELS[str(one["model"])]
        parts.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.5"/>')
    for k, name in enumerate(names):
        left = LEFT + k * width
        parts.append(_text(left + 0.5 * width, HEIGHT - BOTTOM + 18, f"{name}, 0 to 5 s", "middle"))
        parts.append(_line(left, TOP, left, HEIGHT - BOTTOM, "#dddddd"))
    return _svg("Distance from the prediction over time", parts)


def _axis(most: float, label: str) -> list[str]:
    parts = []
    for share in (0.0, 0.25, 0.5, 0.75, 1.0):
        y = _down(share * most, most)
        parts += [_line(LEFT, y, WIDTH - GAP, y, "#dddddd"), _text(LEFT - 6, y + 4, f"{share * most:g}", "end")]
    middle = 0.5 * (TOP + HEIGHT - BOTTOM)
    parts.append(
        f'<text transform="translate(14 {middle}) rotate(-90)" text-anchor="middle" fill="#333">{escape(label)}</text>'
    )
    return parts


def _legend(cables: Sequence[Mapping[str, Any]], more: str = "") -> list[str]:
    parts, x = [], LEFT
    for model in [m for m in MODELS if any(one["model"] == m for one in cables)]:
        parts += [_line(x, 17, x + 20, 17, MODELS[model]), _text(x + 26, 21, model, "start")]
        x += 100.0
    if more:
        parts += [_line(x, 17, x + 20, 17, GREY, dash=True), _text(x + 26, 21, more, "start")]
    return parts


def _down(value: float, most: float) -> float:
    return HEIGHT - BOTTOM - (HEIGHT - BOTTOM - TOP) * value / most


def _round_up(value: float) -> float:
    """Return the next 1, 1.5, 2, 3, 4, 5 or 8 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(max(value, 1e-9)))
    return next(float(n * power) for n in (1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 8.0, 10.0) if n * power >= value)


def _line(x0: float, y0: float, x1: float, y1: float, colour: str, *, dash: bool = False) -> str:
    style = ' stroke-dasharray="5 3"' if dash else ""
    width = 1.0 if colour == "#dddddd" else 2.0
    return (
        f'<line x1="{x0:.1f}" y1="{y0:.1f}" x2="{x1:.1f}" y2="{y1:.1f}" stroke="{colour}" '
        f'stroke-width="{width}"{style}/>'
    )


def _text(x: float, y: float, words: str, anchor: str) -> str:
    return f'<text x="{x:.1f}" y="{y:.1f}" text-anchor="{anchor}" fill="#333">{escape(words)}</text>'


def _svg(title: str, parts: list[str]) -> str:
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH:.0f} {HEIGHT:.0f}" role="img" '
        f'font-family="system-ui, sans-serif" font-size="12"><title>{escape(title)}</title>'
        f'<rect width="100%" height="100%" fill="{GROUND}"/>{"".join(parts)}</svg>\n'
    )
