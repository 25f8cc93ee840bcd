"""Run a study."""

import time
from collections.abc import Callable
from datetime import UTC, datetime

import numpy as np

from dlocore.calibration import source_mark
from dlocore.errors import Cancelled, SceneError
from dlocore.front import predict
from dlocore.machine import machine
from dlocore.prediction import Prediction
from dlocore.scene.scene import Scene
from dlocore.study.judge import Truth, finest_march, positions_of, step_by_step
from dlocore.study.plan import Case, StudyPlan
from dlocore.study.record import EffectCost, Run, Scaled, Step, Study
from dlocore.study.scaling import effect_pairs, sizes
from dlocore.study.timing import Times, timed
from dlocore.warming import warm_up
from dlocore.words import in_ms

OnProgress = Callable[[int, int, str], None]
_PATIENCE = 2.0  # [s] for the repeats of one solve
_TRUTH_PATIENCE = 10.0  # [s] for the marches that make a truth, before the last one


def run_study(
    plan: StudyPlan,
    *,
    on_progress: OnProgress = lambda done, total, what: None,
    cancelled: Callable[[], bool] = lambda: False,
    deadline: float | None = None,
) -> Study:
    """Measure what a plan requests.

    A run that the solver refuses, such as a grid without room for a scene's grasps, is recorded as refused and skipped.

    Args:
        plan: what is measured.
        on_progress: called before each part with how many are done, how many there are, and which is next.
        cancelled: called within the solves; if it returns True the study stops.
        deadline: time allowed for one solve [s]; one that reaches it is measured as far as it got.

    Raises:
        Cancelled: `cancelled` returned True.
    """
    began = time.perf_counter()
    measuring = _Measuring(plan, on_progress, cancelled, deadline)
    measuring.next("compiling")
    warm_up()
    runs = measuring.runs() if "runs" in plan.parts else ()
    scaling = measuring.scaling() if "scaling" in plan.parts else ()
    effects = measuring.effects() if "effects" in plan.parts else ()
    on_progress(measuring.total, measuring.total, "done")
    return Study(
        machine=machine(),
        source=source_mark(),
        measured_at=datetime.now(UTC).isoformat(timespec="seconds").replace("+00:00", "Z"),
        duration=time.perf_counter() - began,
        judge=plan.judge,
        runs=runs,
        refused=tuple(measuring.refused),
        scaling=scaling,
        effects=effects,
    )


