"""The cost of each effect: the time of a march with it minus that of the same march without it."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from statistics import median

import dlocore
from dlocore import DloError, Prediction, Quality, Scene
from dlocore.errors import Cancelled
from dlocore.scene.scene import NEEDED, Switch

REPEATS = 5  # repetitions of each march; the median counts
LONGEST = 10.0  # s, time limit of one march


@dataclass(frozen=True, kw_only=True)
class Costs:
    """The costs of the effects that have been measured so far.

    Attributes:
        seconds: time that each effect adds to a solve [s], negative if it saves time.
        effect: the effect being measured; "" at the end.
        number: number of this effect among those to be measured, from 1.
        count: number of effects to be measured.
    """

    seconds: dict[str, float] = field(default_factory=dict)
    effect: str = ""
    number: int
    count: int

    @property
    def found_none(self) -> bool:
        """Whether the measurement has ended without a cost."""
        return not (self.effect or self.seconds)


def measure_costs(prediction: Prediction, cancelled: Callable[[], bool], on_costs: Callable[[Costs], None]) -> None:
    """Measure the time that each active effect adds to a solve of the scene of `prediction`.

    Each effect is switched off in turn. Everything else stays: the grid, the time steps, the choice of the other
    effects. Effects without which the scene can't be solved are left out.

    Args:
        prediction: prediction of the scene.
        cancelled: checked between and during the marches.
        on_costs: called before the first effect, and again whenever one more has been measured.

    Raises:
        Cancelled: `cancelled` returned True.
    """
    accuracy, effects = prediction.accuracy, prediction.effects
    chosen: dict[str, Switch] = {effect.name: "on" if effect.active else "off" for effect in effects}
    grid = Quality(n_u=accuracy.n_u, n_t=accuracy.n_t, method="march", estimate=False)
    scene = replace(prediction.scene, quality=grid, effects=chosen)
    names = [effect.name for effect in effects if effect.active and effect.name not in NEEDED]
    costs = Costs(effect=names[0] if names else "", number=1, count=len(names))
    on_costs(costs)
    usual = _time(scene, cancelled) if names else None
    for number, (name, following) in enumerate(zip(names, [*names[1:], ""], strict=True), 2):
        without = None if usual is None else _time(replace(scene, effects={**chosen, name: "off"}), cancelled)
        seconds = costs.seconds if usual is None or without is None else {**costs.seconds, name: usual - without}
        costs = Costs(seconds=seconds, effect=following, number=number, count=len(names))
        on_costs(costs)


def _time(scene: Scene, cancelled: Callable[[], bool]) -> float | None:
    """Return the median time of a march [s], None if it fails; the first one may include compiling."""
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
