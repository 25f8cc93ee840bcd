"""Random scenes predicted as they are and as each of their images: how far apart the answers are."""

from contextlib import suppress
from typing import Any

import numpy as np

from benchmarks.hard.generator import Drawn
from benchmarks.hard.images import Image, mirrored, other_units, reversed_cable, seen, tilted, turned
from benchmarks.hard.judge import OPEN
from dlocore import Prediction, SceneError, predict

APART = (1e-6, 1e-4, 1e-2)  # of the length: answers farther apart than each are counted
FAR = 1e-3  # of the length: what is nearer is no other answer, whatever both tell
_SHIFT = np.array([3.0, -2.0, 0.5])
LOOKS = {
    "turned about the vertical": turned(1.1, _SHIFT),
    "turned about any axis": tilted([0.7, -1.1, 0.9], _SHIFT),
    "mirrored": mirrored(),
    "from the other end": reversed_cable(),
    "units that keep gravity": other_units(4.0, 2.0, 7.0),
    "cm, g, s": other_units(100.0, 1.0, 1000.0),
}


def stays_level(image: Image) -> bool:
    """Tell whether an image keeps the vertical, so that a table stays one."""
    return bool(np.array_equal(image.frame[2], [0.0, 0.0, 1.0]))


def away(here: Prediction, there: Prediction, image: Image) -> float:
    """Return the largest distance between a motion and that of its image seen back, of the length."""
    length, horizon = here.scene.cable.length, here.surface.horizon
    u, t = np.linspace(0.0, length, 41), np.linspace(0.0, horizon, 17)
    apart = image.back(there.surface, u, t, length) - here.surface.positions(u, t)
    return float(np.linalg.norm(apart, axis=-1).max()) / length


def look(drawn: Drawn, deadline: float) -> dict[str, Any]:
    """Predict a scene and its images, and return a record of how far the answer of each image is from the scene's.

    An image is left out where it tilts a table. Answers are compared where both converge: one that the deadline cuts
    off depends on the machine.
    """
    record: dict[str, Any] = {"index": drawn.index, "families": drawn.families, "possible": drawn.possible}
    record |= {"status": "refused", "images": {}}
    with suppress(SceneError):
        scene = drawn.make()
        here = predict(scene, deadline=deadline)
        record["status"] = here.status
        for name, image in LOOKS.items() if here.status == "converged" else ():
            if scene.environment.table is None or stays_level(image):
                record["images"][name] = _seen(here, image, deadline)
    return record


def _seen(here: Prediction, image: Image, deadline: float) -> dict[str, Any]:
    try:
        there = predict(seen(here.scene, image), deadline=deadline)
    except SceneError as error:  # of numbers that are too large in its units
        return {"status": "refused", "message": str(error)}
    if there.status != "converged":
        return {"status": there.status}
    estimates = [p.accuracy.error_estimate for p in (here, there)]
    told = sum(np.inf if e is None else e / p.scene.cable.length for e, p in zip(estimates, (here, there), strict=True))
    return {
        "status": there.status,
        "away": away(here, there, image),
        "told": told if not any(words in p.message for words in OPEN for p in (here, there)) else np.inf,
        "same_grid": _grid(here) == _grid(there),
    }


def _grid(prediction: Prediction) -> tuple[int, int, int]:
    accuracy = prediction.accuracy
    return accuracy.n_u, accuracy.n_t, accuracy.steps


def table(records: list[dict[str, Any]]) -> str:
    """Return a Markdown table of the records: a row an image."""
    lines = [
        "| image | both converge | one does | largest, 50 % | 95 % | " + " | ".join(f"> {x:.0e} L" for x in APART)
        + " | on other grids | beyond what both tell |",
        "|" + "---|" * (7 + len(APART)),
    ]  # fmt: skip
    for name in LOOKS:
        found = [(r["index"], r["images"][name]) for r in records if name in r["images"]]
        both = [(index, image) for index, image in found if "away" in image]
        one = sum(image["status"] not in ("converged", "refused") for _, image in found)
        apart = np.array([image["away"] for _, image in both])
        middle, most = np.quantile(apart, [0.5, 0.95]) if both else (np.nan, np.nan)
        over = " | ".join(str(int((apart > x).sum())) for x in APART)
        other = sum(not image["same_grid"] for _, image in both)
        beyond = [index for index, image in both if image["away"] > max(FAR, 2.0 * image["told"])]
        listed = f"{len(beyond)}{': ' if beyond else ''}{' '.join(map(str, beyond[:8]))}"
        lines.append(f"| {name} | {len(both)} | {one} | {middle:.0e} | {most:.0e} | {over} | {other} | {listed} |")
    return "\n".join(lines)
