"""Calibrate a machine: errors and times of both methods over grids, and the cost of coordinates, effects, estimates."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import UTC, datetime

import numpy as np

from dlocore.accuracy.cost import Cost, Sample, fitted_rates
from dlocore.calibration import Calibration, Measured, source_mark
from dlocore.errors import Cancelled
from dlocore.front import predict
from dlocore.machine import machine, program_version
from dlocore.prediction import Prediction
from dlocore.scene.scene import Method, Quality, Scene
from dlocore.study.judge import Truth, finest_march, largest_error
from dlocore.study.scenes import accuracy_scenes, effect_scenes, hanging, paper_case
from dlocore.study.timing import Times, timed
from dlocore.warming import warm_up

Grid = tuple[int, int]
OnProgress = Callable[[int, int, str], None]

GRIDS: dict[Method, tuple[Grid, ...]] = {
    "march": ((7, 11), (9, 13), (11, 17), (13, 19), (17, 25), (21, 31), (25, 37), (33, 49), (49, 73)),
    "spacetime": ((7, 11), (9, 13), (13, 19), (17, 25), (25, 37)),
}
_TWIST_GRIDS: dict[Method, tuple[Grid, ...]] = {
    "march": ((9, 13), (17, 25), (33, 49)),
    "spacetime": ((9, 13), (17, 25)),
}
_EFFECT_GRIDS: tuple[Grid, ...] = ((13, 19), (25, 37))
_ESTIMATE_GRIDS: tuple[Grid, ...] = ((9, 13), (17, 25))
_PATIENCE = 0.4  # [s] for the repeats of one solve


@dataclass(frozen=True, kw_only=True)
class _Run:
    """One repeated solve: the scene, the grid if one is given, and the result."""

    dimensions: int
    method: Method
    grid: Grid | None
    prediction: Prediction
    times: Times
    error: float

    def sample(self, coordinates: int) -> Sample:
        return Sample(
            coordinates=coordinates,
            n_u=self.prediction.accuracy.n_u,
            n_t=self.prediction.accuracy.n_t,
            steps=self.prediction.accuracy.steps,
            iterations=0 if self.method == "march" else len(self.prediction.iterations),
            wall_time=self.times.median,
        )


@dataclass
class _Course:
    """The progress of the measurement; `next` announces the next part, and stops if that is requested."""

    total: int
    repeats: int
    on_progress: OnProgress
    cancelled: Callable[[], bool]
    done: int = 0

    def next(self, what: str) -> None:
        if self.cancelled():
            raise Cancelled("The calibration was cancelled.")
        self.on_progress(self.done, self.total, what)
        self.done += 1

    def run(self, name: str, scene: Scene, method: Method, grid: Grid, truth: Truth | None = None, **on: bool) -> _Run:
        """Solve a scene on one grid, without an error estimate unless `estimate` is on."""
        self.next(f"{name}: {method}, {grid[0]} x {grid[1]}")
        quality = Quality(n_u=grid[0], n_t=grid[1], method=method, estimate=on.get("estimate", False), keep_grid=True)
        return self._timed(replace(scene, quality=quality), method, grid, truth)

    def default(self, name: str, scene: Scene, truth: Truth) -> _Run:
        """Solve a scene by the default quality, with its error estimate."""
        self.next(f"{name}: quality auto")
        return self._timed(replace(scene, quality=Quality()), "auto", None, truth)

    def _timed(self, asked: Scene, method: Method, grid: Grid | None, truth: Truth | None) -> _Run:
        prediction, times = timed(lambda: predict(asked, cancelled=self.cancelled), self.repeats, _PATIENCE)
        return _Run(
            dimensions=prediction.accuracy.dimensions,
            method=method,
            grid=grid,
            prediction=prediction,
            times=times,
            error=np.nan if truth is None else largest_error(prediction, truth),
        )


def measure(
    *,
    repeats: int = 5,
    on_progress: OnProgress = lambda done, total, what: None,
    cancelled: Callable[[], bool] = lambda: False,
) -> Calibration:
    """Measure this machine; it takes some tens of seconds of one core.

    Args:
        repeats: timed calls of each solve, at most.
        on_progress: called before each part with how many are done, how many there are, and which is next.
        cancelled: called before each part; if it returns True the measurement stops.

    Raises:
        Cancelled: `cancelled` returned True.
    """
    began = time.perf_counter()
    scenes, effects = accuracy_scenes(), effect_scenes()
    grids = sum(len(g) for g in GRIDS.values())
    parts = len(scenes) * (2 + grids) + sum(len(g) for g in _TWIST_GRIDS.values())
    parts += (1 + len(effects)) * len(_EFFECT_GRIDS) + 4 * len(_ESTIMATE_GRIDS)
    course = _Course(parts + 1, repeats, on_progress, cancelled)
    course.next("compiling")
    warm_up()
    runs: list[_Run] = []
    defaults: list[_Run] = []
    for name, scene in scenes.items():
        course.next(f"{name}: the converged motion")
        truth = finest_march(scene, cancelled=cancelled)
        runs += [course.run(name, scene, method, grid, truth) for method in GRIDS for grid in GRIDS[method]]
        defaults.append(course.default(name, scene, truth))
    twisted = hanging("clamp")
    samples = [run.sample(run.dimensions) for run in runs]
    for method, some in _TWIST_GRIDS.items():
        samples += [course.run("clamped", twisted, method, grid).sample(4) for grid in some]
    cost = Cost(rates=fitted_rates(samples), effects=_effects(course, effects), estimates=_estimates(course))
    on_progress(course.total, course.total, "done")
    return Calibration(
        machine=machine(),
        version=program_version(),
        source=source_mark(),
        measured_at=datetime.now(UTC).isoformat(timespec="seconds").replace("+00:00", "Z"),
        duration=time.perf_counter() - began,
        points=tuple(_points(runs)),
        cost=replace(cost, deviation=_deviation(cost, samples)),
        defaults=tuple(_points(defaults)),
    )


def _points(runs: list[_Run]) -> list[Measured]:
    """Return one point for each kind of motion, method and grid asked for: median time, largest error."""
    groups: dict[tuple[int, Method, Grid | None], list[_Run]] = {}
    for run in runs:
        groups.setdefault((run.dimensions, run.method, run.grid), []).append(run)
    return [
        Measured(
            dimensions=dimensions,
            method=method,
            n_u=max(run.prediction.accuracy.n_u for run in group),
            n_t=max(run.prediction.accuracy.n_t for run in group),
            steps=max(run.prediction.accuracy.steps for run in group),
            wall_time=float(np.median([run.times.median for run in group])),
            spread=max(run.times.spread for run in group),
            error=max(run.error for run in group),
            iterations=max(len(run.prediction.iterations) for run in group) if method == "spacetime" else 0,
            converged=all(run.prediction.status == "converged" for run in group),
        )
        for (dimensions, method, _), group in groups.items()
    ]


def _effects(course: _Course, scenes: dict[str, Scene]) -> dict[str, float]:
    """Return, by effect, the factor by which it lengthens the marches of the same motion."""

    def times(name: str, scene: Scene) -> list[float]:
        return [course.run(name, scene, "march", grid).times.median for grid in _EFFECT_GRIDS]

    plain = times("without further effects", paper_case(0.25))
    return {name: max(1.0, _ratio(times(name, scene), plain)) for name, scene in scenes.items()}


def _estimates(course: _Course) -> dict[str, float]:
    """Return, by method, the factor by which an error estimate lengthens a solve."""
    found = {}
    for method in GRIDS:
        bare, estimated = (
            [
                course.run("error estimate", paper_case(0.25), method, grid, estimate=on).times.median
                for grid in _ESTIMATE_GRIDS
            ]
            for on in (False, True)
        )
        found[str(method)] = max(1.0, _ratio(estimated, bare))
    return found


def _ratio(times: list[float], others: list[float]) -> float:
    """Return the geometric mean of the ratios of two lists of times."""
    return float(np.exp(np.mean(np.log(times) - np.log(others))))


def _deviation(cost: Cost, samples: list[Sample]) -> dict[str, float]:
    """Return, by method, the median factor between modelled and measured times, taken to be at least 1."""
    factors: dict[str, list[float]] = {"march": [], "spacetime": []}
    for s in samples:
        method = "spacetime" if s.iterations else "march"
        model = cost.time(method, s.n_u, s.n_t, s.steps, coordinates=s.coordinates, estimate=False)
        factors[method].append(max(model / s.wall_time, s.wall_time / model))
    return {method: float(np.median(found)) for method, found in factors.items()}
