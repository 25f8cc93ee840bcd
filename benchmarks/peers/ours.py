"""The project's own predictor as one of the peers: whole calls of `predict`, tables and start included."""

from collections.abc import Callable
from dataclasses import replace
from typing import Literal, cast

import numpy as np

from benchmarks.peers.cases import Case, Floats
from benchmarks.peers.search import TOLERANCES, Setting, Value
from dlocore import Prediction, Quality, Scene, predict
from dlocore.shape.fit import forget_fits

N_U = (7, 9, 11, 13, 15, 17, 21, 25, 33, 41, 49)
N_T = (9, 11, 13, 15, 17, 19, 21, 25, 29, 33, 41, 49, 65, 97)


class Spline:
    """`march` or `spacetime` on a given grid, without the error estimate: the peers have none either."""

    def __init__(self, method: Literal["march", "spacetime"], budget: float) -> None:
        self.method, self.budget = method, budget
        self.name = f"dlocore {method}"

    def knobs(self, case: Case) -> dict[str, tuple[Value, ...]]:
        """Return control points along the cable and in time."""
        return {"n_u": N_U, "n_t": N_T}

    def cost(self, case: Case, setting: Setting) -> float:
        """Return the size of the grid."""
        return cast(int, setting["n_u"]) * cast(int, setting["n_t"])

    def prepare(self, case: Case, setting: Setting) -> Callable[[], Callable[[], Floats]]:
        """Return the call of `predict` on a grid."""
        n_u, n_t = cast(int, setting["n_u"]), cast(int, setting["n_t"])
        return _calls(case, Quality(n_u=n_u, n_t=n_t, method=self.method, estimate=False))


class Asked:
    """What a user gets who asks for the tolerance and knows nothing else; it finds its grid within the time."""

    name = "dlocore target_error"
    budget = np.inf

    def knobs(self, case: Case) -> dict[str, tuple[Value, ...]]:
        """Return the tolerances; the rest is the predictor's."""
        return {"target_error": TOLERANCES, "grid": ("its own",)}

    def cost(self, case: Case, setting: Setting) -> float:
        """Return the same for all: each is tried, since none stands for another."""
        return 1.0

    def prepare(self, case: Case, setting: Setting) -> Callable[[], Callable[[], Floats]]:
        """Return the call of `predict` with a target."""
        return _calls(case, Quality(target_error=cast(float, setting["target_error"])))


def _calls(case: Case, quality: Quality) -> Callable[[], Callable[[], Floats]]:
    scene: Scene = replace(case.scene, quality=quality)
    forget_fits()  # of the points where the cable starts: fitting them is part of a call

    def run() -> Callable[[], Floats]:
        prediction: Prediction = predict(scene, keep_grid=True)
        if prediction.status not in ("converged", "max_iterations"):
            raise RuntimeError(prediction.message)
        return lambda: prediction.surface.positions(case.places, case.times)

    return run
