"""Doubts about a motion on whose grid others agree: it may depend on its exact start or on the contact stiffness."""

from collections.abc import Mapping
from dataclasses import dataclass

from dlocore.answer.parts import Status
from dlocore.levels.level import Level
from dlocore.levels.review import turns_unsurely
from dlocore.problem.problem import Problem
from dlocore.solvers.march import march
from dlocore.solvers.monitor import Monitor, TimeIsUp
from dlocore.stability.determined import DOUBTFUL, UNDETERMINED, UNSEEN, bend_in_words, goes_astray, in_words
from dlocore.stability.firmness import firmness_in_words, gives_way
from dlocore.statics.statics import settles_elsewhere

ALLOW = "Allow a larger target_error, more time or a shorter motion."


@dataclass
class Doubts:
    """What is uncertain about the last level that was examined.

    Attributes:
        start: how far a tiny change of the start moves the motion [m]; 0 if that does not matter.
        contact: how far stiffer contact moves it [m]; 0 if that does not matter.
        lost: whether a start changes the motion so much that the scene does not determine it.
        looked: the level that was examined.
        unseen: whether there was no time to examine the newest one; then the result of the one before counts.
    """

    start: float = 0.0
    contact: float = 0.0
    lost: bool = False
    looked: Level | None = None
    unseen: bool = False

    @property
    def unsure(self) -> float:
        """How far the motion may differ by both [m]."""
        return self.start + self.contact

    def look(self, level: Level, monitor: Monitor, hard: bool) -> None:
        """Find what is uncertain about a level; `hard` as in `goes_astray`.

        Raises:
            Cancelled: the caller asked to stop.
        """
        if level is self.looked:
            return
        problem, motion = level.problem, level.motion
        length = problem.scene.cable.length
        try:
            moved = goes_astray(problem, motion, monitor, hard)
            if moved > 0.0 and turns_unsurely(level):  # coarse steps damp the turning over of sections, and its growth
                slower = march(problem, motion.grid, 2 * motion.asked, monitor, rho=motion.rho, whole=True)
                moved = max(moved, goes_astray(problem, slower, monitor, hard))
            moved = max(moved, settles_elsewhere(problem, motion.grid, monitor))
            lost = moved > UNDETERMINED * length
            gives = 0.0 if lost else gives_way(problem, motion, monitor)
        except TimeIsUp:
            self.unseen = True
            return
        self.start, self.contact = (x if x > DOUBTFUL * length else 0.0 for x in (moved, gives))
        self.lost, self.looked, self.unseen = lost, level, False

    def undermines(self, estimate: float, enough: float) -> bool:
        """Tell whether a motion whose estimated error [m] would be good enough [m] may still differ by too much."""
        return self.lost or (self.unsure > 0.0 and estimate + self.unsure > enough)

    def hopeless(self, enough: float) -> bool:
        """Tell whether a motion may differ by more than is good enough [m] however fine its grid is."""
        return self.lost or self.unsure > enough

    def status(self, status: Status, advice: str, estimate: float, enough: float) -> tuple[Status, str]:
        """Return the status and advice of an answer, which is not converged if these doubts undermine it."""
        if self.hopeless(enough):
            return "stalled", " Make the motion slower, damp it, or hold the cable in more places."
        return ("max_iterations", f" {ALLOW}") if self.undermines(estimate, enough) else (status, advice)

    def told(
        self, message: str, parts: Mapping[str, float] | None, problem: Problem, enough: float
    ) -> tuple[str, dict[str, float] | None]:
        """Return a message and the parts of the error [m], including what is uncertain."""
        parts, said = dict(parts or {}), []
        if self.start:
            parts["start"] = self.start
            words = in_words if self.lost or self.start > enough else bend_in_words
            said.append(words(problem, self.start))
        if self.contact:
            parts["contact"] = self.contact
            said.append(firmness_in_words(self.contact))
        if said:
            return f"{message} But {', and '.join(said)}.", parts
        return message + (f" {UNSEEN}" if self.unseen else ""), parts or None
