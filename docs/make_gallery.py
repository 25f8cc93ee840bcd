"""Draw the gallery's pictures, static/gallery/*.svg, from predictions of its scenes.

Usage: PYTHONPATH=. python docs/make_gallery.py [NAME ...]

The colours read on light and on dark ground.
"""

import argparse
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.pages.gallery import Example, examples
from app.schemas import to_scene
from app.viewer.palette import OBSTACLE, STEEL, colour
from dlocore import Cylinder, Grasp, Prediction, predict

Floats = NDArray[np.float64]
FOLDER = Path(__file__).parents[1] / "static" / "gallery"
WIDTH, HEIGHT, MARGIN = 320, 200, 18  # px
STRIPS, GHOSTS, POINTS = 18, 7, 30
FROM_THE_FRONT = (-90.0, 48.0)  # azimuth and elevation of the eye [deg]
EYES = {"two-grippers": (-62.0, 22.0), "twist-buckles": (-50.0, 25.0)}


@dataclass(frozen=True)
class View:
    """An orthographic view that a set of points fills.

    Attributes:
        axes: (3, 3) right, up and towards the eye, in rows.
        scale: of the picture [px/m].
        middle: what is shown in the middle, along right and up (2,) [m].
    """

    axes: Floats
    scale: float
    middle: Floats

    @staticmethod
    def of(eye: tuple[float, float], points: Floats) -> "View":
        """Return the view from `eye`, azimuth and elevation [deg], that shows all of `points` (k, 3) [m]."""
        azimuth, elevation = np.radians(eye)
        towards = np.array(
            [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
        )
        right = np.cross([0, 0, 1], towards)
        right /= np.linalg.norm(right)
        axes = np.array([right, np.cross(towards, right), towards])
        low, high = (points @ axes[:2].T).min(axis=0), (points @ axes[:2].T).max(axis=0)
        room = np.array([WIDTH - 2 * MARGIN, HEIGHT - 2 * MARGIN])
        return View(axes, float((room / np.maximum(high - low, 1e-9)).min()), 0.5 * (low + high))

    def __call__(self, points: Floats) -> Floats:
        """Return where `points` (k, 3) [m] are in the picture (k, 2) [px]."""
        plane = (points @ self.axes[:2].T - self.middle) * self.scale
        return plane * [1, -1] + [WIDTH / 2, HEIGHT / 2]

    def depth(self, points: Floats) -> Floats:
        """Return how near to the eye `points` (k, 3) are (k,) [m]."""
        return points @ self.axes[2]


def css(rgb: Iterable[int]) -> str:
    """Return a colour (r, g, b), 0 to 255, as in a style sheet."""
    return "#" + "".join(f"{channel:02x}" for channel in rgb)


def path(points: Floats, close: bool = False) -> str:
    """Return the path through `points` (k, 2) [px]."""
    return "M" + "L".join(f"{x:.1f} {y:.1f}" for x, y in points) + ("Z" if close else "")


def line(points: Floats, color: str, width: float, opacity: float = 1.0, more: str = "") -> str:
    """Return a line through `points` (k, 2) [px]."""
    return f'<path d="{path(points)}" stroke="{color}" stroke-width="{width}" stroke-opacity="{opacity:g}"{more}/>'


def picture(example: Example, motion: Prediction) -> str:
    """Return the picture of a motion as SVG: the surface that the cable sweeps, and the cable at a few times."""
    surface, scene = motion.surface, motion.scene
    u = np.linspace(0.0, surface.length, POINTS)
    t = np.linspace(0.0, surface.horizon, STRIPS + 1)
    swept = surface.positions(u, t)
    posts = [solid for solid in scene.environment.obstacles if isinstance(solid, Cylinder)]
    rims = [rim for post in posts for rim in ends(post)]
    view = View.of(EYES.get(example.name, FROM_THE_FRONT), np.vstack([swept.reshape(-1, 3), *rims]))
    parts = [f'<rect width="{WIDTH}" height="{HEIGHT}" fill="none"/>']
    if scene.environment.table is not None:
        parts += table(view, scene.environment.table.height)
    veil = 0.2 if scene.environment.table is not None else 0.11  # in space the strips lie over each other
    for k in range(STRIPS):
        band = view(np.vstack([swept[k], swept[k + 1][::-1]]))
        parts.append(
            f'<path d="{path(band, close=True)}" fill="{css(colour((k + 0.5) / STRIPS))}" fill-opacity="{veil}"/>'
        )
    for grasp in scene.grasps:
        held = surface.positions([grasp.u], held_times(grasp, surface.horizon))[:, 0]
        parts.append(line(view(held), css(STEEL), 1.2, more=' stroke-dasharray="3 3"'))
    front = []
    fine = np.linspace(0.0, surface.length, 3 * POINTS)
    for k, shape in enumerate(surface.positions(fine, np.linspace(0.0, surface.horizon, GHOSTS))):
        late = k / (GHOSTS - 1)
        width, opacity = (3.2, 1.0) if late == 1.0 else (1.6, 0.85)
        for run, hidden in runs(shape, view, rims):
            (parts if hidden else front).append(line(view(run), css(colour(late)), width, opacity))
    for near, far in zip(rims[::2], rims[1::2], strict=True):
        parts += post_parts(view, near, far)
    parts += front
    for grasp in scene.grasps:
        end = held_times(grasp, surface.horizon)[-1]
        x, y = view(surface.positions([grasp.u], [end])[0])[0]
        parts.append(
            f'<circle cx="{x:.1f}" cy="{y:.1f}" r="4.5" fill="#fff" stroke="{css(STEEL)}" stroke-width="2.4"/>'
        )
    drawn = "\n".join(parts)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" height="{HEIGHT}" '
        f'fill="none" stroke-linecap="round" stroke-linejoin="round">\n{drawn}\n</svg>\n'
    )


