"""What each effect costs: the time of a march with it, less that of the same march without it."""

import time
from collections.abc import Callable
from dataclasses import replace
from statistics import median

import dlocore
from dlocore import DloError, Prediction, Quality, Scene
from dlocore.errors import Cancelled
from dlocore.scene.scene import NEEDED, Switch

REPEATS = 5  # of each march; the median counts
LONGEST = 10.0  # s, of one march


def measure_costs(prediction: Prediction, cancelled: Callable[[], bool], on_cost: Callable[[str, float], None]) -> None:
    """Measure how much longer each active effect makes a solve of the scene of `prediction`.

    Each is switched off in turn, and everything else stays: the same grid, the same steps, the same choice of the other
    effects. Effects without which the scene is not solvable are left out.

    Args:
        prediction: of the scene.
        cancelled: asked between and during the marches.
        on_cost: called with the name of an effect and its cost [s], negative where it saves time.

    Raises:
        Cancelled: `cancelled` said so.
    """
    accuracy, effects = prediction.accuracy, prediction.effects
    chosen: dict[str, Switch] = {effect.name: "on" if effect.active else "off" for effect in effects}
    grid = Quality(n_u=accuracy.n_u, n_t=accuracy.n_t, method="march", estimate=False)
    scene = replace(prediction.scene, quality=grid, effects=chosen)
    usual = _time(scene, cancelled)
    for effect in effects:
        if usual is None or not effect.active or effect.name in NEEDED:
            continue
        without = _time(replace(scene, effects={**chosen, effect.name: "off"}), cancelled)
        if without is not None:
            on_cost(effect.name, usual - without)


def _time(scene: Scene, cancelled: Callable[[], bool]) -> float | None:
    """Return the median time of a march [s], None where it fails; the first one may have to be compiled."""
    times = []
    for _ in range(REPEATS):
        if cancelled():
            raise Cancelled("superseded")
        began = time.thread_time()
        try:
            prediction = dlocore.predict(scene, deadline=LONGEST, cancelled=cancelled, keep_grid=True)
        except Cancelled:
            raise
        except DloError:
            return None
        times.append(time.thread_time() - began)
        if prediction.status != "converged" and len(times) > 1:
            return None
    return median(times)