class _Measuring:
    """The progress of one study, and what was refused."""

    def __init__(
        self, plan: StudyPlan, on_progress: OnProgress, cancelled: Callable[[], bool], deadline: float | None
    ) -> None:
        self._plan = plan
        self._on_progress = on_progress
        self._cancelled = cancelled
        self._deadline = deadline
        self._done = 0
        self._sizes = list(sizes()) if "scaling" in plan.parts else []
        self._pairs = list(effect_pairs()) if "effects" in plan.parts else []
        count = plan.count + len(plan.scenes) * len(plan.effects) if "runs" in plan.parts else 0
        self.total = 1 + count + len(self._sizes) + len(self._pairs)
        self.refused: list[str] = []

    def next(self, what: str) -> None:
        """Announce the next part, and stop if that is requested."""
        if self._cancelled():
            raise Cancelled("The study was cancelled.")
        self._on_progress(self._done, self.total, what)
        self._done += 1

    def _solved(self, scene: Scene) -> tuple[Prediction, Times]:
        return timed(
            lambda: predict(scene, deadline=self._deadline, cancelled=self._cancelled, keep_grid=True),
            self._plan.repeats,
            _PATIENCE,
        )

    def _truth(self, scene: Scene) -> Truth:
        if self._plan.judge == "reference":
            return step_by_step(scene, cancelled=self._cancelled)
        return finest_march(scene, patience=_TRUTH_PATIENCE, cancelled=self._cancelled)

    def _effects_of(self, name: str) -> str:
        """Return the name of a set of effects as an addition to that of a scene, if there are several sets."""
        return f", effects {name}" if len(self._plan.effects) > 1 else ""

    def _words(self, case: Case) -> str:
        """Return a run in words that no other run of the study has."""
        quality = case.scene.quality
        several = len(self._plan.deltas) > 1 and quality.method != "march"
        delta = f", delta {quality.delta:g}" if several else ""
        return f"{case.name}{self._effects_of(case.effects)}: {quality.method}, {quality.n_u} x {quality.n_t}{delta}"

    def runs(self) -> tuple[Run, ...]:
        """Measure scenes over grids, thresholds, methods and sets of effects."""
        found = []
        for name, effects, scene in self._plan.variants():
            cases = list(self._plan.cases(name, effects, scene))
            self.next(f"{name}{self._effects_of(effects)}: the converged motion")
            try:
                truth = self._truth(scene)
            except SceneError as error:
                self.refused.append(f"{name}{self._effects_of(effects)}: {error}")
                self._done += len(cases)
                continue
            for case in cases:
                what = self._words(case)
                self.next(what)
                try:
                    prediction, times = self._solved(case.scene)
                except SceneError as error:
                    self.refused.append(f"{what}: {error}")
                else:
                    found.append(_run(case, prediction, times, truth))
        return tuple(found)

    def scaling(self) -> tuple[Scaled, ...]:
        """Measure the cost against the size of a problem."""
        found: list[Scaled] = []
        marches: dict[tuple[str, float], float] = {}  # measured before the solves that begin with them
        for size in self._sizes:
            method = size.scene.quality.method
            self.next(f"cost against {size.variable} = {size.value:g}: {method}")
            prediction, times = self._solved(size.scene)
            key = (size.variable, float(size.value))
            count, before = 1, 0.0
            if method == "march":
                marches[key] = times.median
            else:  # the number of iterations that a solve takes does not depend on its size
                count, before = len(prediction.iterations), marches[key]
            if times.median <= before:
                began = f"{in_ms(times.median)}, not above the {in_ms(before)} of the march that it begins with"
                self.refused.append(f"cost against {size.variable} = {size.value:g}: {method} took {began}")
            else:
                time, spread = (times.median - before) / count, times.spread / count
                found.append(Scaled(variable=key[0], value=key[1], method=method, wall_time=time, spread=spread))
        return tuple(found)

    def effects(self) -> tuple[EffectCost, ...]:
        """Measure the cost by effect."""
        found = []
        for effect, present, absent in self._pairs:
            self.next(f"cost of {effect}")
            times = [self._solved(scene)[1].median for scene in (present, absent)]
            found.append(EffectCost(effect=effect, present=times[0], absent=times[1]))
        return tuple(found)


def _run(case: Case, prediction: Prediction, times: Times, truth: Truth) -> Run:
    away = np.linalg.norm(positions_of(prediction) - truth.positions, axis=-1)
    accuracy = prediction.accuracy
    steps = [
        Step(update=_finite(i.update), residual=_finite(i.residual), wall_time=i.wall_time)
        for i in prediction.iterations
    ]
    return Run(
        scene=case.name,
        effects=case.effects,
        method=case.scene.quality.method,
        n_u=accuracy.n_u,
        n_t=accuracy.n_t,
        delta=accuracy.delta,
        dimensions=accuracy.dimensions,
        steps=accuracy.steps,
        status=prediction.status,
        wall_time=times.median,
        spread=times.spread,
        repeats=times.repeats,
        error=float(away.max()),
        rms=float(np.sqrt((away**2).mean())),
        truth_error=_finite(truth.moved),
        estimate=accuracy.error_estimate,
        iterations=tuple(steps),
        phases=dict(accuracy.phases),
        active=tuple(effect.name for effect in prediction.effects if effect.active),
    )


def _finite(x: float) -> float | None:
    return float(x) if np.isfinite(x) else None
