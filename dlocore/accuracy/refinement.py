"""Marches refined until two of them agree: first the whole grid, then the direction with the larger error."""

from dataclasses import dataclass, field, replace

import numpy as np

from dlocore.accuracy.budget import Means, first_level
from dlocore.accuracy.changes import DIRECTIONS, MORE, Changes, refined, untold, weighed
from dlocore.accuracy.cost import Cost
from dlocore.accuracy.doubts import ALLOW, Doubts
from dlocore.answer.parts import Status
from dlocore.errors import SceneError
from dlocore.levels.level import (
    ACCEPT,
    LEVELS,
    Level,
    Size,
    credible_after,
    distance,
    stretched,
    turned,
)
from dlocore.levels.progress import record_level
from dlocore.levels.review import neglected
from dlocore.levels.whole_march import Outcome, helix, is_folded, is_uneven, march_level, march_status
from dlocore.problem.problem import Problem
from dlocore.scene.scene import AUTO_TARGET, Quality
from dlocore.solvers.march import RHO, STRONGLY_DAMPED
from dlocore.solvers.monitor import Monitor, TimeIsUp
from dlocore.solvers.timefit import MISSED_COUNTS
from dlocore.statics.statics import RESTLESS
from dlocore.words import in_mm, in_ms

AUTO_ENOUGH = 1e-2  # of the length: the estimated error that quality "auto" accepts if the finest grids get no closer
ROUGH = 0.05  # of the length: grids that differ more are not in order yet: the next is marched with strong damping
_FINER = {"space": 1.5, "time": 2.0}
_FINE_IN_TIME = 0.3  # of the target: a time spline that misses its march by less keeps its knots as steps halve
_AT_BEST = 0.2  # of an error is left by one refinement, at best: if that is too much after all of them, none is begun
_EVENED = 3  # refinements in space, at most, of a grid that agrees with the one before, but hides strain or helices
_TEARS = 0.5  # axial strain that no finer grid is expected to remove, once ...
_TORN = 3  # ... this many in a row have it
_FAILURES = 2  # refinements in time of a march that found no equilibrium


def climb(problem: Problem, quality: Quality, monitor: Monitor, cost: Cost | None = None) -> Outcome:
    """March on finer and finer grids until two agree within the target, or the time budget is used up.

    The first few refine space and time together, which is all that most motions need. The remaining error is mostly in
    one of the two: a released cable vibrates faster than it is curved, a tightening loop is curved more than it is
    fast. So from then on each grid is finer in one direction, that whose last refinement moved the surface most, and
    the error is the sum of both.

    - A cable that folds between its control points gets more of them, whatever grids agree on.
    - The error is at least the misfit of the time spline to its march: a cable that trembles faster than two grids can
      show looks alike on both.
    - If two grids in turn say that the scene does not determine the motion, that is the answer.
    - A march that finds no equilibrium is tried with more steps before it is given up. The refinement ends if the
      motion tears the cable on grid after grid.
    - With a time budget, the first grid is chosen by the cost of solves on this machine. With a budget or a deadline,
      more grids are allowed within it than without, when a caller would wait for minutes.

    A requested target has to be met. Quality "auto" aims at AUTO_TARGET with a share of the work that a target is
    worth. If it gets no closer with that, an estimate of AUTO_ENOUGH counts as converged, and all of the work is
    allowed to reach it. The message says how far the grids agree.
    """
    length = problem.scene.cable.length
    budget = quality.time_budget
    return _Climb(
        problem=problem,
        means=Means(monitor, cost, budget or np.inf),
        target=quality.target_error or AUTO_TARGET * length,
        enough=quality.target_error or AUTO_ENOUGH * length,
        number=0 if budget is None else first_level(problem, cost, budget),
    ).outcome()