def held_times(grasp: Grasp, horizon: float) -> Floats:
    """Return times (19,) [s] from the grasp to its release."""
    return np.linspace(grasp.grasp_time or 0.0, min(grasp.release_time or horizon, horizon), 19)


def table(view: View, height: float) -> list[str]:
    """Return a grid of 0.1 m on the table, over the whole picture."""
    right, up, towards = view.axes
    middle = right * view.middle[0] + up * view.middle[1]
    middle = middle - towards * (middle[2] - height) / towards[2]
    x, y = np.round(middle[:2], 1)
    ticks = 0.1 * np.arange(-40, 41)
    ends = [([x + d, y - 4, height], [x + d, y + 4, height]) for d in ticks]
    ends += [([x - 4, y + d, height], [x + 4, y + d, height]) for d in ticks]
    drawn = [view(np.array(pair)) for pair in ends]
    seen = [d for d in drawn if all((d[:, k].max() >= 0) and (d[:, k].min() <= (WIDTH, HEIGHT)[k]) for k in (0, 1))]
    return [line(np.clip(d, -WIDTH, 2 * WIDTH), css(STEEL), 0.6, 0.28) for d in seen]


def ends(post: Cylinder) -> tuple[Floats, Floats]:
    """Return the lower and the upper rim of a cylinder (37, 3) [m] each, the lower at the height of its middle."""
    axis = np.asarray(post.axis, dtype=float) / np.linalg.norm(post.axis)
    across = np.cross(axis, [1.0, 0.0, 0.0] if abs(axis[0]) < 0.9 else [0.0, 1.0, 0.0])
    across /= np.linalg.norm(across)
    phi = np.linspace(0.0, 2 * np.pi, 37)[:, None]
    rim = np.asarray(post.center) + post.radius * (np.cos(phi) * across + np.sin(phi) * np.cross(axis, across))
    return rim, rim + 0.5 * post.height * axis


def post_parts(view: View, low: Floats, high: Floats) -> list[str]:
    """Return the outline and the top of a cylinder between two rims."""
    side = view(np.vstack([low, high]))
    return [
        f'<path d="{path(side[convex(side)], close=True)}" fill="{css(OBSTACLE)}"/>',
        f'<path d="{path(view(high), close=True)}" fill="#fff" fill-opacity="0.25"/>',
    ]


def convex(points: Floats) -> list[int]:
    """Return the indices of the convex hull of `points` (k, 2), in order."""
    order = [int(k) for k in np.lexsort((points[:, 1], points[:, 0]))]

    def half(indices: Iterable[int]) -> list[int]:
        chain: list[int] = []
        for k in indices:
            while len(chain) > 1:
                a, b = points[chain[-1]] - points[chain[-2]], points[k] - points[chain[-2]]
                if a[0] * b[1] - a[1] * b[0] > 0:
                    break
                chain.pop()
            chain.append(k)
        return chain[:-1]

    return half(order) + half(order[::-1])


def runs(shape: Floats, view: View, rims: list[Floats]) -> Iterator[tuple[Floats, bool]]:
    """Split a cable (k, 3) into the runs behind the posts and those in front of them."""
    behind = np.zeros(len(shape), dtype=bool)
    for low in rims[::2]:
        behind |= view.depth(shape) < view.depth(low).mean()
    cuts = [0, *(np.flatnonzero(np.diff(behind)) + 1), len(shape) - 1]
    for first, last in pairwise(cuts):
        if last > first:
            yield shape[first : last + 1], bool(behind[first])


def main() -> None:
    """Draw the pictures, and print how each scene was solved."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("name", nargs="*", help="examples to draw; all of them where absent")
    chosen = parser.parse_args().name or list(examples())
    for name in chosen:
        example = examples()[name]
        motion = predict(to_scene(example.request, lambda _: None))
        (FOLDER / f"{name}.svg").write_text(picture(example, motion))
        accuracy = motion.accuracy
        error = "-" if accuracy.error_estimate is None else f"{1e3 * accuracy.error_estimate:.2g} mm"
        print(f"{name:18} {motion.status:10} {accuracy.method:9} {1e3 * accuracy.wall_time:6.0f} ms  {error}")


if __name__ == "__main__":
    main()
