"""One march with all the effects that its motion calls for, and its status and message."""

from collections.abc import Mapping
from dataclasses import replace
from typing import NamedTuple, cast

from dlocore.answer.parts import Status
from dlocore.levels.driven import closes_beside, driven, words
from dlocore.levels.level import (
    CREDIBLE_STRAIN,
    Level,
    Size,
    credible_after,
    hardness,
    run_level,
    stretched,
)
from dlocore.levels.pressed import pressed_into
from dlocore.levels.progress import record_level
from dlocore.levels.review import FAR_MORE, called_for, called_for_by_fine
from dlocore.problem.checks import TOO_DEEP
from dlocore.problem.discretisation import smallest_n_u
from dlocore.problem.problem import Problem, pose
from dlocore.problem.strained import FOLDED, STRAINED, TORN
from dlocore.problem.time_grid import smallest_n_t
from dlocore.problem.winding import unseen_helix
from dlocore.solvers.march import RHO
from dlocore.solvers.monitor import Monitor, TimeIsUp
from dlocore.stability.sideways import may_leave_plane

_LOOKS = (1, 2, 3)  # grids on which it is checked whether a motion leaves its plane


class Outcome(NamedTuple):
    """A level of refinement, its status and message, and the parts of its estimated error [m], or None."""

    level: Level
    status: Status
    message: str
    errors: Mapping[str, float] | None


def march_level(
    problem: Problem,
    size: Size,
    monitor: Monitor,
    rho: float = RHO,
    free_knots: bool = False,
    rough: bool = False,
    known: Level | None = None,
    before: Level | None = None,
    watch: bool = False,
    whole: bool = False,
) -> Level:
    """March on one grid, repeated with the effects that were left out if the motion calls for them.

    Args:
        problem: what is to be solved.
        size: of the grid.
        monitor: of the solve.
        rho: spectral radius.
        free_knots: whether time knots may be added, see `run_level`.
        rough: whether a finer grid follows. On a rough grid strands may meet, and a motion may leave its plane, just
            because of the grid, so that is left open.
        known: a march of this grid, which is repeated only for what rough grids leave open.
        before: the previous level: contact begins as stiff as it had to be there, strains are believed that are not far
            above its own, and a start that is to settle does so from its start.
        watch: whether to keep the cable from folding within a span, see `run_level`.
        whole: whether a march cut short by the deadline is of no use.

    Raises:
        Cancelled: the caller asked to stop.
        TimeIsUp: the deadline passed, and the march had to be `whole`; it names the effects that were called for.
    """
    called, asked = dict(problem.called_for), problem.called_for
    while True:
        if free_knots:
            size = Size(max(size.n_u, smallest_n_u(problem)), max(size.n_t, smallest_n_t(problem)), size.steps)
        stiffness, credible, like = 1.0, CREDIBLE_STRAIN, None
        if before is not None and before.posed is problem:
            stiffness, credible, like = hardness(before), credible_after(before), before.motion.grid
        try:
            level = known or run_level(
                problem, *size, monitor, rho=rho, free_knots=free_knots, hardness=stiffness, credible=credible,
                watch=watch, like=like, whole=whole,
            )  # fmt: skip
        except TimeIsUp:
            raise TimeIsUp(*(name for name in called if name not in asked)) from None
        if known is not None:
            new, known = called_for_by_fine(level), None
        else:
            new = {} if level.motion.stopped == "time" else called_for(level, fine=not rough)
        if not new:
            return level
        record_level(replace(level, note=f"calls for {', '.join(new)}"), monitor)
        called |= new
        problem = pose(problem.scene, called)


def sided(problem: Problem, monitor: Monitor) -> Problem:
    """Return the problem, with a side to go to if a march shows that its motion leaves its plane."""
    scene = problem.scene
    bends = scene.cable.yields and scene.effects.get("plasticity", "auto") != "off"  # for good: they may turn over
    if not (may_leave_plane(problem) or bends):
        return problem
    for number in _LOOKS:
        called = march_level(problem, stretched(problem, number), monitor).posed.called_for
        if "side" in called:
            return pose(problem.scene, {"side": called["side"]})
    return problem


def march_status(level: Level) -> tuple[Status, str]:
    """Return the status and the message of a march."""
    problem, motion = level.problem, level.motion
    if not motion.stopped and motion.largest_strain > TORN:
        strain = f"The motion strains the cable along itself by {motion.largest_strain:.0%}, which no cable can follow."
        advice = "Bring the grasps no farther apart than the length of cable between them, or make the motion slower."
        if len(problem.scene.grasps) < 2:  # it is pulled by what it carries and what slows it down
            stiffness = cast(float, problem.scene.cable.axial_stiffness)
            advice = f"Its axial stiffness is {stiffness:.3g} N: give it more, or less mass, weight, drag or speed."
        return "stalled", f"{strain} {advice}"
    if is_folded(level):
        least, most = motion.slopes
        seen = f"|r'| is {least:.2g} to {most:.2g} within a span"
        return "stalled", f"The cable is folded finer than its control points can show: {seen}. Use more of them."
    if motion.stopped != "time":
        off = closes_beside(problem, motion)
        if off:
            return "stalled", off
        inside = driven(problem, motion)
        if inside is not None:
            return "stalled", words(problem, inside)
    deep = motion.deepest / problem.scene.cable.diameter
    if not motion.stopped and deep > TOO_DEEP:
        pushed = f"The cable is pressed {deep:.0%} of its diameter into {pressed_into(problem, motion)}."
        return "stalled", f"{pushed} Press it in less, or move it more slowly."
    if not motion.stopped:
        split = f", {motion.split} of them in smaller steps" if motion.split else ""
        return "converged", f"Every time step found its equilibrium{split}.{level.mended}"
    reached = motion.times[motion.reached]
    rest = f"The surface stands still after {reached:.4g} s of {problem.horizon:.4g} s."
    if motion.stopped == "time":
        return "time_limit", f"The time limit passed. {rest} Allow more time or a coarser grid."
    return (
        "stalled",
        f"A time step found no equilibrium. {rest} Allow more control points, or a slower or smoother motion.",
    )


def is_uneven(level: Level) -> bool:
    """Tell whether a whole motion strains the cable within a span, and far more than at the points that watch it."""
    least, most = level.motion.slopes
    strain = max(1.0 - least, most - 1.0)
    return not level.motion.stopped and strain > max(STRAINED, FAR_MORE * level.motion.largest_strain)


def helix(level: Level) -> float:
    """Return the radius of the helix [m] to which torque may wind the cable at the end of a whole motion, unseen."""
    motion = level.motion
    return 0.0 if motion.stopped else unseen_helix(level.problem, motion.grid, motion.states[-1], motion.history)


def is_folded(level: Level) -> bool:
    """Tell whether a whole motion folds the cable within a span: grids may agree on it, but no real cable does it."""
    least, most = level.motion.slopes
    return not level.motion.stopped and not (least >= FOLDED and most <= 2.0 - FOLDED)