@dataclass(kw_only=True)
class _Climb:
    """One refinement and its progress.

    Attributes:
        problem: what is solved now; motions may call for more effects.
        means: what it may spend.
        target: the error aimed at [m].
        enough: the estimated error that is accepted if no finer grid is left [m].
        number: how many grids have refined space and time together, including this one.
        direction: in which the current grid is meant to be finer than the best one: "both", "space" or "time".
        best: the finest march so far that is credible.
        shown: the best march on grids whose start came to rest, if it does not on finer ones.
        changes: how far refinements moved the surface.
        estimate: error of the best march [m].
        rho: spectral radius of the next march.
        failures: marches in a row that were worse than the best one or found no equilibrium where it did.
        doubts: what is uncertain about the last grid that agreed, since other grids would agree on it too.
        torn: marches in a row that strained the cable by more than `_TEARS`.
        evened: how often control points were added because the cable was strained between the points that watch it,
            or twisted enough to wind itself more finely than they show.
        wanting: effects that a finer grid called for but that there was no time to march with, in words.
    """

    problem: Problem
    means: Means
    target: float
    enough: float
    number: int
    direction: str = "both"
    best: Level | None = None
    shown: Level | None = None
    changes: Changes = field(default_factory=Changes)
    estimate: float = np.inf
    rho: float = RHO
    failures: int = 0
    doubts: Doubts = field(default_factory=Doubts)
    torn: int = 0
    evened: int = 0
    wanting: str = ""

    @property
    def monitor(self) -> Monitor:
        """The monitor of the solve."""
        return self.means.monitor

    @property
    def _timed(self) -> bool:
        """Whether a time budget was given."""
        return self.means.budget < np.inf

    def outcome(self) -> Outcome:
        """March until an answer is found, and return it."""
        found: Size | Outcome | None = stretched(self.problem, self.number)
        while isinstance(found, Size):
            found = self._after(found)
        return self._ended() if found is None else found

    def _after(self, size: Size) -> Size | Outcome | None:
        """March on a grid; return the size of the next one or the answer, None if none is left or the time is up."""
        began, marches = self.monitor.elapsed(), len(self.monitor.iterations)
        try:
            level = self._march(size)
        except TimeIsUp as up:
            self.monitor.phase("march")
            self.wanting = ", ".join("a side to go to" if name == "side" else name for name in up.args)
            return None
        except SceneError as error:
            if error.field != RESTLESS:
                raise
            return self._without_rest(error)
        others = self.monitor.iterations[marches:]  # marches of this grid that called for another effect
        spent = self.monitor.elapsed() - (others[-1].wall_time if others else began)
        self.means.took(self.problem, size, spent)
        if self.best is not None:
            more = self._after_failure(level, self.best, size)
            if more is not None:
                record_level(level, self.monitor)
                return more
            if level.motion.stopped and not self.best.motion.stopped:
                return self._unfinished(level, self.best)
            self._weigh(level, self.best)
        record_level(level, self.monitor)
        self.best, self.failures = level, self.failures + 1 if level.motion.stopped else 0
        found = self._decided(level, size)
        checked = bool(np.isfinite(level.change))
        if isinstance(found, Size) and not self.means.next_fits(self.problem, size, found, spent, checked):
            return self._within_budget(level)
        return found

    def _without_rest(self, error: SceneError) -> Size | Outcome:
        """Return the size of the next grid if a start found no rest, or the answer if none is left.

        A start that finds no rest on few control points may do so on more. One that did on still fewer was at rest only
        because they can't bend the way it would go.
        """
        self.number += 1
        self.shown = self.best or self.shown
        if self.number >= len(LEVELS) or (self.shown is not None and self.means.used_up):
            if self.shown is None:
                raise error
            return self._restless(self.shown, error)
        self._forget()
        return stretched(self.problem, self.number)

    def _decided(self, level: Level, size: Size) -> Size | Outcome | None:
        """Return the size of the grid after a level, or the answer, None if no finer grid is left."""
        status, message = march_status(level)
        if level.motion.stopped == "time" or self.failures > len(LEVELS):
            return Outcome(level, status, message, None)
        self.torn = self.torn + 1 if level.motion.largest_strain > _TEARS else 0
        if self.torn == _TORN:
            return Outcome(level, status, message, self.changes.parts(level))
        agrees = self.estimate <= ACCEPT * self.target and not self._timed
        hides = agrees and (is_uneven(level) or helix(level) > self.target) and self.evened < _EVENED
        self.evened += hides
        unfolds = self._affordable(_finer(size, "space", False)) if hides or is_folded(level) else None
        if agrees and unfolds is None:
            return self._confirmed(level, size, status, message)
        return self._unfolded(level, size) or self._refined_further(level, size, unfolds, status == "converged")

    def _confirmed(self, level: Level, size: Size, status: Status, message: str) -> Size | Outcome:
        """Return the answer of a level that agrees with the one before, or the size of a grid that may refute it."""
        finer = self._once_more(size)
        if finer is not None:
            return finer
        if status != "converged":
            return Outcome(level, status, message, self.changes.parts(level))
        before = self._undermined
        self._look(level)
        # on a coarse grid disturbances may grow that do not on a fine one
        helps = self._can_make_up or not before
        finer = self._next(level, size, None) if self._undermined and helps else None
        return self._agreeing(level) if finer is None else finer

    def _refined_further(self, level: Level, size: Size, unfolds: Size | None, converged: bool) -> Size | None:
        """Return the size of the grid after a level that does not agree with the one before; None if none is left."""
        self._look_back(level, size)
        finer = self._next(level, size, unfolds)
        if finer is None and converged and self.estimate <= self.enough:
            self._look(level)
            finer = self._next(level, size, unfolds) if self._undermined and self._can_make_up else None
        return finer

    def _march(self, size: Size) -> Level:
        """March on the next grid; if its motion calls for another effect, forget the previous grids."""
        before = self.best
        if before is not None:
            self.monitor.end_within(self.means.budget)
            self.monitor.check()
        rho = self.rho
        if before is not None and size.steps == before.size.steps and before.motion.rho == STRONGLY_DAMPED:
            rho = STRONGLY_DAMPED  # without it, the same steps went astray
        level = march_level(
            self.problem, size, self.monitor, rho, free_knots=True, rough=True, before=before, whole=before is not None
        )
        if before is not None and level.posed is self.problem:
            change = distance(before, level)
            beside = (before.lean, *(() if self._refined(level, before) == "both" else before.beside[:1]))
            level = replace(level, change=change, turned=turned(before, level), beside=beside)
            if not self._is_rough(level):  # so strands do not meet just because of the grid
                level = march_level(self.problem, size, self.monitor, rho, free_knots=True, known=level, whole=True)
        if level.posed is not self.problem:
            self._forget()  # a different motion
        self.problem = level.posed  # a rough grid may have needed contact that is too stiff for a fine one
        return level

    def _refined(self, level: Level, best: Level) -> str:
        """Return in which direction a grid turned out to be finer than the best one.

        If a grid needed more control points than planned to be credible, the next one may have no more than it.
        """
        return refined(level, best) if self.direction == "both" else self.direction

    def _forget(self) -> None:
        """Forget the previous grids."""
        self.best, self.changes, self.estimate = None, Changes(), np.inf
        self.evened, self.torn, self.doubts = 0, 0, Doubts()

    def _is_rough(self, level: Level) -> bool:
        return not level.change <= ROUGH * self.problem.scene.cable.length

    def _after_failure(self, level: Level, best: Level, size: Size) -> Size | None:
        """Return the size to try if a finer grid failed; None if it did not, or if enough were tried."""
        if not _is_worse(level, best):
            return None
        self.failures += 1
        if self.failures > _FAILURES or self._timed:
            return None
        return self._affordable(_finer(size, "space" if is_folded(best) else "time", True))

    def _weigh(self, level: Level, best: Level) -> None:
        """Record how far a level moved the surface, the error that indicates, and how to damp the next march."""
        if best.motion.stopped:  # its surface stands still from there on, so its distance to another says nothing
            self.changes, self.estimate = Changes(), np.inf
            return
        self.changes.note(self._refined(level, best), level, best)
        self.estimate = self.changes.estimate(level)
        rough = self._is_rough(level)
        if self.number < len(LEVELS) or (rough and self.problem.self_contact is not None):
            self.rho = STRONGLY_DAMPED if rough else RHO  # later on two marches would differ by their damping

    def _once_more(self, size: Size) -> Size | None:
        """Return the next size in a direction whose last refinement says little about this grid; None if there is none.

        On coarse steps, which damp what they can't resolve, more control points may move the surface far less.
        """
        for direction in self.changes.stale(self.target):
            finer = self._affordable(_finer(size, direction, False))
            if finer is not None:
                self.direction = direction
                return finer
        return None

    def _look_back(self, level: Level, size: Size) -> None:
        """Find the error of the steps from half as many, if it is unknown and twice as many are expensive.

        This happens if a motion calls for another effect on a fine grid: the previous grids then say nothing about it.
        """
        known = "both" in self.changes.last or "time" in self.changes.last
        if known or self.number < len(LEVELS) - 1 or level.motion.stopped or is_folded(level):
            return
        if not self.means.is_dear(self.problem, _finer(size, "time", False)):
            return
        half = size._replace(steps=size.steps // 2)
        try:
            coarse = march_level(
                self.problem, half, self.monitor, level.motion.rho, free_knots=True, rough=True, before=level,
                whole=True,
            )  # fmt: skip
        except TimeIsUp:
            return
        if coarse.posed is not self.problem or march_status(coarse)[0] != "converged":
            return
        moved = distance(coarse, level)
        record_level(replace(coarse, change=moved, note="shows the error of the steps"), self.monitor)
        self.changes.last["time"] = weighed(replace(level, change=moved), coarse, None, True)
        self.estimate = self.changes.estimate(level)

    def _next(self, level: Level, size: Size, unfolds: Size | None) -> Size | None:
        """Return the next size, None if no finer grid is worth its time; `unfolds` is for a motion that folds."""
        self.number += 1
        while self.number < len(LEVELS):
            finer = stretched(self.problem, self.number)
            if finer.n_u > MORE * size.n_u or finer.steps > MORE * size.steps:  # more may have been needed
                return finer._replace(n_u=max(finer.n_u, size.n_u), steps=max(finer.steps, size.steps))
            self.number += 1
        if unfolds is not None:
            longer = self._affordable(_finer(size, "time", False))
            if longer is not None and self.changes.worst() == "time" and "space" in self.changes.last:
                # if grids needed more points than planned, the error of the steps is unknown or larger
                self.direction = "time"
                return longer
            self.direction = "space"
            if "both" in self.changes.last:  # grids that agree on a fold say nothing about space
                self.changes.last.setdefault("time", self.changes.last["both"])
            return unfolds
        trembles = MISSED_COUNTS * level.missed > _FINE_IN_TIME * self.target
        sizes = {direction: self._affordable(_finer(size, direction, trembles)) for direction in DIRECTIONS}
        least = untold(level)
        errs = max(DIRECTIONS, key=lambda direction: least[direction])
        self.direction = errs if least[errs] > self.changes.error else self.changes.worst()
        change = self.changes.last.get(self.direction)
        if sizes[self.direction] is None and (change is None or change.error < self.target):
            # may still bring the sum of both below it
            self.direction = next(direction for direction in DIRECTIONS if direction != self.direction)
        if self.direction == "time" and self.problem.self_contact is None:
            # on the same steps strongly damped marches err far more; but strands that strike each other rebound less
            self.rho = RHO
        hope = _AT_BEST ** self._left(sizes[self.direction])
        allowed = self.enough - (self.doubts.unsure if self._can_make_up else 0.0)
        return None if change is not None and hope * change.moved > allowed else sizes[self.direction]

    def _affordable(self, size: Size) -> Size | None:
        """Return a size, or None if its march takes too long."""
        success = self.best is None or not is_folded(self.best)
        content = self.enough > self.target and self.estimate + self.doubts.unsure <= self.enough and success
        return self.means.affordable(self.problem, size, content)

    def _left(self, size: Size | None) -> int:
        """Return how many refinements in the direction are left, from a size on."""
        count = 0
        while size is not None:
            count += 1
            size = self._affordable(_finer(size, self.direction, False))
        return count

    def _look(self, level: Level) -> None:
        """Find what is uncertain about a level, in the time left."""
        monitor = self.monitor.within(self.means.left) if self._timed else self.monitor
        try:
            self.doubts.look(level, monitor, self.number >= len(LEVELS))
        finally:
            self.monitor.phase("estimate")

    @property
    def _undermined(self) -> bool:
        """Whether start or contact may change the motion so much that no grid can give the requested accuracy."""
        return self.doubts.undermines(self.estimate, self.enough)

    @property
    def _can_make_up(self) -> bool:
        """Whether a grid that is fine enough can make up for what start and contact may change."""
        return not self.doubts.hopeless(self.enough)

    def _agreeing(self, level: Level) -> Outcome:
        return self._answer(level, "converged", self._agreed(level))

    def _answer(self, level: Level, status: Status, message: str, advice: str = "") -> Outcome:
        """Return an answer; it is not converged if its start or contact may lead it astray."""
        message, parts = self._told(level, message)
        status, advice = self.doubts.status(status, advice, self.estimate, self.enough)
        return Outcome(level, status, message + advice, parts)

    def _told(self, level: Level, message: str) -> tuple[str, dict[str, float] | None]:
        """Return a message and the parts of the error [m], with how far start and contact may change the motion."""
        return self.doubts.told(message, self.changes.parts(level), self.problem, self.enough)

    def _agreed(self, level: Level) -> str:
        return f"Two grids agree to {in_mm(level.change)}; {self._left_over()}."

    @property
    def _in_all(self) -> float:
        """The estimated error of the best march, including neglected effects [m]."""
        return self.estimate + (0.0 if self.best is None else neglected(self.best))

    def _left_over(self) -> str:
        """Return the estimated error and the target, in words."""
        finite = np.isfinite(self.estimate)
        known = f"the estimated error is {in_mm(self._in_all, 3)}" if finite else "its error is not known"
        return f"{known}, target {in_mm(self.target, 3)}"

    def _unfolded(self, level: Level, size: Size) -> Outcome | None:
        """Return the answer of a march that watches the length at more points, if a fold is the only problem.

        A tip far shorter than a span, beyond a grasp, may fold straight back on any grid; this moves nothing else.
        """
        if not (is_folded(level) and self.estimate <= ACCEPT * self.target and not self._timed):
            return None
        try:
            other = march_level(
                self.problem, size, self.monitor, self.rho, free_knots=True, rough=True, before=level, watch=True,
                whole=True,
            )  # fmt: skip
        except TimeIsUp:
            return None
        if other.posed is not self.problem or march_status(other)[0] != "converged":
            return None
        away = distance(level, other)
        if not self.estimate + away <= self.target:
            return None
        other = replace(other, change=level.change + away, beside=level.beside, note="watched at more points")
        record_level(other, self.monitor)
        parts = self.changes.parts(other) or {}
        parts[list(parts)[-1]] += away
        return Outcome(other, "converged", self._agreed(other), parts)

    def _within_budget(self, level: Level) -> Outcome:
        """Return the best answer within the budget; it counts as converged if its error is known and small enough."""
        allowed = in_ms(self.means.budget)
        if not np.isfinite(level.change):
            return Outcome(level, "time_limit", f"{allowed} allowed only one grid, so its error is not checked.", None)
        status, failure = march_status(level)
        moved = f"The best grid in {allowed}; the last refinement moved the surface by {in_mm(level.change)}."
        self._look(level)
        message, parts = self._told(level, moved)
        if status != "converged":
            return Outcome(level, status, f"{message} {failure}", parts)
        if parts is None or sum(parts.values()) > self.enough:
            more = f"more than {AUTO_ENOUGH:.0%} of the length" if parts else "not known"
            return Outcome(level, "time_limit", f"{message} Its estimated error is {more}: allow more time.", parts)
        return Outcome(level, status, message, parts)

    def _unfinished(self, level: Level, best: Level) -> Outcome:
        """Return the best march, when a finer grid was not finished."""
        if self.estimate <= self.enough:
            return self._ended()
        status, message = march_status(level)
        errors = self.changes.parts(best) or ({"grid": best.change} if np.isfinite(best.change) else None)
        return Outcome(best, status, f"A finer grid was not finished: {message}", errors)

    def _restless(self, best: Level, error: SceneError) -> Outcome:
        """Return the best march, when the start finds no rest on finer grids, so that its error is unknown."""
        return Outcome(best, "stalled", f"On finer grids the start did not come to rest: {error}", None)

    def _ended(self) -> Outcome:
        """Return the best march, when no finer grid is left to try or the time is up."""
        best = self.best
        assert best is not None
        if self.wanting:
            words = f"The time limit passed: a finer grid calls for {self.wanting}, which this answer leaves out."
            return Outcome(best, "time_limit", f"{words} Allow more time.", None)
        if self.means.used_up:
            return self._within_budget(best)
        status, message = march_status(best)
        left = self._left_over()
        if status == "converged" and self._in_all <= self.enough:
            if not self.doubts.start:
                self._look(best)
            outcome = self._agreeing(best)
            finest = " No finer one was tried." if self.estimate > self.target else ""
            return outcome._replace(message=outcome.message + finest)
        elif status == "converged" and self.monitor.remaining() <= 0:
            status, message = "time_limit", f"The time limit passed; {left}. {ALLOW}"
        elif status == "converged":
            if not self.doubts.start:
                self._look(best)
            finest = f"{best.motion.grid.n_u} control points along the cable and {best.motion.steps} steps"
            spent = f"No grid finer than {finest} is expected to reach the target within the work allowed"
            return self._answer(best, "max_iterations", f"{spent}; {left}.", f" {ALLOW}")
        return Outcome(best, status, message, self.changes.parts(best))


def _is_worse(level: Level, best: Level) -> bool:
    """Tell whether a finer grid failed or strained the cable beyond belief, and the one before far less."""
    torn = level.motion.largest_strain > credible_after(best)
    failed = bool(level.motion.stopped) and not best.motion.stopped
    stalled = march_status(level)[0] != "converged" == march_status(best)[0]
    return torn or failed or stalled


def _finer(size: Size, direction: str, trembles: bool) -> Size:
    """Return the next size in a direction; time knots are added with the steps only if the motion `trembles`."""
    ratio = _FINER[direction]
    if direction == "space":
        return size._replace(n_u=round(ratio * size.n_u))
    return size._replace(n_t=round(ratio * size.n_t) if trembles else size.n_t, steps=round(ratio * size.steps))
